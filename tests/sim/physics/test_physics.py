"""The batched step against the servo's closed form and steps of a single MjData, at walls and in unstable worlds."""

import copy
import dataclasses

import mujoco
import numpy as np
import pytest

from sim.physics import agent_motion
from sim.physics.agent_motion import AgentPhysics
from sim.physics.sliding_agents import SlidingAgents
from sim.tasks.registry import task_of
from sim.tasks.simulation import Simulation
from sim.worlds.catalog import SUBSTEPS
from sim.worlds.world import SPEED_GAIN, TIME_CONSTANT, build_world


@pytest.fixture(scope="module")
def world():
    return build_world("detection")


def begun(world, n, seed=0):
    return Simulation(task_of(world), n, seed).reset()


def test_speed_follows_the_servos_closed_form(world):
    """The servo follows dv/dt = (gain ctrl - v)/τ. The explicit-implicit scheme is of first order, with an error of
    about dt/τ/2 = 3 %.
    """
    state = dataclasses.replace(begun(world, 1), position=np.zeros((1, 2)))
    motion = AgentPhysics(world, 1).step(state, np.array([[10.0, 0.0]]))
    t = SUBSTEPS * world.model.opt.timestep
    expected = SPEED_GAIN * 10.0 * (1 - np.exp(-t / TIME_CONSTANT))
    assert motion.velocity[0, 0] == pytest.approx(expected, rel=0.04)
    assert motion.velocity[0, 1] == pytest.approx(0.0, abs=1e-9)


def test_batch_equals_single_data(world):
    state = begun(world, 5, seed=3)
    command = np.random.default_rng(1).uniform(-10, 10, (5, 2))
    motion = AgentPhysics(world, 2).step(state, command)
    for i in range(5):
        data = mujoco.MjData(world.model)
        data.qpos[:3] = [*state.position[i], state.heading[i]]
        for substep in range(SUBSTEPS):
            data.ctrl[:2] = command[i]
            data.qacc_warmstart[:] = 0 if substep == 0 else data.qacc_warmstart
            mujoco.mj_step(world.model, data)
            np.testing.assert_allclose(motion.path[i, substep], data.qpos[:2], atol=1e-9)


@pytest.mark.parametrize("task", ["detection", "navigation"])
def test_free_motion_is_what_mujoco_does(task):
    """The closed form agrees with MuJoCo near walls and away from them, up to rounding: 1e-12 m on metres over ten
    substeps.
    """
    world = build_world(task)
    moving, simulating = AgentPhysics(world, 1), AgentPhysics(world, 1, closed_form=False)
    simulation = Simulation(task_of(world), 32, 0)
    simulation.reset()
    rng = np.random.default_rng(0)
    free = 0
    for _ in range(40):
        state, command = simulation.state, rng.uniform(-10, 10, (32, 2))
        ours, mujocos = moving.step(state, command), simulating.step(state, command)
        np.testing.assert_allclose(ours.path, mujocos.path, rtol=0, atol=1e-12)
        np.testing.assert_allclose(ours.velocity, mujocos.velocity, rtol=0, atol=1e-11)
        np.testing.assert_array_equal(ours.contact, mujocos.contact)
        path, _ = moving.free_motion(state.velocity, command)
        free += (~moving.free_motion.obstacles_in_reach(state.position, path).any(axis=1)).sum()
        simulation.step(rng.uniform(-1, 1, (32, 2)))
    assert free > 50  # enough agents to compare


@pytest.mark.parametrize("task", ["detection", "navigation"])
def test_what_physics_leaves_out_changes_no_bit(task, monkeypatch):
    """Physics uses no constraint islands, and no bounding volumes in small models. Agents at walls and in corners move
    as in full MuJoCo.
    """
    world = build_world(task)
    lean = AgentPhysics(world, 1, closed_form=False)
    assert lean._model.opt.disableflags != world.model.opt.disableflags
    monkeypatch.setattr(agent_motion, "_without_detours", copy.copy)
    whole = AgentPhysics(world, 1, closed_form=False)
    assert whole._model.opt.disableflags == world.model.opt.disableflags
    simulation = Simulation(task_of(world), 32, 0)
    simulation.reset()
    rng, touched = np.random.default_rng(0), 0
    for _ in range(40):
        state, command = simulation.state, rng.uniform(-10, 10, (32, 2))
        ours, mujocos = lean.step(state, command), whole.step(state, command)
        for name, array in vars(ours).items():
            np.testing.assert_array_equal(array, getattr(mujocos, name), err_msg=name)
        touched += int(ours.contact.sum())
        simulation.step(np.concatenate([np.ones((32, 1)), rng.uniform(-1, 1, (32, 1))], axis=1))
    assert touched > 50


def test_an_agent_that_moves_freely_through_a_wall_would_be_noticed(world):
    """Without the walls, free motion departs from MuJoCo. This proves that the test above can fail."""
    physics = AgentPhysics(world, 1)
    physics.free_motion = dataclasses.replace(physics.free_motion, lower=np.empty((0, 2)), upper=np.empty((0, 2)))
    state = dataclasses.replace(begun(world, 1), position=np.array([[10.5, 0.0]]), velocity=np.array([[9.0, 0.0]]))
    command = np.array([[10.0, 0.0]])
    apart = physics.step(state, command).path - AgentPhysics(world, 1).step(state, command).path
    assert np.abs(apart).max() > 0.1


