"""Functions that build environments from a world, a task, physics and eyes."""

from __future__ import annotations

import inspect
from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import numpy as np

from optics import TurbidMedium
from optics.numerics.arguments import did_you_mean, of_kind, shown, whole
from optics.spectra.spectrum import Spectrum
from sim.envs.calls import seed_of
from sim.envs.follow_camera import check_render_mode
from sim.envs.prepared_task import PreparedTask
from sim.envs.vec_env import EyesVecEnv
from sim.eyes.eyes import Eyes
from sim.render.fidelity import Fidelity, requested_fidelity
from sim.tasks.batch_task import BatchTask
from sim.tasks.encounter import Encounter
from sim.tasks.eye_kinds import auxiliary_of
from sim.tasks.registry import task_of
from sim.tasks.reward import check_mode
from sim.tasks.simulation import check_least_return
from sim.tasks.task import Task
from sim.tasks.task_settings import TaskSettings
from sim.tasks.user_tasks import batched
from sim.worlds.course import Course
from sim.worlds.layout import WALL_HEIGHT
from sim.worlds.layout_family import LayoutSet
from sim.worlds.world import build_world

if TYPE_CHECKING:
    from sim.envs.parallel_env import EncounterEnv

AUTO = "auto"
LAYOUT = "only built-in tasks have layouts; the world of a user task is its model"
OF_TASKS = {  # arguments that only built-in tasks accept, with the setting of a user task that replaces them
    "eyes": "a user task defines its eyes by its settings eye and mounts",
    "rays_per_receptor": "a user task defines it by its setting fidelity",
    **dict.fromkeys(("world_seed", "mazes", "course", "layouts", "wall_height"), LAYOUT),
    **{
        name: f"a user task defines it by its setting {name}"
        for name in ("fidelity", "spectra", "medium", "vary", "auxiliary")
    },
}
IN_RESET = "pass it to reset(seed=...)"
MOST = 1_000_000  # limit for n_envs and for memory; higher values would exceed any computer's RAM


