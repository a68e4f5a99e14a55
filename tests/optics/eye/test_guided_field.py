"""Receptors as waveguides: an eye with such receptors agrees with an ommatidium."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

import optics
from optics import AccuracyError, Eye, Ommatidium, Pupil, Waveguide, snyder_acceptance
from optics.eye import guided_field
from optics.eye.guided_field import check_guide
from optics.eye.visual_kernel import beams_to, spot_of
from optics.spectra.spectrum import daylight

FOCAL, PITCH = 50e-6, 3e-6
LENS = Pupil(12.5e-6, thin_lens_focal_length=1.34 * FOCAL, medium_n=1.34, object_n=1.0)  # a fly's facet at f/2


def eye_of(guide, pupil=LENS, receptors=9, bands=1, **others):
    width = receptors * PITCH
    fov = 2 * math.degrees(math.atan(width / (2 * FOCAL)))
    return Eye(pupil, (receptors, receptors), fov, width, bands, waveguide=guide, full_aperture=1e-4, **others)


def seen_by(ommatidium, eye, cells, side):
    """Return the means of an ommatidium's sensitivity over the cells of an eye's kernel, in tangents of the directions.
    An element of a kernel belongs to a point on the opposite side of the receptor. Columns of a kernel therefore ascend
    to the left (x) in the visual field, and rows upwards (y).
    """
    node, weight = np.polynomial.legendre.leggauss(4)
    at = (np.arange(side)[:, None] + 0.5 + node / 2 - side / 2).ravel() * PITCH / cells / FOCAL
    x, y = np.meshgrid(at, at)
    taken = ommatidium.sensitivity(np.arctan(x), np.arctan(y), float(eye.spectral_bands.wavelengths[0]))
    return np.einsum("yaxb,a,b->yx", taken.reshape(side, 4, side, 4), weight, weight) / 4 / cells**2


@pytest.mark.fast_cases(2)
@pytest.mark.parametrize("cells", [4, 5])
@pytest.mark.parametrize("diameter", [1.4e-6, 2.4e-6])
def test_an_eye_of_one_receptor_is_an_ommatidium(cells, diameter):
    """Each cell agrees, with even and odd numbers of cells across a receptor, within half the eye's tolerance of
    1e-2."""
    guide = Waveguide(diameter, length=100e-6)
    eye = eye_of(guide)
    kernel = eye.kernel(cells)[0]
    expected = seen_by(Ommatidium(LENS, guide, eye.retina_distance), eye, cells, len(kernel))
    assert len(kernel) % 2 == cells % 2
    assert np.linalg.norm(kernel - expected) < 5e-3 * np.linalg.norm(expected)


@pytest.mark.slow
def test_a_lopsided_pupil_turns_nothing_round():
    """Kernels have the orientation of receptive fields in the pupil's axes, also with coma and tilt."""
    bent = Pupil(
        12.5e-6,
        thin_lens_focal_length=1.34 * FOCAL,
        medium_n=1.34,
        object_n=1.0,
        wavefront=optics.Zernike({(1, 1): 0.05, (3, -1): 0.06}),
    )
    guide = Waveguide(1.6e-6)
    eye = eye_of(guide, bent)
    kernel = eye.kernel(4)[0]
    expected = seen_by(Ommatidium(bent, guide, eye.retina_distance), eye, 4, len(kernel))
    assert np.linalg.norm(kernel - expected) < 1e-2 * np.linalg.norm(expected)
    for turned in (expected[::-1], expected[:, ::-1], expected.T, expected[::-1, ::-1]):
        assert np.linalg.norm(kernel - turned) > 0.2 * np.linalg.norm(expected)


