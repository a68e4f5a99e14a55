"""A task's world as a MuJoCo model, with the starting positions of agent and objects.

`build_world` compiles a world. This module adds the parts that all worlds have in common. The modules
`sim.worlds.detection`, `.foraging`, `.maze` and `.navigation` add the other parts.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import mujoco
import numpy as np

from optics import TurbidMedium
from optics.elements.turbid_medium import medium_of
from optics.numerics.arguments import did_you_mean, in_range, of_kind, shown, whole
from optics.numerics.read_only import ReadOnlyArrays
from optics.spectra.spectrum import Spectrum
from sim.eyes.eyes import BODY_RADIUS, EYE_HEIGHT, Eyes, camera_rotations, eye_positions
from sim.scene.spectra import resolve
from sim.worlds import detection, foraging, materials, maze, navigation
from sim.worlds.agent_model import AgentModel
from sim.worlds.catalog import TASKS
from sim.worlds.course import Course
from sim.worlds.layout import WALL_CONAFFINITY, WALL_HEIGHT, Layout, Starts, set_wall_height
from sim.worlds.layout_family import TASKS_WITH_LAYOUTS, LayoutSet

MOST_SEED = 2**128  # largest allowed seed; the seeds that NumPy draws have 128 bits
MOST_MAZES = 100_000  # largest allowed number of mazes; fewer already exhaust the memory
# [m] smallest and largest allowed height of walls. Lower walls would end below the top of the agent, and still higher
# walls look the same to its eyes.
WALL_HEIGHTS = (2 * BODY_RADIUS, 100.0)
_FIELDS = {"detection": detection.add_layout, "foraging": foraging.add_layout, "tracking": detection.add_layout}

TIMESTEP = 0.02  # [s], as published
# Time constant [s] of the agent's speed, and ratio of the final speed to the commanded speed. With these values the
# agent moves as far in an action as in the published environment (tests/sim/worlds/test_world.py).
TIME_CONSTANT, SPEED_GAIN = 0.35, 0.99
MAX_SPEED = 10.0  # [m/s] commanded, as published

# The agent can move MAX_SPEED * TIMESTEP = 0.2 m in one substep. Its whiskers touch a wall at this distance from the
# skin. The skin, and the eyes in it, therefore never pass through a wall. `_add_agent` sets the contact's stiffness.
WHISKER_LENGTH = MAX_SPEED * TIMESTEP  # [m]


@dataclass(frozen=True)
class World(ReadOnlyArrays):
    """A compiled world.

    task: name of the task, one of `sim.TASKS`
    model: MuJoCo model. It contains static geoms and mocap bodies for the objects. The body "agent" has the slide
        joints agent_x and agent_y and the hinge agent_heading. The actuators agent_x and agent_y command its velocity
        [m/s] along the world's axes. The sensor agent_touch is above 0 in contact with a wall. If the world was built
        with eyes, the agent has a camera for each eye, with the name that `Eyes.names()` returns
    objects: names of the objects' bodies: ("goal", "adversary_0", "adversary_1"), or () in navigation and mazes
    starts: starting positions of the agent, at the centres of cells (`sim.worlds.layout.Starts`)
    object_spawn: possible positions of objects, at the centres of cells [m], (n, 2)
    goal_region: goal region in navigation and mazes, (x_min, y_min, x_max, y_max) [m]; None in other tasks
    spectra: measured spectra of materials and lights, by name. Renderers use them instead of the model's colours
    alone: small model of the agent, to which only the few walls near the agent are added, for a faster simulation of
        contacts; None: agents near walls are simulated in the whole model
    training_starts: starting positions of the agent in training; None: `starts`
    episode_steps: number of actions after which an episode is truncated; None: the task's default
    mazes: number of mazes or courses, which are arranged from south to north; 1 in other tasks
    medium: water or air that fills the world; None: clear air
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
    medium: TurbidMedium | None = None

    @property
    def agent_spawn(self) -> np.ndarray:
        """All positions at which the agent may start in training, in evaluation or in both [m], (n, 2)."""
        if self.training_starts is None:
            return self.starts.position
        return np.unique(np.concatenate([self.starts.position, self.training_starts.position]), axis=0)


