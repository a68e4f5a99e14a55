"""How fast agents learn: PPO training, environment and optimiser together, beside MuJoCo's renderer merely drawing.

    python -m validation.learning_throughput [--steps 16384]

One process: agent-steps per second of training (after a training to warm up), of the environment alone, and of
`mujoco.Renderer` drawing the same eyes of one world without shadows. An evolution runs one such process per core.
"""

from __future__ import annotations

import argparse
import time
from typing import Any

import sim
from evolve.config import LearningConfig
from evolve.learner import train
from validation.sim_throughput import CASES, RAYS_PER_RECEPTOR, Case, measure, with_pupil  # first: it chooses OpenGL

NEURONS = 64


def training_rate(case: Case, eyes: sim.Eyes, memory: int, steps: int) -> float:
    """Agent-steps per second of PPO with the default settings; its evaluations are not among them."""
    config = LearningConfig(total_steps=steps, eval_interval=steps)
    common: dict[str, Any] = {"memory": memory, "rays_per_receptor": RAYS_PER_RECEPTOR}
    worlds = sim.make_vec_env(case.task, eyes, config.n_envs, 0, mode="training", **common)
    evaluation_worlds = sim.make_vec_env(case.task, eyes, 6, 1, mode="evaluation", **common)
    marks: list[float] = []
    for seed in (0, 1):  # the first one compiles kernels and imports what torch imports on first use
        marks.clear()
        began = time.perf_counter()
        train(worlds, evaluation_worlds, NEURONS, config, seed, lambda done, planned: marks.append(time.perf_counter()))
    # From the first rollout's end to the last one's: whole updates and rollouts, no evaluation.
    rollouts = len(marks) - 1
    assert rollouts > 0, f"--steps {steps}: two rollouts at least, {2 * config.n_envs * config.n_steps}"
    assert marks[0] > began
    return rollouts * config.n_envs * config.n_steps / (marks[-1] - marks[0])


def main() -> None:
    """Measure detection and navigation and print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--steps", type=int, default=16384, help="of each training (default 16384)")
    steps = parser.parse_args().steps
    for case in (case for case in CASES if case.task != "tracking"):
        rates = measure(case, 64, 2.0)["agent_steps_per_second"]
        print(f"{case.task}, 64 worlds, agent-steps/s (ratio to mujoco.Renderer):")
        rows = {"environment": rates["step"], "mujoco": rates["mujoco"]}
        for memory in (1, 10):
            rows[f"training, memory {memory}"] = training_rate(case, case.eyes, memory, steps)
            rows[f"training behind a lens, memory {memory}"] = training_rate(case, with_pupil(case.eyes), memory, steps)
        for name, rate in rows.items():
            print(
                f"  {name:35}{rate:8.0f}{rate / rates['mujoco']:8.1f}x"
                if rates["mujoco"]
                else f"  {name:35}{rate:8.0f}"
            )


if __name__ == "__main__":
    main()
