"""Processor and GPU: times of the same PSFs, gradients, renderings and steps on both.

    python -m validation.benchmarks.gpu [--only NAME ...]

For 512 PSFs of 65 x 65 samples, of a population and of one pupil, with and without gradients: --only "512 PSFs".

Each device computes in a separate process. The script prints the wall time per call, as the median over calls after
those that compile and warm up. It also prints the largest difference between the results of both devices, as a share of
the largest number.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from optics.numerics.device import VARIABLE, has_gpu

WARM_UP, LEAST_CALLS, BUDGET = 3, 5, 1.0  # calls, calls, seconds
GREEN, FOCUS = 550e-9, 240e-6
WORLDS = (64, 1024)
PLACES = ("cpu", "cuda")


@dataclass(frozen=True)
class Case:
    """A case to measure.

    make: function that prepares the measured call and returns it. Both devices must agree on the call's result.
    """

    name: str
    make: Callable[[], Callable[[], Any]]


def relief(radius: float) -> Any:
    """Return control points [m] close to those of a lens that focuses at FOCUS."""
    import optics

    exact = optics.BSplineRelief.paraboloid(0.0, 2 / FOCUS, radius).control_points
    return exact + 1e-6 * np.random.default_rng(0).random((4, 4))


def one_picture(side: int, radius: float, dtype: str) -> Callable[[], Callable[[], Any]]:
    """Prepare the PSF of a pupil with glass that approximates a lens."""

    def make() -> Callable[[], Any]:
        import optics

        pupil = optics.Pupil(radius, optics.BSplineRelief(relief(radius)))
        asked = {"dx": 0.25e-6, "shape": (side, side), "dtype": dtype}
        return lambda: optics.psf(pupil, [GREEN], FOCUS, **asked).psf

    return make


def many_pictures(count: int) -> Callable[[], Callable[[], Any]]:
    """Prepare the PSFs of a population."""

    def make() -> Callable[[], Any]:
        import optics
        from validation.peers.population_speed import eyes

        pupils = eyes(count)
        return lambda: optics.psf_batch(pupils, [GREEN], FOCUS, dx=0.25e-6, shape=(65, 65), tolerance=0.01).psf

    return make


def gradient() -> Callable[[], Any]:
    """Prepare the gradient of the light on the axis with respect to the sixteen heights of a relief."""
    import drjit as dr

    import optics
    from optics.numerics.precision import precision

    types = precision("float64")
    start = relief(30e-6)

    def call() -> Any:
        heights = types.Tensor(start)
        dr.enable_grad(heights)
        pupil = optics.Pupil(30e-6, optics.BSplineRelief(heights))
        result = optics.psf(pupil, [GREEN], FOCUS, dx=0.5e-6, shape=(65, 65), dtype="float64")
        dr.backward(-dr.log(dr.gather(types.Float, types.Float(result.tensor.array), 32 * 65 + 32)))
        return dr.grad(heights).numpy()

    return call


def design(depths: int, gradient: bool) -> Callable[[], Callable[[], Any]]:
    """Prepare PSFs of a height map of 32 x 32 samples in eight wavelengths, or their gradients, with PyTorch.

    The map is a tensor on the measured device. Of the PSFs, those of one depth are returned.
    """

    def make() -> Callable[[], Any]:
        import torch

        import optics.torch
        from optics.numerics.device import device

        lens = {"aperture_radius": 30e-6, "thin_lens_focal_length": FOCUS}
        view = {"dx": 0.5e-6, "shape": (65, 65), "tolerance": 0.01}
        waves, distances = np.linspace(450e-9, 650e-9, 8), np.geomspace(5e-3, 1, depths)
        start = 5e-8 * np.random.default_rng(0).random((32, 32)).cumsum(0).cumsum(1) / 32
        heights = torch.tensor(start).to(device()).requires_grad_()

        def call() -> Any:
            heights.grad = None
            pupil = optics.Pupil(**lens, height=heights)
            found = optics.torch.psf(pupil, waves, FOCUS, distances, **view)
            if not gradient:
                return found[0].detach().cpu().numpy()
            (found * found).sum().backward()
            return heights.grad.cpu().numpy()

        return call

    return make


def whole_plane(side: int) -> Callable[[], Callable[[], Any]]:
    """Prepare the propagation of a field from plane to plane by the angular spectrum."""

    def make() -> Callable[[], Any]:
        import optics

        dx = 0.5e-6
        x = (np.arange(side) - side // 2) * dx
        field = np.exp(-(x**2 + x[:, None] ** 2) / (side * dx / 12) ** 2).astype(complex)
        return lambda: optics.propagate(field, dx=dx, wavelength=GREEN, distance=1e-3, out_shape=(side, side)).u

    return make


def kernel() -> Callable[[], Any]:
    """Prepare the receptive kernel of an eye in four bands."""
    from sim import Eyes
    from sim.eyes.receptive_fields import cells_for
    from validation.benchmarks.sim_throughput import with_pupil

    eye = with_pupil(Eyes(n_eyes=2, resolution=(15, 15), fov_deg=45)).eye()
    return lambda: eye.kernel(cells_for(eye))


def looks(worlds: int, lens: bool, samples: str) -> Callable[[], Callable[[], Any]]:
    """Prepare the signals of two eyes of 15 x 15 receptors in every world, without noise."""

    def make() -> Callable[[], Any]:
        import sim
        from sim.tasks.registry import task_of
        from sim.tasks.simulation import Simulation
        from validation.benchmarks.sim_throughput import with_pupil

        plain = sim.Eyes(n_eyes=2, resolution=(15, 15), fov_deg=45, placement_range_deg=60)
        eyes = with_pupil(plain) if lens else plain
        world = sim.build_world("detection")
        light = "direct" if samples == "rays" else "all"
        fidelity = sim.Fidelity(4.0 if samples == "rays" else 1.0, eyes.bands, light=light, samples=samples)
        renderer = sim.BatchedRenderer(world, eyes, worlds, fidelity)
        state = Simulation(task_of(world), worlds, 0).reset()
        return lambda: renderer.signals(state)

    return make


def steps(worlds: int) -> Callable[[], Callable[[], Any]]:
    """Prepare a step of all worlds: physics on the processor, rendering and noise on the device."""

    def make() -> Callable[[], Any]:
        import sim

        eyes = sim.Eyes(n_eyes=2, resolution=(15, 15), fov_deg=45, placement_range_deg=60)
        venv = sim.make_vec_env("detection", eyes=eyes, n_envs=worlds, seed=0)
        venv.reset()
        random = np.random.default_rng(0)
        return lambda: venv.step(random.uniform(-1, 1, (worlds, 2)).astype(np.float32))[0]["eyes"]

    return make


CASES = (
    Case("PSF, 65 x 65 samples", one_picture(65, 30e-6, "float32")),
    Case("PSF, 513 x 513", one_picture(513, 100e-6, "float32")),
    Case("the same in float64", one_picture(513, 100e-6, "float64")),
    *(Case(f"{n} PSFs of a population", many_pictures(n)) for n in (32, 512)),
    Case("gradient of a PSF, 16 heights", gradient),
    *(Case(f"{8 * n} PSFs of one pupil, PyTorch", design(n, False)) for n in (1, 64)),
    *(Case(f"gradient of {8 * n} PSFs of one pupil, PyTorch", design(n, True)) for n in (1, 64)),
    *(Case(f"plane to plane, {n} x {n}", whole_plane(n)) for n in (512, 2048)),
    Case("kernel of a receptor", kernel),
    *(Case(f"signals, perfect lens, areas, {n} worlds", looks(n, False, "areas")) for n in WORLDS),
    *(Case(f"signals, behind a lens, areas, {n} worlds", looks(n, True, "areas")) for n in WORLDS),
    *(Case(f"signals, perfect lens, rays, {n} worlds", looks(n, False, "rays")) for n in WORLDS),
    *(Case(f"steps, {n} worlds", steps(n)) for n in WORLDS),
)


def measured(case: Case) -> dict[str, Any]:
    """Return the seconds of the first call and of later ones, and the result of the first."""
    call = case.make()
    begun = time.perf_counter()
    values = np.asarray(call())
    first = time.perf_counter() - begun
    for _ in range(WARM_UP - 1):
        call()
    spent: list[float] = []
    while len(spent) < LEAST_CALLS or sum(spent) < BUDGET:
        begun = time.perf_counter()
        np.asarray(call())
        spent.append(time.perf_counter() - begun)
    return {"first": first, "seconds": statistics.median(spent), "values": values}


def child(place: str, names: list[str], out: Path) -> None:
    """Measure on this process's device; a case that fails is reported in one line."""
    numbers, arrays = {}, {}
    for case in chosen(names):
        try:
            found = measured(case)
        except Exception as error:  # failures on a device are results, too
            numbers[case.name] = {"failed": f"{type(error).__name__}: {(str(error).splitlines() or [''])[0][:300]}"}
            continue
        arrays[case.name] = found.pop("values")
        numbers[case.name] = found
        print(place, case.name, found, file=sys.stderr, flush=True)
    np.savez(out / f"{place}.npz", **arrays)
    (out / f"{place}.json").write_text(json.dumps(numbers))


