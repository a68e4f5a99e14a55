"""Settings that all tasks have, both tasks for one world at a time and tasks for arrays of all worlds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import mujoco

import optics
from optics import TurbidMedium
from optics.elements.turbid_medium import medium_of
from optics.numerics.arguments import did_you_mean, finite, whole
from optics.numerics.renamed import warn_renamed
from optics.spectra.spectrum import Spectrum
from sim.eyes.compound_eye import WorldEye
from sim.eyes.mounts import Mount, fan
from sim.physics.controls import actuator_names, controls_of
from sim.render.fidelity import Fidelity
from sim.scene import source
from sim.tasks.eye_kinds import kinds_of

__all__ = ["MOST_STEPS", "TaskSettings", "compiled"]

MOST_STEPS = 10**9


class TaskSettings:
    """Settings of a task. A subclass sets them as class attributes, and must set `model` and `mounts`.

    Environments raise a ValueError if a setting is missing or invalid.

    model: an MjModel, or a source from which `sim.mirror` can compile one
    eye: optics and retina of every eye, an `optics.Eye`; or a compound eye, a `sim.CompoundEye`
    mounts: places of the eyes, one or more `sim.Mount`. If an animal has several kinds of eyes, `eye` and `mounts` are
        dictionaries, such as {"wide": ..., "sharp": ...}. An observation then has an entry for each kind, such as
        "wide", instead of the single entry "eyes".
    fidelity: rendering fidelity of the eyes, see `sim.ModelRenderer`; "auto": `sim.choose_model_fidelity` chooses it
        from a few scenes of the task's episodes. If an animal has several kinds of eyes, give one fidelity for all of
        them, or a dictionary with a fidelity for each kind.
    substeps: physics steps per action, 1 to 10⁹
    episode_steps: number of actions after which an episode is truncated, 1 to 10⁹
    spectra: spectra that replace the colours of materials and lights, by the name of the material or light
    medium: water or air between surfaces and eyes, see `sim.build_world`
    vary: quantities that vary between episodes: the range (low, high) of each quantity, by the quantity's name. Values
        are drawn for each episode and world before `reset`:
        "light": factor of all lights, with a uniformly distributed logarithm.
        "color_temperature": colour temperature of white [K], with a uniformly distributed reciprocal.
        "GEOM.size": factor of a geom's size, with a uniformly distributed logarithm. MuJoCo's compiler recomputes mass
        and inertia, so `model` must not be an MjModel or an MJB file.
        "GEOM.color": colour of a geom, between the colours low and high. Red, green and blue are each drawn between
        their values in these two colours. The colour multiplies a texture.
        "GEOM.material": names of materials of the model. The geom gets the texture, colour and emission of one of
        them. The geom must not have an rgba of its own.
        "JOINT.start": initial position of a hinge [rad] or a slide [m].
        "BODY.start": initial position of a mocap body or a body with a free joint [m], in the box between two points
        (x, y, z).
        Starting positions are set in the world's data. Sizes, colours and materials are set in `data.model`, and each
        world then has its own copy of the model. Each world also has a copy of the model if the first `reset` changes
        `data.model`. Otherwise all worlds share one model.
    auxiliary: additional entries of an observation, with values for each receptor: any of "depth", "ids" and "flow".
        They describe the surface seen at the centre of the receptor: its depth along the eye's axis [m], the id of its
        geom, and its motion on the retina since the last observation [receptors]; see docs/tasks.md. Runs of `evolve`,
        in which eyes evolve, have no auxiliary entries.
    camera: name of the camera for images of the task; None: a camera that shows the whole model
    actuators: names of the actuators that an action drives; None: all actuators
    name: name of the animal, if a world contains several animals; None: the name of the class
    failure_reward: reward for the last step of an episode that ends because the world cannot continue, for example
        because a method of the task fails. It is the term "failure" among the terms of the reward. If rewards are
        negative costs, the default of 0 is better than any normal episode. In this case, set a value below the return
        of an episode.
    mode: "training", "evaluation" or "test" (an evaluation for final results). The environment sets it, and methods may
        read it; a class must not define it
    """

    model: mujoco.MjModel | mujoco.MjSpec | str | Path
    eye: WorldEye | Mapping[str, WorldEye] = optics.Eye()
    mounts: Sequence[Mount] | Mapping[str, Sequence[Mount]] = ()
    fidelity: Fidelity | str | Mapping[str, Fidelity | str] = "auto"
    substeps: int = 5
    episode_steps: int = 256
    spectra: Mapping[str, Spectrum | str] | None = None
    medium: TurbidMedium | str | None = None
    vary: Mapping[str, tuple[Any, ...]] | None = None
    auxiliary: Sequence[str] = ()
    camera: str | None = None
    actuators: Sequence[str] | None = None
    name: str | None = None
    failure_reward: float = 0.0
    mode: str = "training"

    def __init_subclass__(cls) -> None:
        """Accept a subclass that defines the method `proprioception` under its old name `feels`, with a warning."""
        super().__init_subclass__()
        if "feels" in vars(cls) and "proprioception" not in vars(cls):
            warn_renamed(f"{cls.__name__}.feels", "proprioception")
            cls.proprioception = vars(cls)["feels"]  # type: ignore[attr-defined]

    def n_actions(self, model: mujoco.MjModel) -> int:
        """Return the number of values in an action.

        Unless a subclass overrides this method, it is the number of controls of the task's actuators. Most actuators
        have one control.

        Raises:
            KeyError: the model lacks an actuator of the task.
        """
        return len(controls_of(model, self.actuators))

    def place(self, n_eyes: int, placement_range_deg: float, elevation_deg: float) -> Sequence[Mount]:
        """Return the mounts of the eyes of an evolving animal.

        The default spreads the eyes in a fan around the first of `mounts`, see `sim.fan`. A run with this default
        needs a single mount and a single kind of eyes.

        n_eyes: number of eyes
        placement_range_deg, elevation_deg: angles that evolve [degrees], see `sim.fan`
        """
        assert not isinstance(self.mounts, Mapping)
        return fan(self.mounts[0], n_eyes, placement_range_deg, elevation_deg)


def compiled(task: TaskSettings, model: mujoco.MjModel | None = None) -> mujoco.MjModel:
    """Return the compiled model of a task after checking the task's other settings.

    model: the compiled model; None: compile it

    Raises:
        ValueError: a setting is missing or invalid.
    """
    name = type(task).__name__
    if not hasattr(task, "model"):
        raise ValueError(f"{name}: model: must be set, to an MjModel, a path or MJCF text")
    if type(task).mode != TaskSettings.mode:
        raise ValueError(f"{name}: mode = {type(task).mode!r}: must be left out, the environment sets it")
    kinds_of(task)
    medium_of(f"{name}: medium", task.medium)
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
