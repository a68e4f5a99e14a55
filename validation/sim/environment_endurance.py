"""Memory and kernel recordings of an environment over a hundred thousand steps

    python -m validation.sim.environment_endurance [--steps N] [--task TASK]

The script steps a small VecEnv, whose eyes have a pupil, with random actions over many episodes. It reads the process's
resident memory after every tenth of the steps. Bounds: after the first tenth, the memory grows by less than 2 MB
(allocators round), and no frozen function is recorded a second time.
"""

from __future__ import annotations

import argparse
import sys

import numpy as np

import sim
from validation.benchmarks.sim_throughput import CASES, with_pupil

GROWTH = 2.0  # largest growth [MB]
WORLDS = 4


def resident() -> float:
    """Return the resident memory of this process [MB] (Linux)."""
    with open("/proc/self/status", encoding="ascii") as status:
        line = next(line for line in status if line.startswith("VmRSS:"))
    return int(line.split()[1]) / 1024


def measure(task: str, steps: int) -> tuple[list[float], int, int]:
    """Return the resident memory [MB] after each tenth of the steps, and numbers of kernel recordings.

    Recordings are counted after the first tenth and at the end.
    """
    case = next(case for case in CASES if case.task == task)
    worlds = sim.make_vec_env(task, with_pupil(case.eyes), WORLDS)
    worlds.reset()
    rng = np.random.default_rng(0)
    memory, recorded = [], []
    for _ in range(10):
        for _ in range(steps // 10):
            worlds.step(rng.uniform(-1, 1, (WORLDS, 2)))
        memory.append(resident())
        recorded.append(worlds.renderer.recordings)
    worlds.close()
    return memory, recorded[0], recorded[-1]


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--steps", type=int, default=100_000)
    parser.add_argument("--task", choices=[case.task for case in CASES], default="detection")
    options = parser.parse_args(arguments)
    memory, first, last = measure(options.task, options.steps)
    print(f"{options.task}, {options.steps} steps of {WORLDS} worlds; resident memory [MB] after each tenth:")
    print("  ".join(f"{m:.1f}" for m in memory))
    growth = memory[-1] - memory[0]
    print(f"grown by {growth:.2f} MB since the first tenth; recordings {first}, then {last}")
    return int(growth >= GROWTH or last != first)


if __name__ == "__main__":
    sys.exit(main())
