"""Choice of the number of frames per action that receptors with dynamics need for correct motion blur.

A few random actions are simulated. For each number of frames, the responses at the end of each action are compared with
    those for the largest number of frames that is tried: at most 20 (FINEST), and at most one frame per physics step.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from typing import Any

import numpy as np

from optics import ReceptorDynamics
from sim.envs.renderers import renderers_for
from sim.eyes.allowed_error import allowed_error
from sim.render.eye_renderer import EyeRenderer
from sim.render.fidelity import Fidelity, Level
from sim.render.receptors_in_time import ReceptorsInTime
from sim.render.world_scene import WorldScene
from sim.tasks.batch_task import BatchTask
from sim.tasks.simulation import Simulation

__all__ = ["dynamics_of", "require_frames", "with_frames"]

Fidelities = Mapping[str, Fidelity]
WORLDS, ACTIONS, FINEST = 4, 6, 20  # chosen: size of a trial, and largest number of frames per action


def dynamics_of(eye: Any) -> Any:
    """Return the dynamics of an eye's receptors; None without dynamics, as for all compound eyes."""
    return getattr(eye, "dynamics", None)


def with_frames(
    task: BatchTask, fidelities: Sequence[Fidelities | None], scenes: Mapping[str, WorldScene] | None
) -> list[Fidelities | None]:
    """Return the fidelities, with `frames` set to the number of frames per action that receptors with dynamics need.

    A fidelity is the accuracy with which the world is rendered for one kind of eyes. The number of frames is the same
    for all eyes of a world. A fidelity or `ReceptorDynamics.frames` may specify the number. Otherwise it is the
    smallest number for which each kind of eyes has an acceptable root mean square error of its signals. If no eyes have
    receptors with dynamics, or the fidelities of all such eyes specify the number, the fidelities are returned
    unchanged.

    fidelities: for each agent, a dictionary with the fidelity of each kind of its eyes; None instead of the dictionary
        if the agent's eyes are not used
    scenes: see `renderers_for`

    Raises:
        ValueError: fidelities and `ReceptorDynamics.frames` specify different numbers.
    """
    kinds = [(kind, of) for agent, of in zip(task.agents(), fidelities, strict=True) if of for kind in agent.kinds]
    in_time = [(kind.eye, of[kind.name]) for kind, of in kinds if dynamics_of(kind.eye) is not None]
    stated = sorted({n for eye, of in in_time if (n := of.frames or dynamics_of(eye).frames) is not None})
    if len(stated) > 1:
        raise ValueError(f"frames = {' and '.join(map(str, stated))}: must be the same for all eyes of a world")
    if not in_time or all(of.frames is not None for _, of in in_time):
        return list(fidelities)
    known = stated[0] if stated else None
    level = _chosen(task, fidelities, scenes) if known is None else (known, Level("frames", _named(known), None, ASKED))
    frames, reason = level
    return [
        None if of is None else {name: _with(fidelity, frames, reason) for name, fidelity in of.items()}
        for of in fidelities
    ]


ASKED = "as requested"


def require_frames(simulation: Simulation, frames: int) -> None:
    """Set the number of moments during each action at which the physics provides poses, so that eyes can be rendered.

    Raises:
        ValueError: the number is not a divisor of the number of physics steps per action, differs from the number that
            was set for other eyes, or exceeds 1 although the physics provides poses only at the end of an action.
    """
    physics = simulation.physics
    if not hasattr(physics, "passed"):
        if frames > 1:
            name = type(physics).__name__
            raise ValueError(f"frames = {frames}: must be 1, the physics {name} has no poses within an action")
        return
    if physics.substeps % frames:
        raise ValueError(f"frames = {frames}: must be a divisor of the {physics.substeps} physics steps of an action")
    if physics.frames not in (1, frames):
        raise ValueError(f"frames = {frames} and {physics.frames}: must be the same for all eyes of a world")
    physics.frames = frames


def _with(fidelity: Fidelity, frames: int, level: Level) -> Fidelity:
    levels = (*fidelity.levels, level) if fidelity.levels else ()
    return replace(fidelity, frames=frames, levels=levels)


def _named(frames: int) -> str:
    return f"{frames} per action"


def _chosen(
    task: BatchTask, fidelities: Sequence[Fidelities | None], scenes: Mapping[str, WorldScene] | None
) -> tuple[int, Level]:
    with closing(Simulation(task, WORLDS, 0)) as worlds:
        steps = worlds.physics.substeps if hasattr(worlds.physics, "passed") else 1
        numbers = [n for n in range(1, min(steps, FINEST) + 1) if steps % n == 0]
        renderers = [
            renderer
            for of in renderers_for(worlds, worlds.agents, fidelities, scenes)
            for renderer in ({} if of is None else of.eyes).values()
            if dynamics_of(renderer.eye) is not None
        ]
        if len(numbers) == 1:
            return 1, Level("frames", _named(1), None, "an action is one physics step")
        require_frames(worlds, numbers[-1])
        seen = _played(worlds, renderers)
        seconds = worlds.physics.seconds
    chosen, worst = 1, 0.0
    for renderer, signals in zip(renderers, seen, strict=True):
        allowed = allowed_error(renderer.eye, renderer.fidelity.tolerance)
        truth = _responses(dynamics_of(renderer.eye), signals, numbers[-1], seconds)
        for frames in numbers:
            off = _responses(dynamics_of(renderer.eye), signals, frames, seconds) - truth
            error = float(np.sqrt(np.mean(np.square(off, dtype=np.float64))))
            if error <= allowed:
                break
        chosen, worst = max(chosen, frames), max(worst, error)
    why = f"fewest of {', '.join(map(str, numbers))} for the allowed error in {len(seen[0])} random actions"
    return chosen, Level("frames", _named(chosen), worst, why)


def _played(worlds: Simulation, renderers: Sequence[EyeRenderer]) -> list[np.ndarray]:
    """Return for each renderer the noise-free signals during random actions, as an array (action, frame, world, ...).

    The random numbers have a fixed seed. The actions stop when an episode ends.
    """
    random = np.random.default_rng(0)
    worlds.reset()
    found: list[list[list[np.ndarray]]] = [[] for _ in renderers]
    for _ in range(ACTIONS):
        commanded = [random.uniform(-1, 1, (worlds.n, agent.n_actions)) for agent in worlds.agents]
        worlds.move(np.concatenate(commanded, axis=1))
        moments = [*worlds.physics.passed, worlds.poses()]
        for renderer, mine in zip(renderers, found, strict=True):
            mine.append([renderer.signals(poses) for poses in moments])
        if worlds.judge({}).done.any():
            break
    return [np.array(mine) for mine in found]


def _responses(dynamics: ReceptorDynamics, signals: np.ndarray, frames: int, seconds: float) -> np.ndarray:
    """Return the responses at the end of each action if `frames` evenly spaced frames are rendered per action.

    signals: signals in all frames, (action, frame, world, ...)
    seconds: duration of an action [s]
    """
    if not len(signals):
        return np.zeros(1)
    finest, n = signals.shape[1:3]
    stride, everyone = finest // frames, np.arange(n)
    receptors = ReceptorsInTime(dynamics, n, signals.shape[3:], seconds / frames)
    receptors.start(signals[0, 0], everyone)
    found = []
    for action in signals:
        for frame in action[stride - 1 :: stride]:
            last = receptors.step(frame, everyone)
        receptors.reset_counts(everyone)
        found.append(last)
    return np.array(found)
