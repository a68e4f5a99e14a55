"""The bridge to PyTorch: wrong input is refused in one line that names it."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
import torch

import optics
import optics.torch
from optics import AccuracyError, BSplineRelief, HeightMap, Pupil
from optics.numerics import device
from optics.numerics.torch_graph import common_device
from tests.optics.test_torch import SQUARE, VIEW, R, asking, former, lens

NAN = np.full((5, 5), np.nan)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: optics.torch.psf(torch.zeros(5, 5), radius=-1.0, **VIEW), r"aperture_radius = -1\.0: must be greater"),
        (lambda: optics.torch.psf(torch.zeros(5, 5), **VIEW), r"radius is missing: must be that of the pupil \[m\]"),
        (lambda: former(np.zeros((4, 4)), **VIEW), r"heights = .*must be a kind of Tensor"),
        (
            lambda: optics.torch.PointSpread(R, heights=np.zeros((4, 4)), **VIEW),
            r"heights = .*must be a kind of Tensor",
        ),
        (
            lambda: optics.torch.psf(25e-6, **VIEW),
            r"pupil\[0\] = 2\.5e-05: must be a kind of Pupil, such as Pupil\(25e-6\)",
        ),
        (lambda: optics.torch.psf([], **VIEW), "pupil is empty: must hold at least one"),
        (lambda: optics.torch.psf(lens(), sensor_distance=[]), "sensor_distance is empty: must hold at least one"),
        (
            lambda: optics.torch.psf(lens(), 5e-7, [1e-4, 2e-4], [1.0, 2.0, 3.0]),
            "sensor_distance has 2 entries and source_distance 3: must be of equal length, because they are used",
        ),
        (lambda: optics.torch.psf(lens(), source_angle=0.1, **VIEW), r"source_angle = 0\.1: must be two angles"),
        (lambda: optics.torch.psf(lens(), field=True, **VIEW), r"field: only `optics\.psf` returns it"),
        (
            lambda: optics.torch.psf(lens(), pixel_means=True, tolerance=-1, **VIEW),
            r"tolerance = -1: must lie in \[1e-12",
        ),
        (lambda: optics.torch.psf(lens(), dx=asking(1e-6), pixel_means=True), "dx requires a derivative, but none is"),
        (lambda: optics.torch.psf(lens(), asking([5e-7]), **VIEW), "wavelengths requires a derivative, but none is"),
        (
            lambda: optics.torch.psf(lens(), sensor_distance=[1e-4, -1e-4]),
            r"sensor_distance = -0\.0001: must be greater",
        ),
        (lambda: optics.torch.psf(lens(), 5e-7, 1e-4, [math.nan]), "source_distance = nan: must be greater than 0"),
        (lambda: optics.torch.psf(lens(), pixel_means=2, **VIEW), "pixel_means = 2: must be True or False"),
        (
            lambda: optics.torch.psf(lens(height=torch.zeros(5, 5)), requires_grad=True, **VIEW),
            "no tensor requires a gradient: at least one must have requires_grad=True",
        ),
        (
            lambda: lens(height=asking(6 * SQUARE)),
            r"height spans 5.* as if in radians or micrometres: must be in metres",
        ),
        (lambda: lens(height=asking(900 * SQUARE)), r"height spans .* as if in nanometres: must be in metres, at most"),
        (lambda: HeightMap(asking(NAN)), r"height holds NaN or infinity: must be finite heights \[m\]"),
        (lambda: BSplineRelief(asking(NAN[:4, :4])), "control_points holds NaN or infinity: must be 4 x 4 finite"),
        (lambda: lens(aperture_radius=asking(math.nan)), r"aperture_radius = .*nan.*: must be greater than 0"),
        (lambda: HeightMap(torch.zeros(5, 5, device="meta")), "height is a tensor on the device 'meta', which has no"),
        (lambda: HeightMap(asking(SQUARE, device="meta")), "height is a tensor on the device 'meta', which has no"),
        (
            lambda: optics.torch.psf(lens(thin_lens_focal_length=asking(1e-4))),
            "sensor_distance is missing: thin_lens_focal_length carries a derivative",
        ),
    ],
)
def test_bad_input_is_named_in_one_line(call, message):
    with pytest.raises(ValueError, match=f"^{message}") as error:
        call()
    assert "\n" not in str(error.value)


def test_tensors_on_two_devices_are_refused():
    """Single numbers on the processor fit any device, as in torch."""
    cpu, gpu = (SimpleNamespace(device=torch.device(place), ndim=2) for place in ("cpu", "cuda"))
    single = SimpleNamespace(device=torch.device("cpu"), ndim=0)
    common = common_device
    assert common({"n": single, "height": gpu}) == torch.device("cuda")
    assert common({"n": single}) == common({}) == torch.device("cpu")
    with pytest.raises(ValueError, match=r"^mask is on cpu and height on cuda: must be on one device, or pass device="):
        common({"height": gpu, "mask": cpu})


def test_errors_of_psf_pass_through():
    with pytest.raises(AccuracyError, match="float32 allows"):
        optics.torch.psf(lens(), tolerance=1e-8, **VIEW)


def test_a_gpu_that_torch_cannot_use_is_refused(monkeypatch):
    monkeypatch.setenv(device.VARIABLE, "cuda")
    monkeypatch.setattr(device, "has_gpu", lambda: True)
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    with pytest.raises(optics.BackendError, match="RHABDOM_DEVICE requires a GPU, but this torch has none"):
        optics.torch.psf(Pupil(30e-6), sensor_distance=240e-6)