@pytest.mark.parametrize(
    ("field", "linear"), [("dof_damping", True), ("dof_frictionloss", False), ("jnt_stiffness", False)]
)
def test_models_move_in_closed_form_as_far_as_they_are_linear(field, linear):
    """The force of a spring depends on position, and dry friction on direction: MuJoCo steps such agents. Small models
    that were compiled before the change are not used.
    """
    world = build_world("detection")
    getattr(world.model, field)[0] = 0.3
    world.model.qpos_spring[:] = world.model.qpos0  # at rest at the agent's start only
    assert (AgentPhysics(world, 1).free_motion is not None) == linear
    assert AgentPhysics(world, 1).local_contacts is None
    state = dataclasses.replace(begun(world, 4), position=np.array([[3.0, 1.0]] * 4))
    command = np.random.default_rng(0).uniform(-10, 10, (4, 2))
    ours, mujocos = (AgentPhysics(world, 1, closed_form).step(state, command) for closed_form in (True, False))
    np.testing.assert_allclose(ours.path, mujocos.path, rtol=0, atol=1e-12)


def test_walls_hold_and_are_felt(world):
    state = begun(world, 1)
    physics = AgentPhysics(world, 1)
    contacts = []
    for _ in range(20):
        motion = physics.step(state, np.array([[10.0, 0.0]]))
        contacts.append(bool(motion.contact[0]))
        state = dataclasses.replace(state, position=motion.path[:, -1], velocity=motion.velocity)
    assert contacts[-1]
    assert not motion.unstable[0]
    assert state.position[0, 0] < 11.0  # the wall's face is at 11 m (11 cells of 2 m)


def test_one_broken_world_is_named_and_the_others_go_on(world):
    state = begun(world, 4)
    velocity = state.velocity.copy()
    velocity[2, 0] = np.nan
    motion = AgentPhysics(world, 2).step(dataclasses.replace(state, velocity=velocity), np.full((4, 2), 3.0))
    assert motion.unstable.tolist() == [False, False, True, False]
    assert np.isfinite(motion.path).all()
    whole = AgentPhysics(world, 2).step(state, np.full((4, 2), 3.0))
    others = [0, 1, 3]
    np.testing.assert_array_equal(motion.path[others], whole.path[others])


def test_a_broken_world_ends_its_episode_with_a_reason(world):
    simulation = Simulation(task_of(world), 3, 0)
    state = simulation.reset()
    velocity = state.velocity.copy()
    velocity[1] = 1e12
    simulation.state = dataclasses.replace(state, velocity=velocity)
    step = simulation.step(np.zeros((3, 2)))
    assert step.failure == {1: "unstable physics"}
    assert step.terminated.tolist() == [False, True, False]
    assert np.isfinite(step.reward).all()


def test_a_step_without_objects_is_refused(world):
    agents = SlidingAgents(world, 1)
    agents.place(np.array([0]), world.starts.position[:1], np.zeros(1), np.zeros((1, 3, 2)), np.zeros((1, 3)))
    with pytest.raises(RuntimeError, match="the objects have no positions after the step: call move_objects first"):
        agents.step(())


def test_objects_that_collide_are_refused(world):
    spec = mujoco.MjSpec.from_string(
        """<mujoco><worldbody><body name="agent"><joint name="agent_x" type="slide" axis="1 0 0"/>
        <joint name="agent_y" type="slide" axis="0 1 0"/><joint name="agent_heading" axis="0 0 1"/><geom size=".2"/>
        <site name="s" size=".3"/></body><body name="goal" mocap="true"><geom size=".5"/></body></worldbody>
        <actuator><velocity joint="agent_x"/><velocity joint="agent_y"/></actuator>
        <sensor><touch site="s"/></sensor></mujoco>"""
    )
    with pytest.raises(ValueError, match="'goal' can collide"):
        AgentPhysics(dataclasses.replace(world, model=spec.compile(), objects=("goal",)), 1)


@pytest.mark.parametrize(("speed", "broken"), [(50.0, False), (400.0, True)])
def test_what_no_actuator_can_do_is_a_breakdown(world, speed, broken):
    """Motors drive agents at up to 10 m/s. A speed ten times as high that still rises cannot come from a motor."""
    state = dataclasses.replace(begun(world, 1), position=np.zeros((1, 2)), velocity=np.array([[0.0, speed]]))
    command = np.array([[0.0, 10.0]])
    motion = AgentPhysics(world, 1, closed_form=False).step(state, command)
    assert motion.unstable.tolist() == [broken]
    assert (np.abs(motion.velocity) < 100).all()


def test_a_world_that_broke_down_touches_nothing(world):
    """Whatever the sensors report, the agent stays at its previous position and pays for no contact."""
    physics = AgentPhysics(world, 1, closed_form=False)
    state = dataclasses.replace(begun(world, 2), position=np.zeros((2, 2)))
    states, sensors = physics._step_batch([physics._model] * 2, *physics._start_of(state, np.full((2, 2), 3.0)))
    sensors[:] = 1.0
    states[1, -1, physics._columns.velocity] = 1e4
    motion = physics._motion(state.position, states, sensors)
    assert motion.unstable.tolist() == [False, True]
    assert motion.contact.tolist() == [True, False]
