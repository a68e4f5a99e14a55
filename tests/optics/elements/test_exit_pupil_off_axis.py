"""Exit pupils of a Cooke triplet off its axis, compared with the Huygens sum over the rays of this test."""

from types import SimpleNamespace

import numpy as np
import pytest

import optics
from tests.optics.elements.traced_lens import (
    contrast,
    gauss_rays,
    grid_rays,
    huygens,
    sensor_grid,
    solid_angles,
    triplet,
)

WAVE, PITCH = 0.55e-6, 2e-6
TILTED = (0.0, np.sin(0.3), np.cos(0.3))


def image(read, n=41):
    """Return the PSF on the image plane, divided by its sum."""
    seen = optics.psf(read.pupil, [WAVE], read.distance, dx=PITCH, shape=(n, n)).psf[0]
    return seen / seen.sum()


def huygens_image(rays, weights, n=41, normal=(0.0, 0.0, 1.0), even=True, **asked):
    """Return the Huygens sum over rays. even: True for equal amplitudes per solid angle instead of per ray"""
    wave = triplet(20, WAVE, rays, normal=normal, **asked)
    share = weights * (wave.intensity > 0)
    if even:
        share = share * solid_angles(rays, triplet(20, WAVE, rays, normal=normal), normal)
    found = huygens(wave, WAVE, sensor_grid(wave, n, PITCH, normal), share).reshape(n, n)
    return found / found.sum()


def apart(image, other):
    return np.linalg.norm(image - other) / np.linalg.norm(other)


def test_tangential_contrast_at_20_degrees():
    """A Huygens sum with equal amplitudes of all rays gives 0.139 at 50 cycles per mm, over a window of 82 µm.

    A pupil that ignores the tilt of the image plane gives 0.076.
    """
    read = optics.read_exit_pupil(triplet(20, WAVE), WAVE)
    ours, rays = image(read), huygens_image(*gauss_rays(), even=False)
    for tangential in (True, False):
        assert contrast(ours, PITCH, 50e3, tangential) == pytest.approx(
            contrast(rays, PITCH, 50e3, tangential), abs=3e-3
        )
    assert contrast(ours, PITCH, 50e3) > 0.13
    assert apart(ours, rays) < 0.015  # most of it is due to the amplitudes
    assert apart(ours[::-1], rays) > 0.5  # coma points outwards


@pytest.mark.parametrize("normal", [(0.0, 0.0, 1.0), TILTED])
def test_the_image_plane_may_be_tilted(normal):
    read = optics.read_exit_pupil(triplet(20, WAVE, normal=normal), WAVE, image_normal=normal)
    rays = huygens_image(*gauss_rays(), normal=normal)
    assert apart(image(read), rays) < 4e-3
    assert read.residual < 1e-4 * WAVE


def test_a_tilt_that_is_not_specified_changes_the_image():
    read = optics.read_exit_pupil(triplet(20, WAVE, normal=TILTED), WAVE)
    assert apart(image(read), huygens_image(*gauss_rays(), normal=TILTED)) > 0.05


def test_the_beam_is_an_ellipse_where_the_image_plane_cuts_it():
    """Rays at the rim of the entrance pupil give both half widths in direction sines."""
    turns = np.linspace(0, 2 * np.pi, 721)
    wave = triplet(20, WAVE, (np.insert(np.cos(turns), 0, 0.0), np.insert(np.sin(turns), 0, 0.0)))
    x, y = (np.ptp(at) / 2 / wave.radius for at in (wave.pupil_x, wave.pupil_y))
    read = optics.read_exit_pupil(triplet(20, WAVE), WAVE)
    wide, high = read.pupil.aperture.half_widths
    assert high / wide == pytest.approx(y / x, rel=2e-3)
    assert read.pupil.radius / np.hypot(read.pupil.radius, read.distance) == pytest.approx(x, rel=2e-3)
    assert read.position == pytest.approx((0.0, 18.136025932761e-3), abs=1e-9)  # optiland 0.6.3
    assert read.sines[1] == pytest.approx(np.mean(wave.reference_center[1] - wave.pupil_y[1:]) / wave.radius, abs=0.01)


