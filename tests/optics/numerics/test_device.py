"""Computation runs on the processor unless a GPU is requested; results are the same on both."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import optics
from optics.numerics import device
from optics.numerics.backend import BackendError
from optics.numerics.precision import precision
from tests.slow_part import slow

ROOT = Path(__file__).resolve().parents[3]


@pytest.mark.parametrize(
    ("asked", "gpu", "chosen"),
    [(None, True, "cpu"), ("cpu", True, "cpu"), ("auto", True, "cuda"), ("auto", False, "cpu"), ("cuda", True, "cuda")],
)
def test_the_device_is_the_one_asked_for(monkeypatch, asked, gpu, chosen):
    monkeypatch.delenv(device.VARIABLE, raising=False)
    if asked:
        monkeypatch.setenv(device.VARIABLE, asked)
    monkeypatch.setattr(device, "has_gpu", lambda: gpu)
    assert device.device() == chosen


@pytest.mark.parametrize("asked", ["gpu", "", "cuda"])
def test_what_is_not_there_is_refused_in_one_line(monkeypatch, asked):
    monkeypatch.setenv(device.VARIABLE, asked)
    monkeypatch.setattr(device, "has_gpu", lambda: False)
    with pytest.raises(BackendError, match=r"^RHABDOM_DEVICE = .*must be") as refusal:
        precision()
    assert "\n" not in str(refusal.value)


def test_types_are_llvms_even_where_there_is_a_gpu(monkeypatch):
    """Dr.Jit's own choice would be the GPU, which physics and learning do not use."""
    monkeypatch.delenv(device.VARIABLE, raising=False)
    monkeypatch.setattr(device, "has_gpu", lambda: True)
    assert precision("float32").Float.__module__ == "drjit.llvm.ad"


def on(place: str, code: str) -> np.ndarray:
    environment = {**os.environ, device.VARIABLE: place, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-c", f"import numpy as np\n{code}\nprint(*np.ravel(found))"]
    child = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert child.returncode == 0, child.stderr
    return np.array(child.stdout.split(), dtype=float)


PSF = """
import optics
pupil = optics.Pupil(aperture_radius=20e-6, thin_lens_focal_length=240e-6)
found = optics.psf(pupil, [550e-9], sensor_distance=240e-6, shape=(33, 33)).psf / 1e12
"""
SIGNALS = """
import sim
world = sim.build_world("detection")
venv = sim.make_vec_env("detection", eyes=sim.Eyes(n_eyes=2, resolution=(5, 5), noise_sigma=0.0), n_envs=4, seed=0,
                        rays_per_receptor=16)
found = venv.reset()["eyes"]
"""


def test_arrays_of_another_device_are_refused(monkeypatch):
    """`drjit.auto` makes arrays on a GPU if there is one. The opposite case fails in the same way, so the test needs no
    GPU."""
    monkeypatch.setenv(device.VARIABLE, "cpu")
    radius = precision("float64").Float64(30e-6)
    monkeypatch.setenv(device.VARIABLE, "cuda")
    monkeypatch.setattr(device, "has_gpu", lambda: True)
    with pytest.raises(BackendError, match=r"drjit.llvm.ad.Float64: must be of drjit.cuda.ad, because .* a GPU"):
        optics.Pupil(radius)


@pytest.mark.skipif(not device.has_gpu(), reason="no NVIDIA GPU here")
@pytest.mark.parametrize(("code", "tolerance"), [(PSF, 1e-4), (SIGNALS, 1e-3)], ids=["optics", "sim"])
def test_the_gpu_computes_the_same(code, tolerance):
    cpu, gpu = on("cpu", code), on("cuda", code)
    assert np.abs(cpu - gpu).max() < tolerance * np.abs(cpu).max()


@pytest.mark.parametrize("code", [PSF, slow(SIGNALS)], ids=["optics", "sim"])
def test_what_the_gpu_is_asked_for_runs_on_the_processor(code):
    """The GPU tests' scripts also run on the processor, so that they are known to work without a GPU."""
    assert on("cpu", code).max() > 0
