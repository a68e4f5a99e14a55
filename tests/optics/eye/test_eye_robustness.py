"""An eye with arbitrary arguments gives a finite answer or a one-line error."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from optics import AccuracyError, Eye, HumanEye, PhotonBudget, Pupil
from optics.eye import visual_kernel
from optics.eye.band_choice import choose_bands
from tests.optics.device_types import Float64
from tests.slow_part import sweep

ODD = [0, -1, 0.5, math.nan, math.inf, -math.inf, 1e-300, 1e300, "auto", "much", None, (1, 2), [], b"x"]
# The first values are meaningful ones.
numbers = st.one_of(st.floats(0.01, 50), st.integers(1, 20), st.sampled_from(ODD))


def refused(error):
    text = str(error)
    assert text
    assert "\n" not in text
    assert "=" in text or "holds" in text or "has" in text
    return True


@sweep(40)
@given(
    resolution=st.one_of(st.tuples(st.integers(1, 12), st.integers(1, 12)), numbers),
    fov_deg=numbers,
    sensor_width=st.one_of(st.floats(1e-5, 1e-3), numbers),
    bands=numbers,
    noise_sigma=numbers,
    tolerance=st.one_of(st.floats(0.01, 0.3), numbers),
    dtype=st.sampled_from(["float32", "float64", "float16", None]),
    photon_budget=st.sampled_from([None, PhotonBudget(), 5, "dim"]),
)
def test_any_eye_sees_or_is_refused(**arguments):
    try:
        eye = Eye(**arguments)
        scene = np.ones((eye.bands, *(2 * n for n in eye.resolution)))
        seen = eye.see(scene, 2, np.random.default_rng(0))
        table = eye.describe()
    except ValueError as error:
        refused(error)
        return
    assert seen.shape == (3, *eye.resolution)
    assert np.isfinite(seen).all()
    assert table.acuity_cpd >= 0
    assert str(table)


@sweep(10, fast=2)
@given(a=st.floats(0.02, 1), defocus=st.floats(0.3, 3), fov_deg=st.floats(5, 100), sigma=st.floats(0, 1))
def test_any_lens_is_described_or_refused(a, defocus, fov_deg, sigma):
    distance = Eye(fov_deg=fov_deg).sensor_distance
    lens = Pupil(a * 100e-6, thin_lens_focal_length=defocus * distance)
    try:
        found = Eye(lens, (4, 6), fov_deg, bands=1, tolerance=0.05, noise_sigma=sigma).describe()
    except ValueError as error:
        refused(error)
        return
    unknown = {line.split(":")[0] for line in found.unknown}
    assert ("limit by noise" in unknown) == math.isnan(found.acuity_cpd)
    assert math.isnan(found.acuity_cpd) or 0 <= found.acuity_cpd <= found.diffraction_cpd
    assert ("image quality" in unknown) == math.isnan(found.image_quality)
    assert "image quality" in unknown or 0 <= found.image_quality <= 1.001 * found.throughput
    assert "Strehl ratio" in unknown or 0 < found.strehl_ratio < 1.1
    assert found.acceptance_angle_deg > 0.9 * found.interommatidial_angle_deg


@sweep(40)
@given(
    z=st.one_of(st.lists(st.floats(1e-4, 10), max_size=5), numbers),
    depth_layers=numbers,
    field_zones=numbers,
    tolerance=st.one_of(st.none(), st.floats(0.05, 0.5), numbers),
)
def test_any_perfect_sight_or_a_refusal(z, depth_layers, field_zones, tolerance):
    """Behind a perfect lens kernels cost nothing, but arguments are still checked."""
    try:
        sight = Eye(resolution=(2, 3), bands=1).sight(2, z, depth_layers, field_zones, tolerance)
    except ValueError as error:
        refused(error)
        return
    assert len(str(sight).splitlines()) == 2


@sweep(40)
@given(samples=numbers, z=numbers, right=numbers, up=numbers)
def test_any_kernel_or_a_refusal(samples, z, right, up):
    lens = Pupil(2e-6, thin_lens_focal_length=Eye().sensor_distance)
    try:
        kernel = Eye(lens, (3, 3), bands=1, tolerance=0.1).kernel(samples, z, (right, up))
    except ValueError as error:
        refused(error)
        return
    assert np.isfinite(kernel).all()
    assert 0 < kernel.sum() < 1.02


@sweep(40)
@given(tolerance=numbers, illuminance=numbers, time=numbers, efficiency=numbers)
def test_any_light_or_a_refusal(tolerance, illuminance, time, efficiency):
    try:
        photons = PhotonBudget(illuminance, time, efficiency).photons(choose_bands(tolerance), 1e-10)
    except ValueError as error:
        refused(error)
        return
    assert (photons > 0).all()
    assert np.isfinite(photons).all()


def test_what_is_of_another_kind_is_named():
    with pytest.raises(ValueError, match="photon_budget = 1000"):
        Eye(photon_budget=1000)
    with pytest.raises(ValueError, match=r"must be a kind of Pupil, .* \(it has one, its `pupil`\)"):
        Eye(pupil=HumanEye())
    with pytest.raises(ValueError, match="pupil = 'lens': must be a kind of Pupil"):
        Eye(pupil="lens")
    with pytest.raises(ValueError, match="rng = 0: must be a kind of Generator"):
        Eye(bands=1).see(np.zeros((1, 15, 15)), 1, rng=0)
    with pytest.raises(ValueError, match="sight = 'auto': must be a kind of KernelBank"):
        Eye(bands=1).see(np.zeros((1, 15, 15)), 1, sight="auto")
    with pytest.raises(ValueError, match="radiance: must be real numbers, not complex"):
        Eye(bands=1).see(np.zeros((1, 15, 15)) * 1j, 1)


@pytest.mark.parametrize("wrong", [-1e-3, 0.0, math.nan])
@pytest.mark.parametrize("kind", [float, Float64])
def test_bad_distances_are_refused_with_given_kernels(wrong, kind):
    """The message shows a Dr.Jit number as a list."""
    eye = Eye(bands=1)
    bank = eye.sight(1)
    with pytest.raises(ValueError, match=r"^z .*must be (distances )?greater than 0, (in m, )?or infinite") as refusal:
        eye.see(np.zeros((1, 15, 15)), 1, z=kind(wrong), sight=bank)
    assert refused(refusal.value)


def test_as_many_cells_as_a_spot_may_have_and_no_more(monkeypatch):
    """A spot may have exactly the limit of cells, but not one more."""
    eye = Eye(Pupil(25e-6, thin_lens_focal_length=Eye().sensor_distance), (7, 9), bands=1)
    counted, count = [], visual_kernel._cells_within

    def noted(*arguments):
        counted.append(count(*arguments))
        return counted[-1]

    monkeypatch.setattr(visual_kernel, "_cells_within", noted)
    eye.kernel(2)
    most = counted[0]
    assert most > 1
    monkeypatch.setattr(visual_kernel, "MOST_CELLS", most)
    replace(eye, fov_deg=eye.fov_deg).kernel(2)
    monkeypatch.setattr(visual_kernel, "MOST_CELLS", most - 1)
    with pytest.raises(AccuracyError, match=rf"at most {most - 1}; increase"):
        replace(eye, fov_deg=eye.fov_deg).kernel(2)
