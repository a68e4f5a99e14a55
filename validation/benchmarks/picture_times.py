"""Times of fast and slow renderings of an agent, in one process.

    python -m validation.benchmarks.picture_times

The script prints medians of the CPU time of one thread, with and without the eyes' signals in the image. The first two
images of each kind compile kernels and do not count. The agent moves between images.
"""

from __future__ import annotations

import time

import drjit as dr
import numpy as np

import sim
from sim.envs.follow_camera import FollowCamera
from sim.worlds.state import WorldState

QUICK, SLOW, WARM_UP = 15, 3, 2  # numbers of fast, slow and uncounted images
SAMPLES = 12  # of slow renderings
EYES = {"maze": sim.Eyes(n_eyes=10, resolution=(1, 4), fov_deg=30, placement_range_deg=300)}


def walk(task: str, eyes: sim.Eyes) -> tuple[sim.World, list[WorldState]]:
    """Return a world, and the states of an agent in it that turns slowly as it moves."""
    env = sim.make_env(task, eyes, rays_per_receptor=1)
    env.reset(seed=1)
    states = []
    for _ in range(WARM_UP + QUICK):
        env.step(np.array([0.3, 0.1]))
        states.append(env.state)
    return sim.build_world(task), states


def milliseconds(camera: FollowCamera, states: list[WorldState]) -> float:
    """Return the median CPU time [ms] of a rendering."""
    spent = []
    for state in states:
        start = time.process_time()
        camera.picture(state)
        spent.append(1e3 * (time.process_time() - start))
    return float(np.median(spent[WARM_UP:]))


def main() -> None:
    """Print a row for each task."""
    dr.set_thread_count(1)
    print("| task | fast [ms] | without eyes [ms] | slow [ms] | slow / fast |")
    print("|---|---|---|---|---|")
    for task in sim.TASKS:
        eyes = EYES.get(task, sim.Eyes())
        world, states = walk(task, eyes)
        quick = milliseconds(FollowCamera(world, eyes), states)
        bare = milliseconds(FollowCamera(world), states)
        slow = milliseconds(FollowCamera(world, eyes, samples=SAMPLES), states[: WARM_UP + SLOW])
        print(f"| {task} | {quick:.0f} | {bare:.0f} | {slow:.0f} | {slow / quick:.0f} |")


if __name__ == "__main__":
    main()
