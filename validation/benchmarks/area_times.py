"""Ray sampling and area sampling of eyes behind pinholes and lenses: `python -m validation.benchmarks.area_times`.

All are measured in one process. The table shows errors in units of the receptors' noise, relative to many rays with a
bounce, over all receptors and over the receptors that see an object. It also shows medians of CPU time of one thread
for the signals of 64 worlds: for the rays that are chosen if only rays are available, for one area per receptor, and
for the automatic choice. Agents have an object in front of them, as after training.
"""

from __future__ import annotations

import time
import warnings
from dataclasses import replace

import drjit as dr
import numpy as np

import optics
import sim
from sim.tasks.registry import task_of
from sim.tasks.simulation import Simulation
from sim.worlds.state import WorldState

WORLDS, STEPS, LOOKS, WARM_UP = 64, 40, 9, 2
TRUE, SIGMA = 256, 0.003  # rays per receptor of the reference; receptor noise relative to the signal of white
SEEN = 0.01  # smallest change of a signal that counts as seeing an object, relative to white behind the pupil
EYES = sim.Eyes(n_eyes=2, resolution=(15, 15), placement_range_deg=45.0, noise_sigma=SIGMA)


def behind(a: float, focus: float | None = None) -> sim.Eyes:
    """Return eyes with a pinhole of relative aperture a, or with a lens in this pinhole.

    focus: focal length of the lens relative to the correct one; None: no lens
    """
    focal_length = None if focus is None else focus * EYES.eye().sensor_distance
    return replace(EYES, optics=optics.Pupil(a * EYES.sensor_width / 2, thin_lens_focal_length=focal_length))


CASES = {
    "pinhole, a = 0.9": behind(0.9),
    "pinhole, a = 0.55": behind(0.55),
    "pinhole, a = 0.3": behind(0.3),
    "lens out of focus, a = 0.55": behind(0.55, 1.5),
    "lens nearly in focus, a = 0.55": behind(0.55, 1.1),
    "lens in focus, a = 0.55": behind(0.55, 1.0),
}


def moments(world: sim.World) -> WorldState:
    """Return a state of all worlds in which each agent faces an object 0.6 to 4 m ahead."""
    simulation, random = Simulation(task_of(world), WORLDS, 0), np.random.default_rng(0)
    simulation.reset()
    for _ in range(STEPS):
        simulation.step(random.uniform(-1, 1, (WORLDS, 2)))
    simulation.close()
    state = simulation.state
    ahead, distance = random.uniform(-np.pi, np.pi, WORLDS), random.uniform(0.6, 4.0, (WORLDS, 1))
    position = state.objects[:, 0, :2] - distance * np.stack([np.cos(ahead), np.sin(ahead)], axis=-1)
    return replace(state, position=position, heading=ahead + random.uniform(-0.6, 0.6, WORLDS))


def seen_in(renderer: sim.BatchedRenderer, state: WorldState, truth: np.ndarray) -> np.ndarray:
    """Return the mask of the signals with light from an object: those that change if all objects are moved away."""
    away = replace(state, objects=state.objects + np.array([100.0, 0.0, 0.0]))
    found: np.ndarray = np.abs(renderer.signals(away) - truth) > SEEN * renderer.eye.throughput
    return found


def rows(world: sim.World, name: str, eyes: sim.Eyes, state: WorldState) -> list[str]:
    """Return the table rows for one eye."""
    bounced = sim.Fidelity(TRUE, eyes.bands, light="bounce")
    tracer = sim.BatchedRenderer(world, eyes, WORLDS, bounced)
    truth = tracer.signals(state)
    seen = seen_in(tracer, state, truth)
    chosen = sim.choose_fidelity(world, eyes, bands="own")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sim.FidelityWarning)
        by_rays = sim.choose_fidelity(world, eyes, bands="own", tracer="mitsuba")
    one = replace(chosen, samples="areas", rays_per_receptor=1.0)
    renderers = [sim.BatchedRenderer(world, eyes, WORLDS, f) for f in (by_rays, one, chosen)]
    times: list[list[float]] = [[] for _ in renderers]
    for _ in range(WARM_UP + LOOKS):
        for renderer, spent in zip(renderers, times, strict=True):
            begun = time.thread_time()
            renderer.signals(state)
            spent.append(1e3 * (time.thread_time() - begun))
    found = []
    for renderer, spent in zip(renderers, times, strict=True):
        how = renderer.fidelity
        light = "bounce" if how.light == "all" else how.light
        off = (sim.BatchedRenderer(world, eyes, WORLDS, replace(how, light=light)).signals(state) - truth) / SIGMA
        error, on_objects = (float(np.sqrt(np.mean(which**2))) for which in (off, off[seen]))
        samples = f"{how.rays_per_receptor:.3g} {how.samples} ({len(renderer.sensor.directions)}), {how.light}"
        found.append(f"| {name} | {samples} | {error:.2f} | {on_objects:.2f} | {np.median(spent[WARM_UP:]):.1f} |")
    return found


def main() -> None:
    dr.set_thread_count(1)
    world = sim.build_world("detection")
    state = moments(world)
    print("| eye | samples | error [σ] | on objects [σ] | CPU [ms] |\n|---|---|---|---|---|")
    for name, eyes in CASES.items():
        print("\n".join(rows(world, name, eyes, state)), flush=True)


if __name__ == "__main__":
    main()
