"""World, task, physics and eyes put together: the makers of environments."""

from __future__ import annotations

import inspect
from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import drjit as dr
import numpy as np

from optics.numerics.arguments import shown, whole
from optics.spectra.spectrum import Spectrum
from sim.envs.auxiliary import checked
from sim.envs.follow_camera import check_render_mode
from sim.envs.simulation import Simulation, check_least_return
from sim.envs.task_vec_env import TaskVecEnv
from sim.envs.vec_env import EyesVecEnv
from sim.eyes.eyes import Eyes
from sim.render.batched_renderer import BatchedRenderer
from sim.render.fidelity import Fidelity, fidelity_asked
from sim.render.fidelity_choice import chosen_fidelity
from sim.render.world_scene import WorldScene
from sim.scene.variation import Variation
from sim.tasks.encounter import Encounter
from sim.tasks.reward import check_mode
from sim.tasks.user_task import Task
from sim.worlds.course import Course
from sim.worlds.world import build_world

if TYPE_CHECKING:
    from sim.envs.parallel_env import EncounterEnv

AUTO = "auto"
MOST = 1_000_000  # choice: of worlds and of frames, more than memory holds


def make_vec_env(
    task: str | Task | Encounter,
    eyes: Eyes | None = None,
    n_envs: int = 64,
    seed: int | None = 0,
    *,
    memory: int = 1,
    mode: str = "training",
    rays_per_receptor: float | str | Fidelity = "auto",
    fidelity: Fidelity | str | None = None,
    world_seed: int = 0,
    mazes: int = 1,
    course: str | Course = "short",
    least_return: float | None = None,
    episode_steps: int | None = None,
    spectra: Mapping[str, Spectrum | str] | None = None,
    vary: Mapping[str, tuple[float, float]] | None = None,
    auxiliary: Sequence[str] = (),
    render_mode: str | None = None,
) -> EyesVecEnv | TaskVecEnv:
    """A batched environment of one task.

    task: one of `sim.TASKS`, or a `sim.Task` of one's own, which says all but n_envs, seed, memory, episode_steps
        and render_mode itself; a `sim.Encounter` of animals that are alike learns one policy, with a row for each
        animal of each world
    eyes: of every agent; default Eyes()
    n_envs: number of worlds
    seed: of episodes and noise; None draws one
    memory: frames in an observation
    mode: "training", or "evaluation" (objects respawn; rewards weighted as fitness)
    rays_per_receptor: rays traced for each receptor, in direct light; "auto": as few as its noise allows, and light
        that was reflected twice where it counts: `sim.choose_fidelity(world, eyes, bands="own")`
    fidelity: all of how finely it is rendered, in the place of rays_per_receptor (which takes one, too); "auto": as
        that has it
    world_seed, mazes, course: of the layout that all worlds share, see `sim.build_world`
    least_return: in training, an episode whose rewards add up to no more is truncated; None: none is
    episode_steps: actions after which an episode is truncated; None: as many as the task has
    spectra: of materials and lights, by name, in the place of their colours: see `sim.build_world`
    vary: {"light": (low, high)}: each episode has its own level of light, drawn evenly over its logarithm; full
        daylight is 1, and the most
    auxiliary: of "depth", "ids" and "flow": what observations hold of each receptor beside its signal, docs/tasks.md
    render_mode: "rgb_array": the agent seen from behind, with its eyes' fields of view; "eyes": what each eye reports,
        side by side

    Physics takes as many threads as Dr.Jit has: limit both with drjit.set_thread_count.

    Raises:
        ValueError: a bad argument.
    """
    if episode_steps is not None:
        _require_whole("episode_steps", episode_steps, 1)
    if isinstance(task, type) and issubclass(task, Task):
        raise ValueError(f"task is the class {task.__name__}: must be an instance, such as {task.__name__}()")
    if isinstance(task, Task | Encounter):
        _refuse_for_tasks(locals())
        _check(n_envs, seed, memory, mode, render_mode)
        return TaskVecEnv(task, n_envs, seed, memory, render_mode, episode_steps)
    eyes = Eyes() if eyes is None else eyes
    if not isinstance(eyes, Eyes):
        raise ValueError(f"eyes = {shown(eyes)}: must be sim.Eyes or None, the default ones")
    asked = _fidelity_of(rays_per_receptor, fidelity, eyes)
    _require_whole("world_seed", world_seed, 0)
    _check(n_envs, seed, memory, mode, render_mode)
    check_least_return(least_return, mode)
    variation = _dimmed(vary)
    eyes = eyes if asked is None else replace(eyes, bands=asked.bands)
    scene = prepared_scene(task, eyes, world_seed=world_seed, mazes=mazes, course=course, spectra=spectra)
    how: dict[str, Any] = {"memory": memory, "mode": mode, "least_return": least_return, "render_mode": render_mode}
    how |= {"episode_steps": episode_steps, "variation": variation, "auxiliary": checked(auxiliary, "auxiliary")}
    return vec_env_in(scene, asked or chosen_fidelity(scene), n_envs, seed, **how)