def test_a_vignetted_pupil_has_the_shape_that_the_rays_leave():
    """The last surface is clear up to 6 mm, which cuts off a sixth of the light at 20°."""
    rays = grid_rays(141)
    read = optics.read_exit_pupil(triplet(20, WAVE, rays, limit=6.0), WAVE)
    whole = optics.read_exit_pupil(triplet(20, WAVE), WAVE)
    fine = grid_rays(401)
    kept = (triplet(20, WAVE, fine, limit=6.0).intensity > 0).mean()
    assert read.pupil.area / whole.pupil.area == pytest.approx(kept, rel=3e-3)
    exact = huygens_image(*gauss_rays(30, 120), n=33, limit=6.0)
    assert apart(image(read, 33), exact) < 0.02
    assert apart(image(whole, 33), exact) > 0.1


def test_moving_the_image_plane_equals_tracing_to_another_plane():
    """The image moves along the ray through the pupil's centre, which is not exactly the chief ray."""
    read, there = (optics.read_exit_pupil(triplet(20, WAVE, shift=shift), WAVE) for shift in (0.0, 0.1))
    moved = read.moved(0.1e-3)
    assert moved.position == pytest.approx(there.position, abs=0.2e-6)
    assert moved.image_height - read.image_height == pytest.approx(there.image_height - read.image_height, rel=1e-9)
    with pytest.raises(ValueError, match=r"shift = 0\.03: must lie in"):
        read.moved(0.03)
    assert apart(image(read.moved(0.1e-3, there.position)), image(there)) < 2e-3
    assert apart(image(read), image(there)) > 0.1
    aside = image(read.moved(0.1e-3, (there.position[0], there.position[1] - 5 * PITCH)))
    assert apart(aside[5:] / aside[5:].sum(), image(there)[:-5] / image(there)[:-5].sum()) < 3e-3


def test_square_samples_are_a_square_pupil():
    """The corners of the outermost samples are the corners of the polygon."""
    wave = SimpleNamespace(data=np.ones((128, 128), complex), dx=0.02, wavelength=WAVE * 1e6)
    read = optics.read_exit_pupil(wave, WAVE, focal_length=0.1)
    assert len(read.pupil.aperture.vertices) == 4
    assert read.pupil.area == pytest.approx((127 * 0.02e-3) ** 2, rel=1e-3)
    assert read.position is None


def test_rays_that_are_cut_off_inside_are_refused():
    wave = triplet(20, WAVE, grid_rays(121))
    wave.intensity[np.hypot(wave.pupil_x, wave.pupil_y - 1.0) < 1.0] = 0.0
    with pytest.raises(ValueError, match="obscured or not convex: only unobscured, convex pupils"):
        optics.read_exit_pupil(wave, WAVE)


@pytest.mark.parametrize(
    ("asked", "says"),
    [
        ({"image_normal": (0.0, 1.0, 0.0)}, r"image_normal = \(0.0, 1.0, 0.0\): must have a component along z"),
        ({"image_normal": (0.0, 1.0)}, r"image_normal = \(0.0, 1.0\): must be three finite"),
    ],
)
def test_a_normal_that_cannot_be_right_is_refused(asked, says):
    with pytest.raises(ValueError, match=says):
        optics.read_exit_pupil(triplet(20, WAVE), WAVE, **asked)


def test_what_samples_do_not_contain_is_refused():
    wave = SimpleNamespace(data=np.ones((128, 128), complex), dx=0.02, wavelength=WAVE * 1e6)
    with pytest.raises(ValueError, match="image_normal: must be left out, because this object does not contain"):
        optics.read_exit_pupil(wave, WAVE, focal_length=0.1, image_normal=(0.0, 0.0, 1.0))
    read = optics.read_exit_pupil(wave, WAVE, focal_length=0.1)
    with pytest.raises(ValueError, match="the position of the image is unknown"):
        read.moved(0.0, (0.0, 0.0))


def test_coarse_rays_of_a_vignetted_pupil_are_refused():
    with pytest.raises(ValueError, match=r"neither a circle nor an ellipse, and its \d+ samples are 0\.0\d+ radii"):
        optics.read_exit_pupil(triplet(20, WAVE, limit=5.0), WAVE)
