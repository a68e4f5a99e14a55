"""Openings drawn as images, against sums over their pixels and against the same openings made of other shapes."""

import time

import numpy as np
import pytest

import optics

RADIUS, FOCUS, WAVELENGTH = 50e-6, 2e-3, 550e-9
VIEW = {"dx": 2e-6, "shape": (33, 33), "tolerance": 1e-4}


def lopsided(n, seed):
    """Return a random image of zeros and ones whose open pixels lie within the circle."""
    at = (np.arange(n) + 0.5) * 2 / n - 1
    whole = np.hypot(np.abs(at) + 1 / n, (np.abs(at) + 1 / n)[:, None]) <= 1
    return np.where(np.random.default_rng(seed).random((n, n)) < 0.6, whole, 0)


def in_the_focal_plane(image, at):
    """Return the PSF in the focal plane by Fraunhofer's integral over square pixels (Goodman, §4.4.1 and §5.2). Each
    pixel gives a product of two sincs, with a phase that depends on its position. The PSF is |U|²/A, where A is the
    area of the opening and U(X) = ∫ exp(-2πi x X/λf) dx/λf.
    """
    n, pitch = len(image), 2 * RADIUS / len(image)
    centres = (np.arange(n) + 0.5) * pitch - RADIUS
    f = at / (WAVELENGTH * FOCUS)
    turned = pitch * np.sinc(pitch * f)[:, None] * np.exp(-2j * np.pi * np.outer(f, centres))
    u = turned @ image @ turned.T / (WAVELENGTH * FOCUS)
    return np.abs(u) ** 2 / (image.sum() * pitch**2)


@pytest.mark.parametrize(("n", "seed"), [(6, 1), (11, 2), (20, 3)])
def test_the_psf_is_the_sum_over_pixels(n, seed):
    """Fraunhofer's integral has an error below 1e-3 at f/20 and within 32 µm of the axis. A transposed or mirrored
    image differs by more than 0.03 even if its pixels are small."""
    image = lopsided(n, seed)
    pupil = optics.Pupil(RADIUS, thin_lens_focal_length=FOCUS, aperture=optics.union(optics.Bitmap(image)))
    result = optics.psf(pupil, [WAVELENGTH], **VIEW)

    def error(drawn):
        right = in_the_focal_plane(drawn, result.x)
        return np.linalg.norm(result.psf[0] - right) / np.linalg.norm(right)

    assert pupil.area == pytest.approx(image.sum() * (2 * RADIUS / n) ** 2, rel=1e-9)
    assert error(image) < 2e-3
    assert min(error(image.T), error(image[::-1])) > 0.03


def test_pixels_clipped_by_the_circle_are_the_shapes_they_draw():
    """An image of one open pixel is the whole disk, and an image of 2 x 2 pixels, of which one is open, is a quarter of
    it.
    """
    assert optics.union(optics.Bitmap([[1]])).area == pytest.approx(np.pi, rel=1e-12)
    quarter = optics.union(optics.Bitmap([[0, 0], [0, 1]]))
    same = optics.union(optics.Oblong(1, 1, (0.5, 0.5)))
    assert quarter.area == pytest.approx(np.pi / 4, rel=1e-12)
    found, right = (
        optics.psf(optics.Pupil(RADIUS, thin_lens_focal_length=FOCUS, aperture=shape), [WAVELENGTH], **VIEW).psf
        for shape in (quarter, same)
    )
    assert np.linalg.norm(found - right) < 2 * VIEW["tolerance"] * np.linalg.norm(right)
    assert bool(quarter.contains(0.5, 0.5))
    assert not quarter.contains(-0.5, 0.5)
    assert not optics.Bitmap([[1]]).contains(1.5, 0.0)


def test_a_checker_has_as_many_edges_as_it_shows_and_can_be_cut_from_other_shapes():
    checker = np.indices((8, 8)).sum(axis=0) % 2
    drawn = optics.Bitmap(checker)
    assert drawn.outline.length == pytest.approx(32 * 4 * 0.25)  # 32 open pixels with four sides each
    rest = optics.difference(optics.Circle(), drawn)
    assert rest.area + optics.union(drawn).area == pytest.approx(np.pi, rel=1e-9)


def test_the_image_is_copied_and_read_only():
    image = np.ones((3, 3))
    drawn = optics.Bitmap(image)
    image[:] = 0
    assert drawn.image.all()
    assert not drawn.image.flags.writeable
    assert optics.Bitmap(np.array([[True]])).image.all()


@pytest.mark.parametrize(
    ("image", "says"),
    [
        (np.ones((3, 4)), r"image has shape \(3, 4\): must be square \(n, n\), n from 1 to 512"),
        (np.ones((513, 513)), "must be square"),
        ([[0.5]], "image holds 0.5: must be 0 or 1; amplitudes in between are a MaskMap"),
        ([[255]], "image holds 255: must be 0 or 1"),
        ([[np.nan]], "image holds nan: must be 0 or 1"),
        (np.indices((100, 100)).sum(axis=0) % 2, "straight edges: must be at most 4000; draw it more coarsely"),
    ],
)
def test_other_images_are_refused(image, says):
    with pytest.raises(ValueError, match=says):
        optics.Bitmap(image)


def test_an_image_without_open_pixels_is_refused():
    with pytest.raises(ValueError, match="must leave something open within the pupil"):
        optics.union(optics.Bitmap(np.zeros((3, 3))))


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow), pytest.param(2, marks=pytest.mark.slow)])
def test_planning_and_quadrature_of_many_edges_take_as_long_as_the_sum(seed):
    """The first PSF of a 64 x 64 image took seven times as long as the second in an earlier version. The difference was
    the time for the quadrature nodes.
    """
    open_ = optics.Pupil(30e-6, aperture=optics.union(optics.Bitmap([[1]])))
    optics.psf(open_, dx=0.5e-6, shape=(65, 65), tolerance=1e-4)
    image = np.random.default_rng(seed).random((64, 64)) < 0.5
    pupil = optics.Pupil(30e-6, aperture=optics.union(optics.Bitmap(image)), thin_lens_focal_length=240e-6)
    times = []
    for _ in range(2):
        start = time.process_time()
        plan = optics.psf(pupil, dx=0.5e-6, shape=(65, 65), tolerance=1e-4).plan
        times.append(time.process_time() - start)
    assert times[0] < 4.5 * times[1]
    assert plan.seconds > 0.2