def chosen(names: list[str]) -> list[Case]:
    """Return cases whose names contain one of these words; all cases for an empty list."""
    return [case for case in CASES if not names or any(name in case.name for name in names)]


def row(name: str, found: dict[str, dict[str, Any]], arrays: dict[str, Any]) -> str:
    """Return the table row; the reason for a failure replaces the time."""
    cpu, gpu = (found[place][name] for place in PLACES)
    if "failed" in gpu or "failed" in cpu:
        return f"| {name} | {cpu.get('failed', 'works')} | {gpu.get('failed', 'works')} | | |"
    a, b = (arrays[place][name] for place in PLACES)
    difference, ratio = np.abs(a - b).max() / np.abs(a).max(), cpu["seconds"] / gpu["seconds"]
    return (
        f"| {name} | {1e3 * cpu['seconds']:.3g} | {1e3 * gpu['seconds']:.3g} | {ratio:.2g} |"
        f" {gpu['first']:.2g} | {difference:.1e} |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", nargs="*", default=[], metavar="TEXT", help="cases whose names contain one of these")
    parser.add_argument("--child", help=argparse.SUPPRESS)
    parser.add_argument("--out", type=Path, help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.child:
        child(asked.child, asked.only, asked.out)
        return
    if not chosen(asked.only):
        sys.exit(f"no case name contains {' or '.join(asked.only)}: {', '.join(case.name for case in CASES)}")
    if not has_gpu():
        sys.exit("Dr.Jit finds no NVIDIA GPU here")
    with tempfile.TemporaryDirectory() as folder:
        found = {}
        for place in PLACES:
            command = [
                sys.executable,
                "-m",
                "validation.benchmarks.gpu",
                "--child",
                place,
                "--out",
                folder,
                "--only",
                *asked.only,
            ]
            subprocess.run(command, check=True, env={**os.environ, VARIABLE: place})
            found[place] = json.loads((Path(folder) / f"{place}.json").read_text())
        arrays = {place: np.load(Path(folder) / f"{place}.npz") for place in found}
        print("| | processor [ms] | GPU [ms] | ratio | first call on the GPU [s] | largest difference |")
        print("|---|---|---|---|---|---|")
        for case in chosen(asked.only):
            print(row(case.name, found, arrays))


if __name__ == "__main__":
    main()
