"""Time of a quick picture of the agent beside a slow one, in one process.

    python -m validation.benchmarks.picture_times

Prints medians of CPU time of one thread, with and without eyes in the picture. The first two pictures of each kind, in
which kernels are compiled, do not count. The agent walks from picture to picture.
"""

from __future__ import annotations

import time

import drjit as dr
import numpy as np

import sim
from sim.envs.follow_camera import FollowCamera
from sim.worlds.state import WorldState

QUICK, SLOW, WARM_UP = 15, 3, 2  # pictures
SAMPLES = 12  # of slow pictures
EYES = {"maze": sim.Eyes(n_eyes=10, resolution=(1, 4), fov_deg=30, placement_range_deg=300)}


def walk(task: str, eyes: sim.Eyes) -> tuple[sim.World, list[WorldState]]:
    """States of an agent that turns slowly as it goes."""
    env = sim.make_env(task, eyes, rays_per_receptor=1)
    env.reset(seed=1)
    states = []
    for _ in range(WARM_UP + QUICK):
        env.step(np.array([0.3, 0.1]))
        states.append(env.state)
    return sim.build_world(task), states


def milliseconds(camera: FollowCamera, states: list[WorldState]) -> float:
    """Median CPU time of a picture."""
    spent = []
    for state in states:
        start = time.process_time()
        camera.picture(state)
        spent.append(1e3 * (time.process_time() - start))
    return float(np.median(spent[WARM_UP:]))


def main() -> None:
    """Prints a row for each task."""
    dr.set_thread_count(1)
    print("| task | quick [ms] | without eyes [ms] | slow [ms] | slow / quick |")
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