def build_world(
    task: str,
    *,
    seed: int = 0,
    mazes: int = 1,
    course: str | Course = "short",
    layouts: LayoutSet | None = None,
    wall_height: float = WALL_HEIGHT,
    eyes: Eyes | None = None,
    spectra: Mapping[str, Spectrum | str] | None = None,
    medium: TurbidMedium | str | None = None,
) -> World:
    """Build the world of a task.

    task: one of `sim.TASKS`
    seed: seed of the mazes and of the stripes on walls in mazes and courses, 0 to 2¹²⁸; the worlds of other tasks do
        not depend on it
    mazes: number of mazes in the task "maze", 1 to 100,000; each episode starts in one of them
    course: course of navigation: "short", "long" (twice as long, with half as many actions) or a `sim.Course`
    layouts: one set of a `sim.LayoutFamily` for navigation or mazes, instead of `seed`, `mazes` and `course`; each
        episode starts in one of its layouts
    wall_height: height of all walls [m], in [0.4, 100]. In the code published by Tiwary, Young et al. (*Science
        Advances* 11(51), 2025), walls are 0.5 m high
    eyes: eyes for which the agent gets cameras, with the names of `Eyes.names()`; None: no cameras
    spectra: spectra of materials and lights, by name ("wall", "floor", "light_0" ...). They add to the spectra that the
        task defines, or replace them. Each is an `optics.Spectrum`, or a name that `optics.reflectance` or
        `optics.illuminant` accepts.
    medium: water or air between surfaces and eyes: an `optics.TurbidMedium`, or a name ("air", "clear_ocean",
        "coastal_water" or "fog", see `optics.turbid_medium`). Under water, eyes are immersed (`optics.immersed`). None
        or "air": clear air

    Raises:
        ValueError: an argument has the wrong type or is out of range; the task, the course, the medium or a spectrum is
            unknown; or `spectra` names neither a material nor a light, or has a reflectance above 1. `mazes`, `course`
            or `layouts` is given for a task that does not use it; or `layouts` is combined with `seed`, `mazes` or
            `course`. Two layouts of the `sim.LayoutFamily` that contains `layouts` are equal, or no random course with
            its numbers of rows and columns was found.
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
    short = isinstance(course, str) and course == "short"
    if task != "navigation" and not short:
        raise ValueError(f"build_world: course: must be left out for {shown(task)}, only 'navigation' has one")
    wall_height = in_range("build_world: wall_height", wall_height, *WALL_HEIGHTS)
    spec = _empty_world()
    if layouts is None:
        layout = _layout(spec, task, np.random.default_rng(seed), mazes, course)
    else:
        _check_layouts(task, layouts, alone=seed == 0 and mazes == 1 and short)
        layout, mazes = _family_layout(spec, task, layouts), len(layouts)
    if wall_height != WALL_HEIGHT:
        set_wall_height(spec, wall_height)
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
        alone=AgentModel.from_spec(spec, model),
        training_starts=layout.training_starts,
        episode_steps=layout.episode_steps,
        mazes=mazes,
        medium=medium_of("build_world: medium", medium),
    )


def _layout(spec: mujoco.MjSpec, task: str, rng: np.random.Generator, mazes: int, course: str | Course) -> Layout:
    if task == "navigation":
        return navigation.add_layout(spec, [navigation.course_named(course)], [rng])
    if task == "maze":
        return maze.add_layout(spec, [maze.draw_maze(maze.MAZE, rng) for _ in range(mazes)], [rng])
    return _FIELDS[task](spec, rng)


def _check_layouts(task: str, layouts: Any, alone: bool) -> None:
    """Check the type of `layouts`, that the task has layouts, and that `layouts` is not combined with other arguments.

    alone: True if the arguments `seed`, `mazes` and `course` of `build_world`, which `layouts` replaces, have their
        default values

    Raises:
        ValueError: a check fails, or `alone` is False.
    """
    of_kind("build_world: layouts", layouts, LayoutSet, "sim.LayoutFamily(seed=0).training")
    if task not in TASKS_WITH_LAYOUTS:
        tasks = " and ".join(map(repr, TASKS_WITH_LAYOUTS))
        raise ValueError(f"build_world: layouts: must be left out for {shown(task)}, only {tasks} have layouts")
    if not alone:
        raise ValueError("build_world: layouts: seed, mazes and course must be left out, a family replaces them")


def _family_layout(spec: mujoco.MjSpec, task: str, layouts: LayoutSet) -> Layout:
    if task == "navigation":
        layout = navigation.add_layout(spec, layouts.courses, layouts.stripes())
    else:
        layout = maze.add_layout(spec, layouts.mazes, layouts.stripes())
    return replace(layout, episode_steps=layouts.family.episode_steps)


def _empty_world() -> mujoco.MjSpec:
    spec = mujoco.MjSpec()
    spec.modelname = "rhabdom"
    spec.option.timestep = TIMESTEP
    spec.option.gravity = [0, 0, 0]  # the agent moves in a plane
    # The dense solver is used because MuJoCo 4.0.0 computes a wrong sparse Newton Hessian (fixed in 4.0.1).
    spec.option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    spec.visual.map.znear = 1e-4
    materials.add_daylight(spec)
    materials.add_plain(spec, "floor", materials.FLOOR)
    materials.add_plain(spec, "wall", materials.GREY)
    materials.add_plain(spec, "agent", materials.BODY)
    return spec


def _add_agent(spec: mujoco.MjSpec, start: np.ndarray, eyes: Eyes | None) -> None:
    """Add the agent at `start` (x, y) [m], with slide joints along the world's axes and a hinge for the heading.

    The hinge has no actuator; the simulation sets the heading. The contact is frictionless. Its damping and stiffness
    are chosen for discrete substeps of length dt. The damping 1/dt stops the approach in the substep in which the
    agent touches a wall. The stiffness 0.2/dt² reduces the penetration by one fifth per substep, without a bounce.
    """
    body = spec.worldbody.add_body(name="agent", pos=[float(start[0]), float(start[1]), EYE_HEIGHT])
    slide, hinge = mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE
    # Because of `ref`, qpos is the position in the world, and qpos0 is the starting position.
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
    """Add a servo that moves a body of 1 kg with a first-order lag.

    Its speed v follows the command: dv/dt = (0.99 command - v) / 0.35 s.
    """
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
    places = zip(eyes.names(), eye_positions(azimuths), camera_rotations(azimuths), strict=True)
    for name, position, rotation in places:
        quat = np.empty(4)
        mujoco.mju_mat2Quat(quat, rotation.ravel())
        body.add_camera(name=name, pos=position.tolist(), quat=quat.tolist(), fovy=eyes.fovy_deg)