def test_errors_fall_with_the_tolerance():
    guide, errors = Waveguide(1.4e-6), []
    for tolerance in (3e-2, 5e-3):
        eye = eye_of(guide, tolerance=tolerance, dtype="float64")
        kernel = eye.kernel(5)[0]
        middle = slice(len(kernel) // 2 - 5, len(kernel) // 2 + 6)
        expected = seen_by(Ommatidium(LENS, guide, eye.retina_distance), eye, 5, 11)
        errors.append(np.linalg.norm(kernel[middle, middle] - expected) / np.linalg.norm(expected))
    assert errors[0] < 1e-2
    assert errors[1] < errors[0] / 2


@pytest.mark.slow
def test_a_wide_guide_integrates_intensity_over_its_section():
    """The kernel of a waveguide with dozens of modes is the PSF integrated over the disk of the waveguide. The
    evanescent fields, whose length is the radius divided by V, also collect light around the disk.
    """
    guide = Waveguide(5e-6, 1.42, 1.34)
    eye = Eye(LENS, (3, 3), 2 * math.degrees(math.atan(9e-6 / FOCAL)), 18e-6, 1, waveguide=guide, full_aperture=1e-4)
    kernel = 144 * eye.kernel(12)[0].astype(float)  # for a square of 6 µm
    light = optics.psf(LENS, eye.spectral_bands.wavelengths, eye.retina_distance, dx=0.1e-6, shape=(241, 241))
    u = (np.arange(len(kernel)) - (len(kernel) - 1) / 2) * 0.5e-6
    away = np.hypot(u[:, None], u)
    inside = np.array([light.psf[0][np.hypot(light.x - at, light.y[:, None]) <= 2.5e-6].sum() * 1e-14 for at in u])
    middle = kernel[len(kernel) // 2]
    assert len(guide.modes(550e-9)) > 40
    assert np.abs(middle - inside)[np.abs(u) < 1.2e-6].max() < 0.02
    assert np.abs(middle - inside)[np.abs(u) > 4e-6].max() < 0.03
    area = kernel.sum() * (0.5e-6) ** 2
    assert 1 < area / (math.pi * 2.5e-6**2) < (1 + 2 / guide.v_number(550e-9)) ** 2
    assert kernel[away > 2 * 2.5e-6].max() < 0.03


def test_acceptance_of_one_mode_is_narrower_than_snyders():
    """Snyder's formula √((λ/D)² + (d/f)²) ignores the waveguide. For one mode, it gives 1.97° instead of 1.398°."""
    eye = eye_of(Waveguide(1.4e-6), tolerance=5e-3)
    wavelength = float(eye.spectral_bands.wavelengths[0])
    found = eye.describe().acceptance_angle_deg
    exact = math.degrees(Ommatidium(LENS, Waveguide(1.4e-6), eye.retina_distance).acceptance_angle(wavelength))
    assert found == pytest.approx(exact, rel=0.02)  # cells of a few hundredths of the angle are averaged
    assert found < 0.8 * math.degrees(snyder_acceptance(25e-6, FOCAL, 1.4e-6, wavelength))


@pytest.mark.parametrize("cells", [3, 4])
def test_seeing_is_the_sum_over_the_scene(cells):
    """A signal is the sum over the cells of the scene, and not a mean over the cells of a receptor. White light gives
    `white_signal`.
    """
    eye = eye_of(Waveguide(1.8e-6), receptors=5, bands=2)
    side = 5 * cells + 40
    white = np.broadcast_to(daylight(eye.spectral_bands.wavelengths)[:, None, None], (2, side, side))
    assert eye.see(white, cells)[:, 2, 2].mean() == pytest.approx(eye.white_signal, rel=5e-3)
    assert eye.white_signal < 0.6 * eye.throughput
    scene, kernel = np.zeros((2, side, side)), eye.kernel(cells)
    row, column = 20 + cells, 20 + 3 * cells  # upper left cell of receptor (1, 3)
    scene[:, row, column] = 1
    # From the receptor's middle to the cell's, in cells: the kernel's origin is its own middle.
    place = round((kernel.shape[1] - 1) / 2 + (cells - 1) / 2)
    caught = eye.spectral_bands.weights @ kernel[:, place, place] * eye.throughput
    np.testing.assert_allclose(eye.see(scene, cells)[:, 1, 3], caught, rtol=1e-3)


def test_guides_off_the_axis_point_at_the_pupil():
    """The field of a facet at 20° equals that on the axis, except for the coma of the lens. A waveguide that is not
    tilted would collect almost no light from a pupil that it sees at 20°.
    """
    guide = Waveguide(1.4e-6)
    slow = Pupil(12.5e-6, thin_lens_focal_length=4 * FOCAL)
    eye = Eye(slow, (9, 9), 2 * math.degrees(math.atan(13.5e-6 / (4 * FOCAL))), 27e-6, 1, waveguide=guide)
    ahead, aside = eye.kernel(4)[0], eye.kernel(4, direction_deg=(20.0, 0.0))[0]
    assert aside.sum() == pytest.approx(ahead.sum(), rel=0.25)
    assert np.abs(np.arange(len(aside)) @ aside.sum(axis=0) / aside.sum() - (len(aside) - 1) / 2) < 1


def test_length_absorbs_what_the_core_carries():
    long, short = (eye_of(Waveguide(1.4e-6, length=at)).white_signal for at in (3e-3, 50e-6))
    every = eye_of(Waveguide(1.4e-6)).white_signal
    assert long == pytest.approx(every, rel=1e-2)
    assert short < 0.3 * every


def test_as_many_kernels_as_guides_need():
    """The number of depth layers depends on a guide's own field, not on its mean over the receptor's square."""
    from optics.eye.kernel_interpolation import worst_difference

    eye = eye_of(Waveguide(1.4e-6), bands=1)
    sight = eye.sight(4, z=np.array([0.3e-3, 10.0]))
    assert all(kernel.shape[-1] % 2 for kernel in sight.kernels.values())
    ends = [eye.kernel(4, z)[:] for z in (0.3e-3, 10.0)]
    assert worst_difference([(1, ends[0]), (-1, ends[1])], 1) > eye.tolerance / 4


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: Eye(None, waveguide=Waveguide(2e-6)), ValueError, "waveguide is given and pupil = None"),
        (lambda: eye_of(2e-6), ValueError, "waveguide = 2e-06"),
        (lambda: eye_of(Waveguide(4e-6)), ValueError, r"waveguide.diameter = 4e-06: must be at most .* = 3e-06 m"),
        (lambda: eye_of(Waveguide(0.1e-6)).kernel(4), ValueError, "has no guided mode at"),
        (lambda: eye_of(Waveguide(2e-6, 1.33)).kernel(4), ValueError, "n_core = 1.33"),
        (
            lambda: eye_of(
                Waveguide(2e-6), Pupil(12.5e-6, optics.PixelRelief(np.zeros((4, 4)) + np.eye(4) * 1e-6))
            ).kernel(4),
            ValueError,
            "height is a PixelRelief",
        ),
        (lambda: Eye(Pupil(2e-6), (5, 5), 2.0, waveguide=Waveguide(2e-6)).kernel(64), AccuracyError, "cells of"),
    ],
)
def test_bad_input_names_itself(make, error, message):
    with pytest.raises(error, match=message):
        make()


