"""Contrasts of lenses in light of several wavelengths, compared with Huygens sums over the rays of these tests."""

import numpy as np
import pytest

import optics
from tests.optics.elements.traced_lens import contrast, gauss_rays, huygens, sensor_grid, solid_angles, triplet

MICRONS, F, PITCH = (0.48, 0.55, 0.65), (20e3, 50e3), 1.5e-6


@pytest.fixture(scope="module")
def lens():
    return optics.read_exit_pupils({(20, um): triplet(20, um * 1e-6) for um in MICRONS})


def huygens_contrasts(shift, weights, n=49):
    """Return tangential and sagittal contrasts (2, frequency) of the weighted sum of PSFs around one point of the
    image. By Parseval's theorem, the light of a wave whose amplitude is 1 in all directions is λ² times their solid
    angle.
    """
    rays, each = gauss_rays(20, 70)
    plane = sensor_grid(triplet(20, 0.55e-6, rays, shift=shift), n, PITCH)
    total = np.zeros((n, n))
    for um, weight in zip(MICRONS, weights, strict=True):
        wave = triplet(20, um * 1e-6, rays, shift=shift)
        share = each / each.sum() * np.pi * solid_angles(rays, wave)
        found = huygens(wave, um * 1e-6, plane, share).reshape(n, n)
        total += weight * found * PITCH**2 / ((um * 1e-6) ** 2 * share.sum())
    light = total.sum()
    assert 0.95 < light < 1
    return light * np.array([[contrast(total, PITCH, f, tangential) for f in F] for tangential in (True, False)])


@pytest.mark.fast_cases(1)
@pytest.mark.parametrize("shift", [-0.1e-3, 0.05e-3])
def test_contrasts_through_focus_are_those_of_a_huygens_sum(lens, shift):
    weights = (0.2, 0.5, 0.3)
    found = optics.lens_mtf(lens, F, [shift], weights=np.array(weights) * 7)
    rays = huygens_contrasts(shift * 1e3, weights)
    assert found.tangential[0, 0] == pytest.approx(rays[0], abs=0.006)
    assert found.sagittal[0, 0] == pytest.approx(rays[1], abs=0.006)
    assert found.predicted_error.max() <= 0.02


def displaced(x, y, angle=0):
    """Return the rays of the triplet at 0.55 µm, with the image displaced by (x, y) [mm]."""
    wave = triplet(angle, 0.55e-6)
    wave.pupil_x, wave.pupil_y = wave.pupil_x + x, wave.pupil_y + y
    wave.reference_center = np.add(wave.reference_center, (x, y, 0))
    return wave


def test_frequencies_beyond_the_cutoff_are_refused_in_all_directions():
    """The image lies on the diagonal of the plane, so either component of a frequency is smaller by √2."""
    diagonal = optics.read_exit_pupils({(0, 0.55): displaced(1.0, 1.0)})
    pupil = diagonal.pupils[0][0].pupil
    cutoff = 2 * pupil.radius / np.hypot(pupil.radius, diagonal.pupils[0][0].distance) / 0.55e-6
    with pytest.raises(ValueError, match="is beyond the cutoff of the lens"):
        optics.lens_mtf(diagonal, 1.2 * cutoff)


def test_lateral_colour_cancels_a_pattern_of_twice_its_width():
    """Contrasts are multiplied by |cos(πfx 10 µm)| if two equal images are 10 µm apart along x. This factor is 0 at 50
    cycles per mm.

    On the axis of the lens, x is the sagittal direction.
    """
    alone = optics.read_exit_pupils({(0, 0.55): displaced(0, 0), (0, 0.550001): displaced(0, 0)})
    moved = optics.read_exit_pupils({(0, 0.55): displaced(0.010, 0), (0, 0.550001): displaced(0, 0)})
    assert moved.lateral_colour[0, 0] == pytest.approx([10e-6, 0], abs=1e-12)
    # The image at the middle wavelength, number 1 of 2, is on the axis.
    whole, halved = (optics.lens_mtf(each, (20e3, 50e3)) for each in (alone, moved))
    factor = np.abs(np.cos(np.pi * np.array(F) * 10e-6))
    assert halved.sagittal[0, 0] == pytest.approx(whole.sagittal[0, 0] * factor, abs=2e-3)
    assert halved.tangential == pytest.approx(whole.tangential, abs=2e-3)


def test_tangential_is_the_direction_from_the_axis():
    """Neither contrast changes if the lens and the image point are rotated by 90° about the axis."""
    turned = triplet(20, 0.55e-6)
    turned.pupil_x, turned.pupil_y = -turned.pupil_y, turned.pupil_x
    x, y, z = turned.reference_center
    turned.reference_center = (-y, x, z)
    found, other = (
        optics.lens_mtf(optics.read_exit_pupils({(20, 0.55): wave}), F) for wave in (turned, triplet(20, 0.55e-6))
    )
    assert found.tangential == pytest.approx(other.tangential, abs=2e-3)
    assert found.sagittal == pytest.approx(other.sagittal, abs=2e-3)
    assert np.abs(other.tangential - other.sagittal).max() > 0.02


def test_the_plot_shows_contrasts_over_shift_or_frequency():
    from matplotlib.figure import Figure

    contrasts = np.arange(12).reshape(1, 3, 4) / 12
    shifts, f = np.array([-1e-4, 0, 1e-4]), np.array([10e3, 20e3, 30e3, 40e3])
    through = optics.LensMTF(((0, 1),), shifts, f, contrasts, contrasts / 2, np.zeros((1, 3)))
    axes = Figure().subplots()
    through.plot(axes, 20e3)
    solid, dashed = axes.lines
    assert np.allclose(solid.get_xdata(), [-0.1, 0, 0.1])
    assert np.allclose(solid.get_ydata(), contrasts[0, :, 1])
    assert np.allclose(dashed.get_ydata(), contrasts[0, :, 1] / 2)
    assert dashed.get_linestyle() == "--"
    assert axes.get_ylabel() == "contrast at 20 cycles/mm"
    one = optics.LensMTF(((0, 1),), shifts[:1], f, contrasts[:, :1], contrasts[:, :1] / 2, np.zeros((1, 1)))
    axes = Figure().subplots()
    one.plot(axes)
    assert np.allclose(axes.lines[0].get_xdata(), [10, 20, 30, 40])
    assert np.allclose(axes.lines[0].get_ydata(), contrasts[0, 0])


@pytest.mark.parametrize(
    ("asked", "says"),
    [
        ({"frequencies": []}, r"frequencies = .*: must be a row of finite numbers"),
        ({"shifts": [np.nan]}, "shifts = .*: must be a row of finite numbers"),
        ({"frequencies": 500e3}, "frequencies: 5e\\+05 per metre is beyond the cutoff of the lens at 4.8e-07 m"),
        ({"weights": [1.0, 1.0]}, "weights = .*: must be 3 shares of 0 or more"),
        ({"weights": [1.0, -1.0, 1.0]}, "weights = .*: must be 3 shares of 0 or more"),
        ({"tolerance": 0.9}, "tolerance = 0.9: must lie in"),
        ({"lens": optics.Pupil(1e-3)}, "lens"),
    ],
)
def test_bad_arguments_are_named(lens, asked, says):
    with pytest.raises(ValueError, match=says) as error:
        optics.lens_mtf(**{"lens": lens, "frequencies": F, **asked})
    assert "\n" not in str(error.value)