def make_vec_env(
    task: str | Task | BatchTask | Encounter,
    eyes: Eyes | Mapping[str, Eyes] | None = None,
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
    layouts: LayoutSet | None = None,
    wall_height: float = WALL_HEIGHT,
    least_return: float | None = None,
    episode_steps: int | None = None,
    spectra: Mapping[str, Spectrum | str] | None = None,
    medium: TurbidMedium | str | None = None,
    vary: Mapping[str, tuple[Any, ...]] | None = None,
    auxiliary: Sequence[str] = (),
    render_mode: str | None = None,
) -> EyesVecEnv:
    """Return a batched environment of one task.

    task: one of `sim.TASKS`, a user-defined `sim.Task` or `sim.BatchTask`, or a `sim.Encounter`. With a user task, only
        n_envs, seed, memory, mode, least_return, episode_steps and render_mode may be passed, because the task itself
        defines what the other arguments set. The animals of an encounter learn a single policy, and therefore must have
        the same spaces. Arrays then have one row for each animal of each world.
    eyes: the agent's eyes: one `sim.Eyes`, or several kinds of eyes by name; None: the default, `sim.Eyes()`
    n_envs: number of worlds, 1 to 1,000,000
    seed: seed of episodes and noise, a whole number of at least 0; None: a random seed
    memory: number of frames in an observation, 1 to 1,000,000
    mode: "training", "evaluation" or "test". In evaluation of a built-in task, objects that the agent reached reappear
        elsewhere, and the reward has the weights by which fitness is defined. "test" is an evaluation for final
        results. It equals "evaluation", unless a user task uses other worlds in this mode.
    rays_per_receptor: number of rays traced for each receptor; with a number, reflected light is ignored. "auto": the
        fastest rendering settings (`sim.Fidelity`) whose error is small compared with the receptors' noise. They
        include light that was reflected twice if this light changes signals noticeably. The same settings are returned
        by `sim.choose_fidelity(world, eyes, bands="own")`.
    fidelity: a complete `sim.Fidelity` instead of rays_per_receptor, or "auto", which has the same meaning as
        rays_per_receptor="auto". A `sim.Fidelity` may also be passed as rays_per_receptor.
    world_seed, mazes, course, layouts, wall_height: the layout that all worlds share, see `sim.build_world`
    least_return: a negative number. In training, an episode is truncated once the sum of its rewards is at most this
        number. None: never
    episode_steps: number of actions after which an episode is truncated, 1 or more; None: the task's default
    spectra: spectra of materials and lights by name, used instead of their colours: see `sim.build_world`
    medium: water or air between surfaces and eyes: see `sim.build_world`
    vary: ranges of quantities that are drawn for each episode, see docs/tasks.md. With {"light": (low, high)}, each
        episode has its own light level, whose logarithm is distributed uniformly; 1 is full daylight.
    auxiliary: one or several of "depth", "ids" and "flow": quantities that an observation contains for each receptor in
        addition to its signal, see docs/tasks.md
    render_mode: content of the images that the environment renders for human viewers. "rgb_array": the agent from
        behind, or the model of a user task, in both cases with the fields of view of the eyes drawn into the image;
        "eyes": the signals of all eyes, side by side, with a row for each kind of eyes; None: no images

    Physics uses as many threads as Dr.Jit, but no more threads than there are worlds. drjit.set_thread_count limits the
    threads of physics and of Dr.Jit. A FidelityWarning states that the fidelity is less accurate than allowed. A
    MirrorWarning lists features of the model that are not rendered.

    Raises:
        ValueError: an argument is invalid, or has no effect for this task.
        optics.AccuracyError: the pupil spreads light too far for the PSF to be computed.
        optics.BackendError: Dr.Jit finds no usable LLVM library or GPU.
        RuntimeError: a method of a `sim.Task` fails at the start of the first episode. An exception of a
            `sim.BatchTask` is raised unchanged.
    """
    if episode_steps is not None:
        _require_whole("episode_steps", episode_steps, 1)
    how: dict[str, Any] = {"least_return": least_return, "episode_steps": episode_steps, "render_mode": render_mode}
    if isinstance(task, type) and issubclass(task, Task | BatchTask):
        raise ValueError(f"task is the class {task.__name__}: must be an instance, such as {task.__name__}()")
    if isinstance(task, Task | BatchTask | Encounter):
        _refuse_for_tasks({name: value for name, value in locals().items() if name != "how"})
        _check(n_envs, seed, memory, mode, render_mode)
        prepared = PreparedTask(batched(task).in_mode(mode))
        return prepared.vec_env(n_envs, seed, memory, **how)
    eyes = Eyes() if eyes is None else eyes
    _require_eyes(eyes)
    asked = _fidelity_of(rays_per_receptor, fidelity, eyes)
    _require_whole("world_seed", world_seed, 0)
    _check(n_envs, seed, memory, mode, render_mode)
    check_least_return(least_return, mode)
    if vary is not None:
        of_kind("vary", vary, Mapping, "{'light': (0.5, 2.0)}")
    if asked is not None:
        eyes = in_bands(eyes, asked.bands)
    where: dict[str, Any] = {"seed": world_seed, "mazes": mazes, "course": course, "wall_height": wall_height}
    world = build_world(task, **where, layouts=layouts, spectra=spectra, medium=medium)
    built_in = task_of(world, mode, eyes=eyes, fidelity=asked or AUTO)
    built_in.vary, built_in.auxiliary = vary or None, auxiliary_of(auxiliary, "auxiliary")
    return PreparedTask(built_in).vec_env(n_envs, seed, memory, **how)


def make_parallel_env(
    encounter: Encounter, seed: int | None = 0, *, memory: int = 1, render_mode: str | None = None
) -> EncounterEnv:
    """Return a PettingZoo parallel environment of several animals in one world; see `sim.Encounter`.

    seed: seed of episodes and noise until `reset` receives another seed, a whole number of at least 0; None: a random
        seed
    memory: number of frames in an observation, 1 to 1,000,000
    render_mode: "rgb_array": an image of the model, with the fields of view of all animals' eyes drawn into it; "eyes":
        the signals of their eyes, one image for each animal; None: no images

    Raises:
        ValueError: an argument is invalid, or two animals drive the same actuator.
        ImportError: PettingZoo is not installed.
        optics.AccuracyError: the pupil spreads light too far for the PSF to be computed.
        optics.BackendError: Dr.Jit finds no usable LLVM library or GPU.
        RuntimeError: a method of a user task fails at the start of the first episode.
    """
    if not isinstance(encounter, Encounter):
        raise ValueError(
            f"encounter = {shown(encounter)}: must be a sim.Encounter, such as sim.Encounter(Prey(), Hunter())"
        )
    _check(1, seed, memory, "training", render_mode)
    if find_spec("pettingzoo") is None:
        raise ImportError("make_parallel_env needs PettingZoo: pip install 'rhabdom[pettingzoo]'")
    from sim.envs.parallel_env import EncounterEnv

    return EncounterEnv(encounter, seed, memory, render_mode)


