"""Training speed: PPO with environment and optimiser, compared with MuJoCo's renderer alone.

    python -m validation.benchmarks.learning_throughput [--steps 24576] [--json]

Rates are agent-steps per second of the whole machine. As in an evolutionary run, one training per core runs in
parallel, each in a process with one thread. The measured time covers rollouts and updates, but no evaluations, and
starts after a warm-up training. In the same run, `mujoco.Renderer` renders the same eyes of one world without shadows.
Settings of learning are the defaults of the task. The bound on training applies to one frame of memory and a perfect
lens.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace

from evolve.config.assemble import assemble
from evolve.search.worker import prepare_device
from validation.benchmarks.sim_throughput import (  # sets OpenGL before MuJoCo is imported
    CASES,
    Case,
    measure,
    with_pupil,
)

NEURONS = 64
BARS = {"detection": 12.0, "maze": 50.0}  # smallest ratios of the training rate to that of mujoco.Renderer


@dataclass(frozen=True)
class Learner:
    """A learner: the eyes of a case, with a lens or perfect optics, and the number of frames in memory."""

    case: Case
    lens: bool
    memory: int

    @property
    def name(self) -> str:
        return f"training, {'behind a lens' if self.lens else 'perfect lens'}, memory {self.memory}"


def training_rate(learner: Learner, steps: int, seed: int) -> float:
    """Return agent-steps per second of one training in this process."""
    import sim
    from evolve.learning.policy import Brain
    from evolve.learning.ppo import Worlds, train

    case = learner.case
    eyes = with_pupil(case.eyes) if learner.lens else case.eyes
    config = replace(assemble(case.task).learning, total_steps=steps, eval_interval=steps)
    worlds = sim.make_vec_env(case.task, eyes, config.n_envs, seed, memory=learner.memory, mode="training")
    evaluation_worlds = sim.make_vec_env(case.task, eyes, 2, seed, memory=learner.memory, mode="evaluation")
    marks: list[float] = []
    for attempt in (0, 1):  # the first one compiles kernels and loads torch's lazy modules
        marks.clear()
        train(
            Worlds(worlds, evaluation_worlds),
            Brain(NEURONS),
            config,
            attempt,
            lambda done, planned: marks.append(time.perf_counter()),
        )
    # Between the ends of the first and the last rollout there are only whole updates and rollouts.
    return (len(marks) - 1) * config.n_envs * config.n_steps / (marks[-1] - marks[0])


def machine_rate(learner: Learner, steps: int) -> float:
    """Return agent-steps per second of one training per core, all of which run in parallel."""
    cores = os.cpu_count() or 1
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(cores, mp_context=context, initializer=prepare_device) as pool:
        return sum(pool.map(training_rate, [learner] * cores, [steps] * cores, range(cores)))


def results(case: Case, steps: int) -> dict[str, float]:
    """Return agent-steps per second by name."""
    rates = measure(case, 64, 1.0)["agent_steps_per_second"]
    found = {"mujoco": rates["mujoco"], "environment": rates["step"]}
    for lens, memory in ((False, 1), (False, 5), (True, 1), (True, 5)):
        learner = Learner(case, lens, memory)
        found[learner.name] = machine_rate(learner, steps)
    return found


def missed(task: str, rates: dict[str, float]) -> list[str]:
    """Return the description of the bound if it is missed."""
    ratio = rates["training, perfect lens, memory 1"] / rates["mujoco"]
    return [f"{task}: {ratio:.3g}x mujoco.Renderer, must be {BARS[task]:g}x"] if ratio < BARS[task] else []


def main() -> int:
    """Measure detection and the maze; print a table, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--steps", type=int, default=24_576, help="steps of each training (default 24576)")
    parser.add_argument("--json", action="store_true", help="print JSON")
    options = parser.parse_args()
    rollout = max(assemble(task).learning.n_envs * assemble(task).learning.n_steps for task in BARS)
    if options.steps < 2 * rollout:
        parser.error(f"--steps {options.steps}: must be two rollouts at least, {2 * rollout}")
    found = {case.task: results(case, options.steps) for case in CASES if case.task in BARS}
    broken = [line for task, rates in found.items() for line in missed(task, rates)]
    if options.json:
        print(json.dumps({"cores": os.cpu_count(), "agent_steps_per_second": found, "missed": broken}, indent=2))
        return int(bool(broken))
    for task, rates in found.items():
        print(f"{task}, agent-steps/s of {os.cpu_count()} cores (ratio to mujoco.Renderer):")
        for name, rate in rates.items():
            print(f"  {name:35}{rate:8.0f}{rate / rates['mujoco']:8.1f}x")
    print("\n".join(broken or ["all bounds hold"]))
    return int(bool(broken))


if __name__ == "__main__":
    sys.exit(main())
