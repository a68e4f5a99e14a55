"""Settings of every task, for one world at a time or for arrays of all worlds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import mujoco

import optics
from optics.numerics.arguments import did_you_mean, finite, whole
from optics.numerics.renamed import warn_renamed
from optics.spectra.spectrum import Spectrum
from sim.eyes.mounts import Mount, fan
from sim.physics.controls import actuator_names, controls_of
from sim.render.fidelity import Fidelity
from sim.scene import source
from sim.tasks.eye_kinds import kinds_of

__all__ = ["MOST_STEPS", "TaskSettings", "compiled"]

MOST_STEPS = 10**9


class TaskSettings:
    """Settings that a subclass defines. Only `model` and `mounts` have no default.

    model: an MjModel, or a source that compiles to one (`sim.mirror`)
    eye: optics and retina of every eye
    mounts: places of the eyes. For several kinds of eyes, eye and mounts are dictionaries, such as {"wide": ...,
        "sharp": ...}. An observation then has an array for each kind instead of "eyes".
    fidelity: fidelity of the eyes, see `sim.ModelRenderer`; "auto": chosen from a few moments of the task's episodes,
        see `sim.choose_model_fidelity`. For several kinds of eyes: a common value, or a dictionary.
    substeps: physics steps per action
    episode_steps: number of actions after which an episode is truncated
    spectra: spectra of materials and lights, by name, which replace their colours
    vary: ranges (low, high), by name, from which values are drawn for each episode and world, before `reset`:
        "light": a factor of all lights, uniform in its logarithm.
        "color_temperature": colour temperature of white [K], uniform in its reciprocal.
        "GEOM.size": a factor of a geom's size, uniform in its logarithm. MuJoCo's compiler computes mass and inertia.
        "GEOM.color": a colour between two colours (red, green, blue), each component independently. It multiplies a
        texture.
        "GEOM.material": one of two or more of the model's materials, by name: its texture, colour and glow. The geom
        must not have its own rgba.
        "JOINT.start": initial position of a hinge [rad] or a slide [m]. "BODY.start": initial position of a mocap body,
        or of a body with a free joint, between two points (x, y, z) [m].
        All values except "light" and "color_temperature" are set in each world's own `data.model`, or in its data.
        Worlds also have their own models if the first `reset` changes `data.model`. Otherwise they share one.
    auxiliary: any of "depth", "ids" and "flow": quantities that an observation contains for each receptor in addition
        to its signal. They are the distance of the surface at the receptor's centre, its geom, and its motion since the
        last observation; see docs/tasks.md. Evolving eyes have none.
    camera: name of the camera for images of the task; None: one that shows the whole model
    actuators: names of the actuators that an action drives; None: all
    name: name of the animal among others; None: the name of the class
    failure_reward: reward of a step in which the world fails, as the term "failure". If rewards are costs, the default
        of 0 is better than any normal episode, so set a value below the cost of an episode.
    mode: "training" or "evaluation", as set when the environment was made; methods may use it
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
    mode: str = "training"

    def __init_subclass__(cls) -> None:
        """Support subclasses that define `proprioception` under its old name, `feels`."""
        super().__init_subclass__()
        if "feels" in vars(cls) and "proprioception" not in vars(cls):
            warn_renamed(f"{cls.__name__}.feels", "proprioception")
            cls.proprioception = vars(cls)["feels"]  # type: ignore[attr-defined]

    def n_actions(self, model: mujoco.MjModel) -> int:
        """Number of values in an action; default: the number of its actuators' controls, which is one for most
        actuators."""
        return len(controls_of(model, self.actuators))

    def place(self, n_eyes: int, placement_range_deg: float, elevation_deg: float) -> Sequence[Mount]:
        """Return the places of an evolving animal's eyes; default: the first of `mounts`, fanned out, see `sim.fan`."""
        assert not isinstance(self.mounts, Mapping)
        return fan(self.mounts[0], n_eyes, placement_range_deg, elevation_deg)


def compiled(task: TaskSettings, model: mujoco.MjModel | None = None) -> mujoco.MjModel:
    """Return the model of a task after checking its other settings; model: the model, if it has already been compiled.

    Raises:
        ValueError: a setting is missing or invalid.
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
        raise ValueError(f"{name}: its model has no actuators: n_actions and act must define an action")
    return model