def make_parallel_env(
    encounter: Encounter, seed: int | None = 0, *, memory: int = 1, render_mode: str | None = None
) -> EncounterEnv:
    """Several animals in one world, as a PettingZoo parallel environment; see `sim.Encounter`.

    seed: of episodes and noise, until `reset` is given one; None draws one
    memory: frames in an observation
    render_mode: "rgb_array": the model with all animals' eyes; "eyes": what they report, a picture of each animal

    Raises:
        ValueError: a bad argument.
        ImportError: PettingZoo is not installed.
    """
    if not isinstance(encounter, Encounter):
        raise ValueError(
            f"encounter = {encounter!r:.80}: must be a sim.Encounter, such as sim.Encounter(Prey(), Hunter())"
        )
    _check(1, seed, memory, "training", render_mode)
    if find_spec("pettingzoo") is None:
        raise ImportError("make_parallel_env needs PettingZoo: pip install 'rhabdom[pettingzoo]'")
    from sim.envs.parallel_env import EncounterEnv

    return EncounterEnv(encounter, seed, memory, render_mode)


def prepared_scene(
    task: str,
    eyes: Eyes,
    *,
    world_seed: int = 0,
    mazes: int = 1,
    course: str | Course = "short",
    spectra: Mapping[str, Spectrum | str] | None = None,
) -> WorldScene:
    """A task's world made ready for given eyes; arguments as `make_vec_env` has them."""
    return WorldScene(build_world(task, seed=world_seed, mazes=mazes, course=course, spectra=spectra), eyes)


def vec_env_in(
    scene: WorldScene,
    fidelity: Fidelity,
    n_envs: int,
    seed: int | None,
    *,
    memory: int = 1,
    mode: str = "training",
    least_return: float | None = None,
    episode_steps: int | None = None,
    render_mode: str | None = None,
    variation: Variation | None = None,
    auxiliary: tuple[str, ...] = (),
) -> EyesVecEnv:
    """A batched environment in a scene that has been prepared, rendered as finely as is said; arguments as
    `make_vec_env` has them.

    Raises:
        ValueError: a bad argument, and a fidelity for another number of bands than the scene's.
    """
    _check(n_envs, seed, memory, mode, render_mode)
    threads = min(dr.thread_count(), n_envs)
    world = scene.world if episode_steps is None else replace(scene.world, episode_steps=episode_steps)
    simulation = Simulation(world, n_envs, seed, mode, threads, least_return)
    return EyesVecEnv(
        simulation, BatchedRenderer.of(scene, n_envs, fidelity), memory, render_mode, variation, auxiliary
    )


def _dimmed(vary: Mapping[str, tuple[float, float]] | None) -> Variation | None:
    """What varies between episodes of rhabdom's own tasks."""
    if not vary:
        return None
    variation = Variation(vary)
    for name, given in variation.ranges.items():
        if name != "light":
            raise ValueError(f"vary: {name!r}: is for a sim.Task; rhabdom's own tasks vary 'light' alone")
        if given[1] > 1:
            raise ValueError(f"vary: light = {vary[name]!r}: must be at most 1, full daylight")
    return variation


def _refuse_for_tasks(given: Mapping[str, Any]) -> None:
    """What a task of one's own says itself."""
    defaults = {name: p.default for name, p in inspect.signature(make_vec_env).parameters.items()}
    for name in set(defaults) - {"task", "n_envs", "seed", "memory", "episode_steps", "render_mode"}:
        if given[name] != defaults[name]:
            raise ValueError(f"{name} = {given[name]!r}: must be left out, a sim.Task says it itself")


def _fidelity_of(
    rays_per_receptor: float | str | Fidelity, fidelity: Fidelity | str | None, eyes: Eyes
) -> Fidelity | None:
    """What was asked for by either name; None: to be chosen."""
    chosen = isinstance(fidelity, str) and fidelity == AUTO
    if not (fidelity is None or chosen or isinstance(fidelity, Fidelity)):
        raise ValueError(f"fidelity = {shown(fidelity)}: must be a sim.Fidelity, {AUTO!r} or None")
    asked = rays_per_receptor if isinstance(rays_per_receptor, Fidelity) else fidelity_asked(rays_per_receptor, eyes)
    if fidelity is None:
        return asked
    if asked is not None:
        raise ValueError(f"rays_per_receptor = {shown(rays_per_receptor)}: must be left out where a fidelity is given")
    return fidelity if isinstance(fidelity, Fidelity) else None


def _check(n_envs: int, seed: int | None, memory: int, mode: str, render_mode: str | None) -> None:
    """Refuse bad arguments before anything expensive is done."""
    for name, number in (("n_envs", n_envs), ("memory", memory)):
        _require_whole(name, number, 1)
        whole(name, number, 1, MOST)
    if seed is not None:
        _require_whole("seed", seed, 0)
    check_mode(mode)
    check_render_mode(render_mode)


def _require_whole(name: str, number: Any, least: int) -> None:
    if isinstance(number, bool) or not isinstance(number, int | np.integer) or number < least:
        raise ValueError(f"{name} = {shown(number)}: must be a whole number, at least {least}")
