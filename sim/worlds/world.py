"""A task's world: what stands where, as a MuJoCo model, and where agent and objects may start.

`build_world` compiles one. What all worlds have in common is added here; what is special about one is in
`sim.worlds.detection`, `.foraging`, `.maze` and `.navigation`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import mujoco
import numpy as np

from optics.numerics.arguments import did_you_mean, of_kind, shown, whole
from optics.spectra.spectrum import Spectrum
from sim.eyes.eyes import BODY_RADIUS, EYE_HEIGHT, Eyes, camera_rotations, eye_positions
from sim.scene.spectra import resolve
from sim.worlds import detection, foraging, materials, maze, navigation
from sim.worlds.agent_model import AgentModel
from sim.worlds.catalog import TASKS
from sim.worlds.course import Course
from sim.worlds.layout import WALL_CONAFFINITY, Layout, Starts

MOST_SEED = 2**128  # choice: what NumPy draws for a seed
MOST_MAZES = 100_000  # choice: more than memory holds
_FIELDS = {"detection": detection.add_layout, "foraging": foraging.add_layout, "tracking": detection.add_layout}

TIMESTEP = 0.02  # [s], as published
# Lag [s] of the agent's speed behind the commanded one, and speed reached per speed commanded: with them an agent goes
# as far per action as in the published environment (tests/sim/worlds/test_world.py).
TIME_CONSTANT, SPEED_GAIN = 0.35, 0.99
MAX_SPEED = 10.0  # [m/s] commanded, as published

# The agent can move MAX_SPEED * TIMESTEP = 0.2 m in one substep. Its whiskers feel a wall that near, so that the
# skin, and the eyes in it, never pass through a wall. See `_add_agent` for the contact's stiffness.
WHISKER_LENGTH = MAX_SPEED * TIMESTEP  # [m]


@dataclass(frozen=True)
class World:
    """A compiled world.

    model: static geoms; body "agent" with slide joints agent_x, agent_y and hinge agent_heading, actuators agent_x,
        agent_y (commanded velocity [m/s], world axes), sensor agent_touch (> 0: wall contact); mocap bodies for the
        objects; cameras eye_0 ... on the agent if it was built with eyes
    objects: mocap sphere bodies: ("goal", "adversary_0", "adversary_1"), or () for navigation and maze
    starts: of the agent, in cells' centres;  object_spawn: cells' centres (m, 2) [m]
    goal_region: navigation and maze: (x_min, y_min, x_max, y_max) [m]
    spectra: measured spectra of materials and lights, by name: what the renderers use instead of their colours
    alone: the model's agent by itself; without, agents that may touch something are stepped in the whole model
    training_starts: of the agent in training; None: the same
    episode_steps: actions, then an episode is truncated; None: as many as everywhere
    mazes: that lie north of each other; 1 in tasks without mazes
    """

    task: str
    model: mujoco.MjModel
    objects: tuple[str, ...]
    starts: Starts
    object_spawn: np.ndarray
    goal_region: np.ndarray | None
    spectra: Mapping[str, Spectrum] = field(default_factory=dict)
    alone: AgentModel | None = None
    training_starts: Starts | None = None
    episode_steps: int | None = None
    mazes: int = 1

    @property
    def agent_spawn(self) -> np.ndarray:
        """All places in which an agent may start, (n, 2) [m]."""
        if self.training_starts is None:
            return self.starts.position
        return np.unique(np.concatenate([self.starts.position, self.training_starts.position]), axis=0)


def build_world(
    task: str,
    *,
    seed: int = 0,
    mazes: int = 1,
    course: str | Course = "short",
    eyes: Eyes | None = None,
    spectra: Mapping[str, Spectrum | str] | None = None,
) -> World:
    """Build the world of a task.

    task: one of `sim.TASKS`
    seed: draws mazes, and the stripes of walls; the field of the other tasks is always the same
    mazes: of the task "maze": so many different ones, and an episode begins in any of them
    course: of navigation: "short", "long" (twice as long, in half as many actions) or a `sim.Course`
    eyes: if given, the agent carries cameras eye_0 ..., left to right
    spectra: of materials and lights, by name ("wall", "floor", "light_0" ...), in addition to or instead of the task's
        own: `optics.Spectrum`, or names out of `optics.reflectance` and `optics.illuminant`

    Raises:
        ValueError: an unknown task or course, a negative seed, mazes or a course for another task, or spectra of what
            is not there.
    """
    if not isinstance(task, str) or task not in TASKS:
        raise ValueError(f"unknown task {shown(task)}: must be one of {', '.join(TASKS)}{did_you_mean(task, TASKS)}")
    seed = whole("build_world: seed", seed, 0, MOST_SEED)
    mazes = whole("build_world: mazes", mazes, 1, MOST_MAZES)
    if task != "maze" and mazes != 1:
        raise ValueError(f"build_world: mazes = {mazes}: must be 1, or more for 'maze'")
    if eyes is not None:
        of_kind("build_world: eyes", eyes, Eyes, "sim.Eyes(n_eyes=2)")
    if spectra is not None:
        of_kind("build_world: spectra", spectra, Mapping, "{'wall': 'foliage'}")
    if task != "navigation" and not (isinstance(course, str) and course == "short"):
        raise ValueError(f"build_world: course: must be left out for {shown(task)}, only 'navigation' has one")
    spec = _empty_world()
    layout = _layout(spec, task, np.random.default_rng(seed), mazes, course)
    _add_agent(spec, layout.starts.position[0], eyes)
    model = spec.compile()
    return World(
        task=task,
        model=model,
        objects=layout.objects,
        starts=layout.starts,
        object_spawn=layout.object_spawn,
        goal_region=layout.goal_region,
        spectra=resolve(model, {**layout.spectra, **(spectra or {})}),
        alone=AgentModel.of(spec, model),
        training_starts=layout.training_starts,
        episode_steps=layout.episode_steps,
        mazes=mazes,
    )


def _layout(spec: mujoco.MjSpec, task: str, rng: np.random.Generator, mazes: int, course: str | Course) -> Layout:
    if task == "navigation":
        return navigation.add_layout(spec, rng, navigation.course_named(course))
    return maze.add_layout(spec, rng, mazes) if task == "maze" else _FIELDS[task](spec, rng)


def _empty_world() -> mujoco.MjSpec:
    spec = mujoco.MjSpec()
    spec.modelname = "rhabdom"
    spec.option.timestep = TIMESTEP
    spec.option.gravity = [0, 0, 0]  # the agent moves in a plane
    # MuJoCo 4.0.0's sparse Newton Hessian is wrong (mended in 4.0.1).
    spec.option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    spec.visual.map.znear = 1e-4
    materials.add_daylight(spec)
    materials.add_plain(spec, "floor", materials.FLOOR)
    materials.add_plain(spec, "wall", materials.GREY)
    materials.add_plain(spec, "agent", materials.BODY)
    return spec


def _add_agent(spec: mujoco.MjSpec, start: np.ndarray, eyes: Eyes | None) -> None:
    """Add the agent: slide joints in world axes, then the heading (set by the simulation, no actuator turns it).

    The contact is frictionless, and stiff in a discrete sense: damping 1/dt stops the approach within the substep
    in which the wall is felt, stiffness 0.2/dt² pushes back a fifth of the depth per substep, without a bounce.
    """
    body = spec.worldbody.add_body(name="agent", pos=[float(start[0]), float(start[1]), EYE_HEIGHT])
    slide, hinge = mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE
    # With ref, qpos is the position in the world, and qpos0 is the start.
    body.add_joint(name="agent_x", type=slide, axis=[1, 0, 0], ref=float(start[0]))
    body.add_joint(name="agent_y", type=slide, axis=[0, 1, 0], ref=float(start[1]))
    body.add_joint(name="agent_heading", type=hinge, axis=[0, 0, 1])
    body.add_geom(
        name="agent",
        type=mujoco.mjtGeom.mjGEOM_SPHERE,
        size=[BODY_RADIUS, 0, 0],
        material="agent",
        mass=1.0,
        contype=WALL_CONAFFINITY,
        conaffinity=0,
        condim=1,
        priority=1,
        margin=WHISKER_LENGTH,
        solref=[-0.2 / TIMESTEP**2, -1 / TIMESTEP],
        solimp=[0.99, 0.99, 0.001, 0.5, 2],
    )
    body.add_site(
        name="agent_skin", type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[2 * (BODY_RADIUS + WHISKER_LENGTH), 0, 0], group=4
    )
    spec.add_sensor(
        name="agent_touch",
        type=mujoco.mjtSensor.mjSENS_TOUCH,
        objtype=mujoco.mjtObj.mjOBJ_SITE,
        objname="agent_skin",
    )
    for axis in ("agent_x", "agent_y"):
        _add_velocity_servo(spec, axis)
    if eyes is not None:
        _add_eye_cameras(body, eyes)


def _add_velocity_servo(spec: mujoco.MjSpec, joint: str) -> None:
    """First-order lag, dv/dt = (SPEED_GAIN ctrl - v) / TIME_CONSTANT, for a body of 1 kg."""
    spec.add_actuator(
        name=joint,
        target=joint,
        trntype=mujoco.mjtTrn.mjTRN_JOINT,
        gaintype=mujoco.mjtGain.mjGAIN_FIXED,
        gainprm=[SPEED_GAIN / TIME_CONSTANT] + [0] * 9,
        biastype=mujoco.mjtBias.mjBIAS_AFFINE,
        biasprm=[0, 0, -1 / TIME_CONSTANT] + [0] * 7,
        ctrllimited=True,
        ctrlrange=[-MAX_SPEED, MAX_SPEED],
    )


def _add_eye_cameras(body: mujoco.MjsBody, eyes: Eyes) -> None:
    azimuths = eyes.azimuths()
    for i, (position, rotation) in enumerate(zip(eye_positions(azimuths), camera_rotations(azimuths), strict=True)):
        quat = np.empty(4)
        mujoco.mju_mat2Quat(quat, rotation.ravel())
        body.add_camera(name=f"eye_{i}", pos=position.tolist(), quat=quat.tolist(), fovy=eyes.fov_vertical_deg())