def refuse(options: Mapping[str, Any], reasons: Mapping[str, str]) -> None:
    """Refuse options that `make_vec_env` does not have, and those in `reasons`, which states why.

    Raises:
        ValueError: an option must be left out.
    """
    known = inspect.signature(make_vec_env).parameters
    for name, value in options.items():
        if name in reasons:
            raise ValueError(f"{name} = {shown(value)}: must be left out, {reasons[name]}")
        if name not in known:
            right = f"must be an argument of sim.make_vec_env{did_you_mean(name, known)}"
            raise ValueError(f"{name} = {shown(value)}: unknown, {right}")


def in_bands(eyes: Eyes | Mapping[str, Eyes], bands: int) -> Any:
    """Return the same eyes with this number of spectral bands."""
    if isinstance(eyes, Eyes):
        return replace(eyes, bands=bands)
    return {name: replace(of_kind, bands=bands) for name, of_kind in eyes.items()}


def _require_eyes(eyes: Any) -> None:
    kinds = eyes.values() if isinstance(eyes, Mapping) else [eyes]
    if not kinds or not all(isinstance(of_kind, Eyes) for of_kind in kinds):
        raise ValueError(
            f"eyes = {shown(eyes)}: must be sim.Eyes, a mapping of names to sim.Eyes, or None for the default eyes"
        )


def _refuse_for_tasks(given: Mapping[str, Any]) -> None:
    """Raise a ValueError if `make_vec_env` received an argument whose value a user task defines itself.

    Also raise it if the task has a wrong `mode`: neither the default mode nor the mode that was passed to
    `make_vec_env`. If the task is an encounter of several animals, each animal has its own task, and all of these are
    checked.

    given: all arguments of `make_vec_env`
    """
    parameters = inspect.signature(make_vec_env).parameters
    for name, why in OF_TASKS.items():
        if given[name] != parameters[name].default:
            raise ValueError(f"{name} = {shown(given[name])}: must be left out, {why}")
    task = given["task"]
    for animal in task.animals if isinstance(task, Encounter) else (task,):
        if animal.mode not in (TaskSettings.mode, given["mode"]):
            name = type(animal).__name__
            raise ValueError(f"{name}: mode = {shown(animal.mode)}: must be left out, the environment's mode sets it")


def _fidelity_of(
    rays_per_receptor: float | str | Fidelity, fidelity: Fidelity | str | None, eyes: Eyes | Mapping[str, Eyes]
) -> Fidelity | None:
    """Return the rendering settings that the arguments specify; None if they are to be chosen automatically."""
    chosen = isinstance(fidelity, str) and fidelity == AUTO
    if not (fidelity is None or chosen or isinstance(fidelity, Fidelity)):
        raise ValueError(f"fidelity = {shown(fidelity)}: must be a sim.Fidelity, {AUTO!r} or None")
    asked = (
        rays_per_receptor
        if isinstance(rays_per_receptor, Fidelity)
        else requested_fidelity(rays_per_receptor, _first(eyes))
    )
    if fidelity is None:
        return asked
    if asked is not None:
        raise ValueError(f"rays_per_receptor = {shown(rays_per_receptor)}: must be left out if a fidelity is given")
    return fidelity if isinstance(fidelity, Fidelity) else None


def _first(eyes: Eyes | Mapping[str, Eyes]) -> Eyes:
    return eyes if isinstance(eyes, Eyes) else next(iter(eyes.values()))


def _check(n_envs: int, seed: int | None, memory: int, mode: str, render_mode: str | None) -> None:
    """Refuse bad arguments before any expensive work."""
    for name, number in (("n_envs", n_envs), ("memory", memory)):
        _require_whole(name, number, 1)
        whole(name, number, 1, MOST)
    seed_of("seed", seed)
    check_mode(mode)
    check_render_mode(render_mode)


def _require_whole(name: str, number: Any, least: int) -> None:
    if isinstance(number, bool) or not isinstance(number, int | np.integer) or number < least:
        raise ValueError(f"{name} = {shown(number)}: must be a whole number, at least {least}")
