"""Test of a batch task against the protocol that environments rely on, in a few worlds."""

from __future__ import annotations

import contextlib

import numpy as np

from optics.numerics.arguments import shown, whole
from sim.physics.physics import MOST_WORLDS
from sim.tasks.batch_task import BatchTask
from sim.tasks.simulation import Simulation
from sim.tasks.task_settings import MOST_STEPS

__all__ = ["check_batch_task"]

SEED = 0


def check_batch_task(task: BatchTask, n_envs: int = 4, steps: int = 12) -> None:
    """Play random actions in a few worlds, and compare the task's behaviour with the description of `sim.BatchTask`.

    Nothing is rendered. To check an environment, use Gymnasium's `check_env`.

    n_envs: number of worlds, 2 to 1,000,000
    steps: number of actions, 1 to 10⁹

    The function checks the following:

    - The task's settings are valid.
    - All arrays that its methods return have the right shapes, and `rewards`, `proprioception` and the outcome of an
      overridden `judge` contain finite numbers. This check is stricter than an environment, where NaN in `rewards` ends
      the episode of the world.
    - `act` and `judge` return no indices of worlds that do not exist.
    - `reset` changes only the worlds that it was given.
    - A world's episode depends neither on other worlds nor on their number.
    - The same seed leads to the same episode.
    - If `renders_early` is True, `judge` moves bodies only in worlds that it names in `Outcome.changed`.
    - After a stored state has been restored, the same actions have the same results.

    Raises:
        ValueError: the task does not behave as described, is not a `sim.BatchTask`, or a number is out of range. The
            message states the method, the array, the world, and the correct behaviour.
        RuntimeError: the task changes the model of all worlds, or the model enables MuJoCo's "sleep".

    An exception in a method of the task is raised unchanged.
    """
    if not isinstance(task, BatchTask):
        raise ValueError(f"task = {shown(task)}: must be a sim.BatchTask")
    n_envs, steps = whole("n_envs", n_envs, 2, MOST_WORLDS), whole("steps", steps, 1, MOST_STEPS)
    with (
        contextlib.closing(Simulation(task, n_envs, SEED)) as many,
        contextlib.closing(Simulation(task, 1, SEED)) as one,
    ):
        trace = _played(many, steps)
        _require_equal("the same seed", trace, _played(many, steps), "must repeat every episode: draw only from `rngs`")
        single = _played(one, steps)
        own = [{name: array[:1] for name, array in moment.items()} for moment in trace]
        _require_equal("world 0", own, single, "must not depend on other worlds or on their number")
        _require_own_reset(many)
        _require_restored(many, steps)


def _actions(simulation: Simulation, steps: int) -> list[np.ndarray]:
    """Return random actions for each step, (world, value).

    All worlds take the same actions. These have a fixed seed, and do not depend on the number of worlds.
    """
    size = sum(agent.n_actions for agent in simulation.agents)
    random = np.random.default_rng(SEED)
    return [np.tile(random.uniform(-1, 1, size), (simulation.n, 1)).astype(np.float32) for _ in range(steps)]


def _played(simulation: Simulation, steps: int) -> list[dict[str, np.ndarray]]:
    simulation.seed(SEED)
    simulation.reset()
    return [_step(simulation, action) for action in _actions(simulation, steps)]


def _step(simulation: Simulation, action: np.ndarray) -> dict[str, np.ndarray]:
    failed = simulation.move(action)
    before = simulation.poses().geom_xpos
    step = simulation.judge(failed)
    if type(simulation.task).judge is BatchTask.judge:  # which adds only failures of `rewards`
        for world, why in step.failure.items():
            if world not in failed:
                raise ValueError(f"world {world}: {why}")
    if simulation.task.renders_early:
        moved = np.flatnonzero((simulation.poses().geom_xpos != before).any(axis=(1, 2)))
        if unnamed := sorted({*moved.tolist()} - {*step.changed.tolist()}):
            raise ValueError(
                f"judge: moved bodies of world {unnamed[0]}, which is not in Outcome.changed: must name it, or set "
                "renders_early = False"
            )
    found = {"reward": step.reward, "terminated": step.terminated, "success": step.success}
    felt = {f"feels {name}": array.copy() for known in simulation.felt for name, array in known.items()}
    if step.done.any():
        simulation.restart(np.flatnonzero(step.done.reshape(simulation.learners, -1).any(axis=0)))
    return {**found, **felt, "places": simulation.poses().geom_xpos}


def _require_own_reset(simulation: Simulation) -> None:
    before = simulation.get_state()
    last = simulation.n - 1
    simulation.restart(np.array([last]))
    for name, array in simulation.get_state().items():
        # Compared as bytes, so that NaN equals NaN.
        others = [w for w in range(last) if before[name][w].tobytes() != array[w].tobytes()]
        if others:
            raise ValueError(
                f"reset: was given world {last} and changed {name} of world {others[0]}: must not change it"
            )


def _require_restored(simulation: Simulation, steps: int) -> None:
    _played(simulation, 1)
    stored = simulation.get_state()
    first = [_step(simulation, action) for action in _actions(simulation, steps)]
    simulation.set_state(stored, np.arange(simulation.n))
    again = [_step(simulation, action) for action in _actions(simulation, steps)]
    _require_equal("a restored state", first, again, "must lead to the same future: store episodes in worlds' arrays")


def _require_equal(what: str, one: list[dict[str, np.ndarray]], other: list[dict[str, np.ndarray]], right: str) -> None:
    for time, (a, b) in enumerate(zip(one, other, strict=True)):
        for name, array in a.items():
            if not np.array_equal(array, b[name]):
                raise ValueError(f"{what}: {name} differs after action {time}: {right}")
