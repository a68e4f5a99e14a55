"""Eyes with two fields of view: receptors that are not square, against the same retina made of square receptors."""

import math
from dataclasses import replace

import numpy as np
import pytest

import optics
from optics import Eye

WIDTH = 40e-6
F = WIDTH / (2 * math.tan(math.radians(22.5)))
LENS = optics.Pupil(6e-6, thin_lens_focal_length=F, wavefront=optics.Zernike({(3, 1): 0.1, (2, -2): 0.08}))


def tall(rows, columns, ratio, **changes):
    """Return an eye whose receptors are `ratio` times as high as wide."""
    changes = {"fov_deg": 45.0, "noise_sigma": 0.0} | changes
    half = math.tan(math.radians(changes["fov_deg"]) / 2) * ratio * rows / columns
    return Eye(resolution=(rows, columns), vertical_fov_deg=math.degrees(2 * math.atan(half)), **changes)


@pytest.mark.fast_cases(4)
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("waveguide", [False, True])
def test_high_receptors_are_rows_of_square_ones(seed, waveguide):
    """A receptor k times as high as wide has the mean signal of k square receptors. A waveguide, which stands in its
    middle, has 1/k of the signal of the square receptor there. Cells are k times as high, too.
    """
    rng = np.random.default_rng(seed)
    k, rows, columns = int(rng.choice([3, 5])), int(rng.integers(1, 4)), int(rng.integers(2, 6))
    optional = {"waveguide": optics.Waveguide(4e-6)} if waveguide else {}
    # The modes do not reach the rim of the wide pupil, which would diffract light to all sides.
    pupil = replace(LENS, aperture_radius=18e-6) if waveguide else LENS
    eye = tall(rows, columns, k, pupil=pupil, bands=2, sensor_width=WIDTH, tolerance=1e-4, **optional)
    square = Eye(pupil, (k * rows, columns), 45.0, WIDTH, 2, 0.0, 1e-4, **optional)
    assert eye.receptor_size == pytest.approx((k * square.receptor_pitch, square.receptor_pitch))
    # Light is constant over k fine cells, so that both scenes are equal.
    coarse = rng.random((2, 3 * rows + 8, 3 * columns + 8))
    fine = np.repeat(coarse, k, axis=1)
    found, each = eye.see(coarse, 3), square.see(fine, 3).reshape(3, rows, k, columns)
    expected = each[:, :, k // 2] / k if waveguide else each.mean(axis=2)
    np.testing.assert_allclose(found, expected, rtol=0, atol=4e-4 * eye.white_signal)
    low = replace(eye, vertical_fov_deg=None).see(coarse, 3)
    assert np.abs(found - low).max() > 0.01 * eye.white_signal


def test_zones_reach_the_edges_of_both_fields():
    """Kernels in the corners of a wide retina with high receptors are those of light from the corners of the field."""
    eye = Eye(LENS, (2, 5), 30.0, WIDTH, 1, vertical_fov_deg=40.0)
    kernels = eye.sight(2, field_zones=3, light_from="centres").kernels
    assert set(kernels) == {(0, row, column) for row in range(2) for column in range(3)}
    for row, column, direction in ((0, 0, (-15.0, 20.0)), (1, 2, (15.0, -20.0)), (0, 1, (0.0, 20.0))):
        expected = eye.kernel(2, direction_deg=direction)
        np.testing.assert_allclose(kernels[0, row, column].numpy(), expected, rtol=1e-4, atol=1e-4 * expected.max())


@pytest.mark.parametrize("ratio", [0.2, 1.0, 3.7])
def test_fields_and_acuity_in_both_directions(ratio):
    eye = tall(3, 7, ratio, pupil=optics.Pupil(30e-6, thin_lens_focal_length=240e-6))
    assert eye.fovy_deg == pytest.approx(eye.vertical_fov_deg)
    found = eye.describe()
    assert found.interommatidial_vertical_deg == pytest.approx(ratio * found.interommatidial_angle_deg)
    assert found.sampling_vertical_cpd == pytest.approx(found.sampling_cpd / ratio)
    others = (found.diffraction_cpd, found.noise_cpd)
    assert found.acuity_vertical_cpd == pytest.approx(min(*others, found.sampling_vertical_cpd))
    assert found.acuity_cpd == pytest.approx(min(*others, found.sampling_cpd))
    assert ("acuity, vertical" in str(found)) == (ratio != 1.0)


def test_square_receptors_are_the_default():
    eye = Eye(LENS, (3, 4), 45.0, WIDTH)
    assert eye.receptor_size == (eye.receptor_pitch, eye.receptor_pitch)
    same = replace(eye, vertical_fov_deg=eye.fovy_deg)
    scene = np.random.default_rng(0).random((4, 12, 16))
    np.testing.assert_allclose(same.see(scene, 4), eye.see(scene, 4), rtol=1e-5)


def test_a_higher_receptor_absorbs_more_photons():
    light = optics.PhotonBudget(100.0, 0.02)
    low, high = tall(2, 4, 1.0, photon_budget=light), tall(2, 4, 3.0, photon_budget=light)
    np.testing.assert_allclose(high.photons, 3 * low.photons, rtol=1e-9)


@pytest.mark.parametrize("wrong", [0.0, -3.0, 180.0, math.nan, "45"])
def test_bad_vertical_field(wrong):
    with pytest.raises(ValueError, match=r"^vertical_fov_deg = .*: must (be|lie)"):
        Eye(vertical_fov_deg=wrong)


def test_a_rhabdom_is_as_narrow_as_the_shorter_side():
    with pytest.raises(ValueError, match=r"waveguide.diameter = 4e-06: must be at most a receptor's height 3e-06 m"):
        tall(3, 4, 0.3, pupil=LENS, sensor_width=WIDTH, waveguide=optics.Waveguide(4e-6))


def test_a_carried_field_keeps_its_receptors():
    import drjit.auto.ad as ad

    with pytest.raises(ValueError, match=r"vertical_fov_deg is given and fov_deg is a Dr\.Jit array"):
        Eye(fov_deg=ad.Float(45.0), vertical_fov_deg=45.0)
