"""Speed of compound eyes, compared with eyes made of mounts: `python -m validation.benchmarks.compound_eye_times`.

The ant of `examples/ant_seeks.py`, whose body consists of primitives, has two eyes of 721 ommatidia in 64 worlds. The
same eyes are built from 1,442 mounts of an `optics.Eye` with one receptor. For both, the table shows the fewest rays
whose root mean square error is at most half of the receptors' noise (σ = 0.01, relative to white), and this error. It
also shows the median CPU times of the signals of a single world and of all worlds, the ratios of these times, and whole
steps per CPU second. The first calls, which compile kernels, are not counted.

The last lines show where the time of the signals of all worlds goes. The time with more rays gives the time per ray and
the time that does not depend on rays. Models without shadows, and with an invisible ant and ball, give the shares of
shadow rays and of the intersections with moving geoms.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

import optics
import sim
from examples.ant_seeks import AntSeeks, ant_and_ball
from optics.spectra.spectrum import daylight
from sim.eyes.compound_eye import WorldEye

WORLDS, LOOKS, WARM_UP = 64, 7, 2
SIGMA, TRUE = 0.01, 256
RAYS = (2, 4, 5, 6, 8, 10, 12, 16, 20, 24, 32)
OMMATIDIUM = optics.Ommatidium(optics.FacetLens(16e-6, 12e-6), optics.Waveguide(1.9e-6))
PLACE = (0.27, 0.0, 0.1)
INVISIBLE = 5  # group of geoms that are not rendered


class Ant(AntSeeks):
    """The task of the ant, with compound eyes."""

    eye = sim.CompoundEye(sim.hexagonal_patch(15, 5.0, 70.0), OMMATIDIUM, noise_sigma=SIGMA).with_mirror_image()
    mounts = (sim.Mount("torso", offset=PLACE),)


def mounts() -> list[sim.Mount]:
    """Return mounts in the directions of the ommatidia."""
    ahead, left, up = Ant.eye.directions.T
    angles = np.degrees([np.arctan2(left, ahead), np.arcsin(up)]).T
    return [sim.Mount("torso", *pair, offset=PLACE) for pair in angles.tolist()]


def of_one_receptor() -> tuple[optics.Eye, np.ndarray]:
    """Return an ommatidium as an eye with one receptor, and the signal of each type for white."""
    guide, lens = OMMATIDIUM.rhabdom, OMMATIDIUM.lens
    eye = optics.Eye(
        lens.pupil(),
        (1, 1),
        fov_deg=float(np.degrees(2 * np.arctan(guide.diameter / 2 / lens.object_focal_length()))),
        sensor_width=guide.diameter,
        waveguide=guide,
        full_aperture=2 * lens.pupil().radius,
    )
    bands, accepted = eye.spectral_bands, np.asarray(eye.kernel(1)).sum(axis=(1, 2))
    return eye, eye.aperture_throughput * (bands.weights * daylight(bands.wavelengths)) @ accepted


def cpu_time(call: Callable[[], object]) -> float:
    """Return the median CPU time [s] of a call."""
    times = []
    for _ in range(WARM_UP + LOOKS):
        start = time.process_time()
        call()
        times.append(time.process_time() - start)
    return float(np.median(times[WARM_UP:]))


def fewest(signals: Callable[[int, sim.Poses], np.ndarray], few: sim.Poses) -> tuple[int, float]:
    """Return the fewest rays whose error in a few worlds is at most half of the noise, and the error."""
    truth = signals(TRUE, few)
    for rays in RAYS:
        error = float(np.sqrt(np.square(signals(rays, few) - truth).mean()))
        if error <= SIGMA / 2:
            break
    return rays, error


@dataclass(frozen=True)
class Row:
    """A row of the table.

    rays: rays per ommatidium
    times: CPU times [s] of a single world and of all worlds, (2,)
    """

    rays: int
    times: np.ndarray


def report(name: str, renderer: Callable[[int, int], sim.ModelRenderer], white: np.ndarray, everyone: sim.Poses) -> Row:
    """Measure and print a row of the table."""

    def signals(rays: int, of: sim.Poses) -> np.ndarray:
        found: np.ndarray = renderer(rays, of.n).signals(of) / white[:, None, None]
        return found

    rays, error = fewest(signals, everyone.take(np.arange(4)))
    times = []
    for n in (1, WORLDS):
        built, poses = renderer(rays, n), everyone.take(np.arange(n))
        times.append(cpu_time(lambda built=built, poses=poses: built.signals(poses)))
    one, all_ = (f"{1e3 * took:.1f} ms" for took in times)
    print(f"{name:12} {rays:3d} rays  error {error / SIGMA:.2f} σ  one world {one}  {WORLDS} worlds {all_}")
    return Row(rays, np.array(times))


def whole_steps(rays: int) -> float:
    """Return the steps of all worlds per CPU second."""
    Ant.fidelity = sim.Fidelity(rays, 4)
    worlds = sim.make_vec_env(Ant(), n_envs=WORLDS)
    worlds.reset()
    random = np.random.default_rng(0)
    took = cpu_time(lambda: worlds.step(random.uniform(-1, 1, (WORLDS, 2))))
    worlds.close()
    return WORLDS / took


def poses_after_steps(task: Ant) -> tuple[sim.Poses, mujoco.MjModel]:
    """Return the poses of all worlds after five steps with random actions, and the model."""
    worlds = sim.make_vec_env(task, n_envs=WORLDS)
    worlds.reset()
    random = np.random.default_rng(0)
    for _ in range(5):
        worlds.step(random.uniform(-1, 1, (WORLDS, 2)))
    poses, model = worlds.simulation.poses(), worlds.worlds.model
    worlds.close()
    return poses, model


def without(shadows: bool = False, movers: bool = False) -> Ant:
    """Return the task without shadows, or with an invisible ant and ball."""
    spec, task = ant_and_ball(), Ant()
    for light in spec.lights:
        light.castshadow = not shadows
    for geom in spec.geoms:
        if movers and geom.name != "floor":
            geom.group = INVISIBLE
    task.model = spec
    return task


def signals_time(task: Ant, rays: int) -> float:
    """Return the median CPU time [s] of the signals of all worlds."""
    poses, model = poses_after_steps(task)
    renderer = sim.ModelRenderer(model, task.eye, task.mounts, WORLDS, sim.Fidelity(rays, 4))
    return cpu_time(lambda: renderer.signals(poses))


def print_shares(rays: int) -> None:
    """Print the parts of the time of the signals."""
    total, more = signals_time(Ant(), rays), signals_time(Ant(), 4 * rays)
    of_rays = (more - total) / 3
    print(f"signals: {1e3 * total:.0f} ms, of which {1e3 * (total - of_rays):.0f} ms do not depend on rays")
    print(f"a ray: {1e9 * of_rays / (rays * len(Ant.eye) * WORLDS):.0f} ns")
    for name, task in (("shadow rays", without(shadows=True)), ("moving geoms", without(shadows=True, movers=True))):
        less = signals_time(task, rays)
        print(f"{name}: {1e3 * (total - less):.0f} ms")
        total = less


def main() -> None:
    """Print the table."""
    poses, model = poses_after_steps(Ant())
    (one, white), places = of_one_receptor(), mounts()

    def renderer(eye: WorldEye, at: Sequence[sim.Mount]) -> Callable[[int, int], sim.ModelRenderer]:
        return lambda rays, n: sim.ModelRenderer(model, eye, at, n, sim.Fidelity(rays, 4))

    compound = report("CompoundEye", renderer(Ant.eye, Ant.mounts), np.ones(3), poses)
    ratios = report("mounts", renderer(one, places), white, poses).times / compound.times
    print(f"ratios: {ratios[0]:.1f} for one world, {ratios[1]:.1f} for {WORLDS} worlds")
    print(f"whole steps with {compound.rays} rays: {whole_steps(compound.rays):.0f} per CPU second")
    print_shares(compound.rays)


if __name__ == "__main__":
    main()
