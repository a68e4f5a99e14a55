"""A task of one's own: a robot with eyes, how an episode begins, and what a step is worth."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

import optics
from optics.numerics.arguments import did_you_mean, finite, whole
from optics.spectra.spectrum import Spectrum
from sim.eyes.eyes import Eyes
from sim.eyes.mounts import Mount, fan
from sim.physics.controls import actuator_names, controls_of
from sim.render.fidelity import Fidelity
from sim.scene import source
from sim.tasks.eye_kinds import kinds_of, several

if TYPE_CHECKING:
    from sim.tasks.encounter import Frozen

MOST_STEPS = 10**9


class Task:
    """What a subclass says about itself; only `model`, `mounts` and `rewards` have no default.

    model: an MjModel, or what compiles to one (`sim.mirror`)
    eye: optics and retina of every eye · mounts: where the eyes are; of several kinds of eyes both are dictionaries,
        such as {"wide": ..., "sharp": ...}, and an observation has an array for each kind in the place of "eyes"
    fidelity: how finely they see, see `sim.ModelRenderer`; "auto": as a few moments of its episodes want, see
        `sim.choose_model_fidelity`; of several kinds alike, or a dictionary, too
    substeps: of physics in one action · episode_steps: actions, then an episode is truncated
    spectra: of materials and lights, by name, in the place of their colours
    vary: what is drawn anew for each episode and world, as (low, high) by name, before `reset`:
        "light", a factor of all lights, evenly over its logarithm
        "color_temperature" [K] of what is white, evenly over its reciprocal
        "GEOM.size", a factor of a geom's size, evenly over its logarithm; its mass and inertia are MuJoCo's compiler's
        "GEOM.color", between two colours (red, green, blue), each share by itself; a texture is multiplied by it
        "GEOM.material", of two or more of the model's, by name: its texture, colour and glow; the geom has no rgba
        "JOINT.start", where a hinge [rad] or a slide [m] is at first; "BODY.start", between two points (x, y, z) [m],
        of a mocap body or one with a free joint
        All but "light" and "color_temperature" are in each world's own `data.model`, or in its data. Worlds have
        models of their own, too, where the first `reset` changes `data.model`; otherwise they share one
    auxiliary: of "depth", "ids" and "flow": what an observation holds of each receptor beside its signal: how far what
        its centre looks at is, which geom, and how it has moved since the last observation; see docs/tasks.md. Eyes
        that evolve have none
    camera: name of the camera that pictures for people are taken with; None: one that looks at the whole model
    actuators: names of those that an action drives; None: all
    name: what it is called among others; None: as its class
    failure_reward: what a step is worth that breaks its world, as the reward's term "failure". Where rewards are costs,
        0 is more than any episode: to break the world pays, unless this is less than an episode may cost
    others: animals in the same world that do not learn, see `sim.Frozen`; each has a body, actuators and eyes of its
        own in the one model. Then an episode begins with everybody's `reset`, in turn, and ends as soon as anybody's
        `terminated` says so: it is truncated for those whose own does not

    Where the task evolves (`evolve run FILE.py:CLASS`), every animal has eyes of its own, where `place` puts them; a
    class without arguments is needed for that.

    What fails in a method ends its world's episode; in `reset`, and in `feels` there, it is a RuntimeError for all,
    since a world that cannot begin has no episode.

    Methods are called for one world at a time, with its mjData after mj_forward. One task serves all worlds: what an
    episode must remember belongs into mjData (`userdata`, say), not into the task.
    """

    model: mujoco.MjModel | mujoco.MjSpec | str | Path
    eye: optics.Eye | Mapping[str, optics.Eye] = optics.Eye()
    mounts: Sequence[Mount] | Mapping[str, Sequence[Mount]] = ()
    fidelity: Fidelity | str | Mapping[str, Fidelity | str] = "auto"
    substeps: int = 5
    episode_steps: int = 256
    spectra: Mapping[str, Spectrum | str] | None = None
    vary: Mapping[str, tuple[Any, ...]] | None = None
    auxiliary: Sequence[str] = ()
    camera: str | None = None
    actuators: Sequence[str] | None = None
    name: str | None = None
    failure_reward: float = 0.0
    others: Sequence[Frozen] = ()

    def reset(self, data: mujoco.MjData, rng: np.random.Generator) -> None:
        """Begin an episode: change what mj_resetData has left. `data.model` may be changed, too, for the episode."""

    def act(self, data: mujoco.MjData, action: np.ndarray) -> None:
        """Take an action in [-1, 1], (n_actions,); here: each control of its actuators over the whole of its range."""
        model, mine = data.model, controls_of(data.model, self.actuators)
        limited = model.actuator_ctrllimited[mine].astype(bool)
        low, high = np.where(limited[:, None], model.actuator_ctrlrange[mine], [-1.0, 1.0]).T
        data.ctrl[mine] = low + (high - low) * (action + 1) / 2

    def rewards(self, data: mujoco.MjData) -> Mapping[str, float]:
        """What the step that led here is worth, by named terms; the reward is their sum."""
        raise NotImplementedError

    def terminated(self, data: mujoco.MjData) -> bool:
        """Whether the episode ends here."""
        return False

    def succeeded(self, data: mujoco.MjData) -> bool:
        """Whether what was to be done is done: `info["is_success"]`."""
        return False

    def feels(self, data: mujoco.MjData) -> np.ndarray:
        """What the animal knows beside what it sees, (k,); here: nothing."""
        return np.zeros(0)

    def place(self, n_eyes: int, placement_range_deg: float, elevation_deg: float) -> Sequence[Mount]:
        """Where an evolving animal has its eyes; here: the first of `mounts`, fanned out, see `sim.fan`."""
        assert not isinstance(self.mounts, Mapping)
        return fan(self.mounts[0], n_eyes, placement_range_deg, elevation_deg)

    def n_actions(self, model: mujoco.MjModel) -> int:
        """Numbers in an action; here: as many controls as its actuators take, which is one each of most kinds."""
        return len(controls_of(model, self.actuators))


def require_rewards(task: Task) -> None:
    """ValueError unless whoever learns it is paid."""
    if getattr(task.rewards, "__func__", None) is Task.rewards:
        name = type(task).__name__
        raise ValueError(f"{name}: rewards: must be defined, to return numbers by name, such as {{'progress': 0.1}}")


def compiled(task: Task, model: mujoco.MjModel | None = None) -> mujoco.MjModel:
    """The model of a task whose other settings are right; model: where it has been compiled already.

    Raises:
        ValueError: something is missing, or wrong.
    """
    name = type(task).__name__
    if not hasattr(task, "model"):
        raise ValueError(f"{name}: model: must be set, to an MjModel, a path or MJCF text")
    kinds_of(task)
    finite(f"{name}: failure_reward", task.failure_reward)
    whole(f"{name}: substeps", task.substeps, 1, MOST_STEPS)
    whole(f"{name}: episode_steps", task.episode_steps, 1, MOST_STEPS)
    model = source.load(task.model) if model is None else model
    cameras = [model.camera(k).name for k in range(model.ncam)]
    if task.camera is not None and task.camera not in cameras:
        listed = ", ".join(map(repr, cameras)) or "none"
        raise ValueError(f"{name}: no camera {task.camera!r}; the model has {listed}")
    known = actuator_names(model)
    for actuator in task.actuators or ():
        if actuator not in known:
            raise ValueError(f"{name}: actuators: {actuator!r}: must be in the model{did_you_mean(actuator, known)}")
        if not len(controls_of(model, [actuator])):
            raise ValueError(f"{name}: actuators: {actuator!r} takes no control: must be one that can be driven")
    if task.n_actions(model) < 1:
        raise ValueError(f"{name}: its model has no actuators: n_actions and act must say what an action is")
    return model


def grown(task: Task, eyes: Eyes, elevation_deg: float = 0.0) -> Task:
    """The same task for an animal with such eyes, where the task places them.

    Raises:
        ValueError: the task places another number of eyes, or none, since it has no mounts, or has several kinds; its
            `place` fails.
    """
    name, animal = type(task).__name__, copy.copy(task)
    if several(task):
        raise ValueError(f"{name}: eye and mounts have several kinds of eyes: must have one, where eyes evolve")
    if not task.mounts and type(task).place is Task.place:
        raise ValueError(f"{name}: mounts = {task.mounts!r}: must hold one sim.Mount at least, where the eyes are")
    animal.eye, animal.auxiliary = eyes.eye(), ()
    try:
        animal.mounts = tuple(task.place(eyes.n_eyes, eyes.placement_range_deg, elevation_deg))
    except ValueError:
        raise
    except Exception as error:
        raise ValueError(f"{name}: place: {type(error).__name__}: {error}") from error
    if len(animal.mounts) != eyes.n_eyes or not all(isinstance(mount, Mount) for mount in animal.mounts):
        raise ValueError(f"{name}: place returned {animal.mounts!r:.200}: must be {eyes.n_eyes} of sim.Mount")
    return animal


def named_terms(task: Task, data: mujoco.MjData, whose: str = "") -> dict[str, float]:
    """Its rewards; whose: what a message begins with.

    Raises:
        ValueError: they are no finite numbers by name.
    """
    terms: Any = task.rewards(data)
    if not isinstance(terms, Mapping):
        raise ValueError(f"{whose}rewards returned {terms!r}: must be numbers by name, such as {{'progress': 0.1}}")
    for name, value in terms.items():
        if not np.isscalar(value) or not np.isfinite(value):
            raise ValueError(f"{whose}rewards: {name!r} is {value!r}: must be one finite number")
    return {str(name): float(value) for name, value in terms.items()}
