"""Steps per second of a task on single worlds and on arrays of worlds (`examples/find_ball.py` and `find_balls.py`).

Actions are random, and episodes restart when they end. Both forms take turns in one process. Rates are medians of the
rounds. The ratio is the median of the rounds' ratios, with the smallest and the largest in brackets.

    python -m validation.benchmarks.batch_task_throughput [--rounds 7] [--seconds 1]
"""

from __future__ import annotations

import argparse
import importlib.util
import time
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

import sim
from sim.envs.vec_env import EyesVecEnv

WORLDS = (1, 16, 64, 256)
EXAMPLES = Path(__file__).parents[2] / "examples"
TASKS = {"find_ball": "FindBall", "find_balls": "FindBalls"}


def task(module: str) -> Any:
    """Return the task of an example."""
    spec = importlib.util.spec_from_file_location(module, EXAMPLES / f"{module}.py")
    assert spec is not None
    assert spec.loader is not None
    loaded = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(loaded)
    return getattr(loaded, TASKS[module])()


def rate(venv: EyesVecEnv, actions: np.ndarray, seconds: float) -> float:
    """Return the steps of all worlds per second."""
    start, steps = time.perf_counter(), 0
    while time.perf_counter() - start < seconds:
        venv.step(actions[steps % len(actions)])
        steps += 1
    return steps * venv.num_envs / (time.perf_counter() - start)


def rates(worlds: int, rounds: int, seconds: float) -> dict[str, list[float]]:
    """Measure both tasks in turn; return steps per second by task, one number per round."""
    venvs = {name: sim.make_vec_env(task(name), n_envs=worlds, seed=0) for name in TASKS}
    actions = np.random.default_rng(0).uniform(-1, 1, (50, worlds, 1)).astype(np.float32)
    for venv in venvs.values():
        venv.reset()
        rate(venv, actions, seconds)  # compiles kernels
    found: dict[str, list[float]] = {name: [] for name in TASKS}
    for _ in range(rounds):
        for name, venv in venvs.items():
            found[name].append(rate(venv, actions, seconds))
    for venv in venvs.values():
        venv.close()
    return found


def main() -> None:
    assert __doc__
    options = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    options.add_argument("--rounds", type=int, default=7, help="rounds of each measurement")
    options.add_argument("--seconds", type=float, default=1.0, help="seconds of each round")
    asked = options.parse_args()
    print("| worlds | sim.Task, steps/s | sim.BatchTask, steps/s | ratio |\n|---|---|---|---|")
    for worlds in WORLDS:
        single, batch = rates(worlds, asked.rounds, asked.seconds).values()
        ratios = [b / s for s, b in zip(single, batch, strict=True)]
        spread = f"{median(ratios):.2f} [{min(ratios):.2f}, {max(ratios):.2f}]"
        print(f"| {worlds} | {median(single):,.0f} | {median(batch):,.0f} | {spread} |")


if __name__ == "__main__":
    main()
