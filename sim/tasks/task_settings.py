"""What every task says about itself, whether it is written for one world at a time or for arrays of all worlds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import mujoco

import optics
from optics.numerics.arguments import did_you_mean, finite, whole
from optics.spectra.spectrum import Spectrum
from sim.eyes.mounts import Mount, fan
from sim.physics.controls import actuator_names, controls_of
from sim.render.fidelity import Fidelity
from sim.scene import source
from sim.tasks.eye_kinds import kinds_of

__all__ = ["MOST_STEPS", "TaskSettings", "compiled"]

MOST_STEPS = 10**9


class TaskSettings:
    """What a subclass says about itself; only `model` and `mounts` have no default.

    model: an MjModel, or what compiles to one (`sim.mirror`)
    eye: optics and retina of every eye · mounts: where the eyes are; of several kinds of eyes both are dictionaries,
        such as {"wide": ..., "sharp": ...}, and an observation has an array for each kind in the place of "eyes"
    fidelity: how finely they see, see `sim.ModelRenderer`; "auto": as a few moments of its episodes want, see
        `sim.choose_model_fidelity`; of several kinds alike, or a dictionary, too
    substeps: of physics in one action · episode_steps: actions, then an episode is truncated
    spectra: of materials and lights, by name, in the place of their colours
    vary: what is drawn for each episode and world, as (low, high) by name, before `reset`:
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
    mode: "training" or "evaluation", as the environment was made; methods may use it
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

    def n_actions(self, model: mujoco.MjModel) -> int:
        """Numbers in an action; here: as many controls as its actuators take, which is one each of most kinds."""
        return len(controls_of(model, self.actuators))

    def place(self, n_eyes: int, placement_range_deg: float, elevation_deg: float) -> Sequence[Mount]:
        """Where an evolving animal has its eyes; here: the first of `mounts`, fanned out, see `sim.fan`."""
        assert not isinstance(self.mounts, Mapping)
        return fan(self.mounts[0], n_eyes, placement_range_deg, elevation_deg)


def compiled(task: TaskSettings, model: mujoco.MjModel | None = None) -> mujoco.MjModel:
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
