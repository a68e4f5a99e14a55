"""Eyes behind holes and lenses by rays and by areas, in one process: `python -m validation.area_times`.

Prints errors in units of the receptors' noise, against many rays with a bounce, and medians of CPU time of one thread
for a look of 64 worlds: of the rays that are chosen where there is nothing else, of one area per receptor, and of what
is chosen.
"""

from __future__ import annotations

import time
import warnings
from dataclasses import replace

import drjit as dr
import numpy as np

import optics
import sim
from sim.envs.simulation import Simulation
from sim.worlds.state import WorldState

WORLDS, STEPS, LOOKS, WARM_UP = 64, 40, 9, 2
TRUE, SIGMA = 256, 0.003  # rays per receptor; of white
EYES = sim.Eyes(n_eyes=2, resolution=(15, 15), placement_range_deg=45.0, noise_sigma=SIGMA)


def behind(a: float, focus: float | None = None) -> sim.Eyes:
    """A hole of relative aperture a, or a lens in it, with such a share of the focal length that is right."""
    focal_length = None if focus is None else focus * EYES.eye().sensor_distance
    return replace(EYES, optics=optics.Pupil(a * EYES.sensor_width / 2, thin_lens_focal_length=focal_length))


CASES = {
    "hole, a = .9": behind(0.9),
    "hole, a = .55": behind(0.55),
    "hole, a = .3": behind(0.3),
    "lens out of focus, a = .55": behind(0.55, 1.5),
    "lens nearly in focus, a = .55": behind(0.55, 1.1),
    "lens in focus, a = .55": behind(0.55, 1.0),
}


def moments(world: sim.World) -> WorldState:
    """Worlds in which agents have gone about."""
    simulation, random = Simulation(world, WORLDS, 0, "training", 1), np.random.default_rng(0)
    simulation.reset()
    for _ in range(STEPS):
        simulation.step(random.uniform(-1, 1, (WORLDS, 2)))
    simulation.close()
    return simulation.state


def rows(world: sim.World, name: str, eyes: sim.Eyes, state: WorldState) -> list[str]:
    """A table's rows of one eye."""
    bounced = sim.Fidelity(TRUE, eyes.bands, light="bounce")
    truth = sim.BatchedRenderer(world, eyes, 1, bounced).resized(WORLDS).signals(state)
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
        seen = sim.BatchedRenderer(world, eyes, WORLDS, replace(how, light=light)).signals(state)
        error = float(np.sqrt(np.mean((seen - truth) ** 2))) / SIGMA
        samples = f"{how.rays_per_receptor:.3g} {how.samples} ({len(renderer.sensor.directions)}), {how.light}"
        found.append(f"| {name} | {samples} | {error:.2f} | {np.median(spent[WARM_UP:]):.1f} |")
    return found


def main() -> None:
    dr.set_thread_count(1)
    world = sim.build_world("detection")
    state = moments(world)
    print("| eye | samples | error [σ] | CPU [ms] |\n|---|---|---|---|")
    for name, eyes in CASES.items():
        print("\n".join(rows(world, name, eyes, state)), flush=True)


if __name__ == "__main__":
    main()