def test_derivatives_are_refused():
    import drjit as dr

    from tests.optics.device_types import Float64

    z = Float64(1e-2)
    dr.enable_grad(z)
    with pytest.raises(ValueError, match="z"):
        eye_of(Waveguide(2e-6)).kernel(4, z)


def test_a_guide_may_fill_its_receptor_and_no_more():
    """A waveguide exactly as wide as the receptor is accepted, even if the receptor's side is rounded."""
    for side in np.random.default_rng(5).uniform(1e-6, 5e-6, 20):
        check_guide(Waveguide(float(side)), LENS, (float(side), 2 * float(side)))
        check_guide(Waveguide(float(side * (1 + 5e-10))), LENS, (2 * float(side), float(side)))
        with pytest.raises(ValueError, match=r"must be at most a receptor's height .* m, so that neighbours"):
            check_guide(Waveguide(float(side * (1 + 2e-9))), LENS, (float(side), 2 * float(side)))
        with pytest.raises(ValueError, match=r"must be at most sensor_width / resolution\[1\] = .* m, so that"):
            check_guide(Waveguide(float(side * 1.01)), LENS, (2 * float(side), float(side)))


def test_the_window_of_a_focused_guide_is_narrower_than_all_diffracted_light():
    """Rays meet in the focus. The search for a window therefore starts with a window that excludes part of the
    diffracted light.
    """
    retina = eye_of(Waveguide(1.4e-6))._retina(4)
    spot = spot_of(beams_to(LENS, retina, math.inf, (0.0, 0.0)), retina)
    assert spot.half_of_rays < 0.1 * spot.half
    near = replace(retina, distance=retina.distance / 2)
    half = spot_of(beams_to(LENS, near, math.inf, (0.0, 0.0)), near).half_of_rays
    assert half == pytest.approx(LENS.aperture_radius / 2, rel=0.2), "the cone of light at half the distance"


@pytest.mark.parametrize(
    ("shares", "windows"), [((0.995,), 1), ((0.98, 0.99), 2), ((0.5, 0.9, 0.999), 3), ((0.5,) * 9, 0)]
)
def test_a_window_is_widened_until_it_contains_the_light(monkeypatch, shares, windows):
    """Each window is 1.5 times as wide as the one before, and at most as wide as the light and the waveguide."""
    retina, waveguide = eye_of(Waveguide(1.4e-6), tolerance=1e-2)._retina(4), Waveguide(1.4e-6)
    [beam] = beams_to(LENS, retina, math.inf, (0.0, 0.0))[:1]
    spot = spot_of([beam], retina)
    guide = guided_field.Guide(waveguide, FOCAL, 4)
    rows = []

    def accepted(beam, spot, guide, down, across):
        rows.append(down.count)
        return len(rows), shares[len(rows) - 1]

    monkeypatch.setattr(guided_field, "_accepted", accepted)
    assert guided_field._within(beam, spot, spot.pitch, retina, guide) == len(rows)
    most = 2 * math.ceil((spot.half + guided_field._radius(waveguide, beam)) / retina.cell[0])
    if windows:
        assert len(rows) == windows
    else:
        assert rows[-1] == most > rows[-2]
    for before, after in itertools.pairwise(rows):
        assert after == most or abs(after - 1.5 * before) <= 3
