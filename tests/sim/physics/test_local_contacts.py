"""Physics with few geoms, in threads, and without MuJoCo's timers gives the same results."""

import dataclasses
import threading

import mujoco
import numpy as np
import pytest

from sim.physics import mujoco_batch
from sim.physics.agent_motion import AgentPhysics
from sim.physics.local_contacts import LocalContacts
from sim.physics.mujoco_batch import POOLED
from sim.tasks.registry import task_of
from sim.tasks.simulation import Simulation
from sim.worlds.agent_model import AgentModel
from sim.worlds.catalog import SUBSTEPS
from sim.worlds.world import _add_agent, _empty_world, build_world


@pytest.fixture(scope="module")
def world():
    return build_world("detection")


def begun(world, n, seed=0):
    return Simulation(task_of(world), n, seed).reset()


def begun_at_walls(world, n):
    """Return a state and commands of worlds whose agents have moved at walls and in corners for some time."""
    simulation = Simulation(task_of(world), n, 0)
    simulation.reset()
    rng = np.random.default_rng(0)
    for _ in range(40):
        simulation.step(np.concatenate([np.ones((n, 1)), rng.uniform(-1, 1, (n, 1))], axis=1))
    return simulation.state, rng.uniform(-10, 10, (n, 2))


def assert_same_bits(ours, theirs):
    for name, array in vars(ours).items():
        np.testing.assert_array_equal(array, getattr(theirs, name), err_msg=name)


@pytest.fixture
def redone(monkeypatch):
    """Return a list of the number of agents that each call stepped in the whole world."""
    counts = []
    simulate = AgentPhysics._simulate

    def noted(self, agents, velocity):
        counts.append(len(velocity))
        return simulate(self, agents, velocity)

    monkeypatch.setattr(AgentPhysics, "_simulate", noted)
    return counts


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("task", ["detection", "foraging", "maze", "navigation", "tracking"])
def test_agents_among_a_few_geoms_do_what_they_do_among_all(task, threads, redone):
    """The results are the same bit for bit. Only few agents are stepped again, and the number of agents is large enough
    for threads.
    """
    world = build_world(task)
    state, command = begun_at_walls(world, 2 * POOLED)
    few, all_of_them = AgentPhysics(world, threads), AgentPhysics(world, 1)
    all_of_them.local_contacts = None
    redone.clear()
    ours = few.step(state, command)
    assert sum(redone) < 5
    assert (few.local_contacts._step._pool is None) == (threads == 1)
    assert_same_bits(ours, all_of_them.step(state, command))
    assert ours.contact.sum() > 100
    assert len(few.local_contacts._models) > 4  # different walls and corners


def test_agents_among_too_many_geoms_are_stepped_in_the_whole_world(redone):
    world = build_world("maze")
    state, command = begun_at_walls(world, 64)
    cramped = AgentPhysics(world, 1)
    cramped.local_contacts._slots = cramped.local_contacts._slots[:1]
    redone.clear()
    ours = cramped.step(state, command)
    assert 0 < sum(redone) < 64  # agents in corners
    assert_same_bits(ours, AgentPhysics(world, 1).step(state, command))


@pytest.mark.parametrize("noticed", [True, False])
def test_agents_that_stray_to_what_their_models_lack_are_done_again(monkeypatch, noticed):
    """Here the small models contain no geom, so that every agent at a wall must be stepped again. If this is not
    detected, agents pass through walls.
    """
    world = build_world("maze")
    state, command = begun_at_walls(world, 64)
    without_room = AgentPhysics(world, 1)
    without_room.local_contacts._slots = without_room.local_contacts._slots[:0]
    if not noticed:
        monkeypatch.setattr(LocalContacts, "strayed", lambda _, position, path, few: np.zeros(len(few), bool))
    ours, theirs = without_room.step(state, command), AgentPhysics(world, 1, closed_form=False).step(state, command)
    assert (np.abs(ours.path - theirs.path).max() < 1e-12) == noticed
    assert np.array_equal(ours.contact, theirs.contact) == noticed


def test_an_agent_that_breaks_down_at_a_wall_is_what_the_whole_world_makes_of_it():
    world = build_world("maze")
    state, command = begun_at_walls(world, 64)
    touching = np.flatnonzero(AgentPhysics(world, 1).step(state, command).contact)
    velocity = state.velocity.copy()
    velocity[touching[::2]] = [[1e9, -1e9]]
    state = dataclasses.replace(state, velocity=velocity)
    ours, theirs = (AgentPhysics(world, 1, closed_form).step(state, command) for closed_form in (True, False))
    assert theirs.unstable.sum() == len(touching[::2])
    np.testing.assert_array_equal(ours.unstable, theirs.unstable)
    np.testing.assert_allclose(ours.path, theirs.path, rtol=0, atol=1e-12)


@pytest.mark.parametrize("change", ["opt.iterations", "opt.timestep", "geom_conaffinity", "geom_friction", "body_mass"])
def test_a_model_that_was_altered_has_no_parts(change):
    """A change of any number of the model makes agents at walls step in the whole model."""
    world = build_world("maze")
    assert AgentPhysics(world, 1).local_contacts is not None
    if change.startswith("opt."):
        was = getattr(world.model.opt, change[4:])
        setattr(world.model.opt, change[4:], type(was)(was / 2))
    else:
        getattr(world.model, change)[1] += 1
    assert AgentPhysics(world, 1).local_contacts is None


def test_a_world_with_nothing_to_touch_is_crossed_in_closed_form():
    """An unbounded world without geoms is valid."""
    field, spec = build_world("detection"), _empty_world()
    _add_agent(spec, np.zeros(2), None)
    model = spec.compile()
    world = dataclasses.replace(field, model=model, objects=(), alone=AgentModel.from_spec(spec, model))
    state = begun(field, 4)
    motion = AgentPhysics(world, 1).step(state, np.full((4, 2), 3.0))
    assert not motion.contact.any()
    np.testing.assert_array_less(state.position, motion.path[:, -1])


def test_threads_change_nothing(world):
    state, command = begun_at_walls(world, POOLED)
    one, two = (AgentPhysics(world, threads, closed_form=False) for threads in (1, 2))
    assert_same_bits(one.step(state, command), two.step(state, command))
    assert two._step_batch._pool is not None


def test_fewer_worlds_than_are_worth_it_start_no_threads(world):
    state, command = begun_at_walls(world, POOLED - 1)
    physics = AgentPhysics(world, 2, closed_form=False)
    physics.step(state, command)
    assert physics._step_batch._pool is None


def test_mujocos_clock_outlives_physics_in_two_threads(world):
    """Each thread saves and restores MuJoCo's clock; with a race, the process would lose it."""
    state, command = begun(world, 64), np.zeros((64, 2))
    stepping = [
        threading.Thread(target=step_often, args=(AgentPhysics(world, 1, closed_form=False), state, command))
        for _ in "12"
    ]
    before = mujoco_batch._clock().value
    for thread in stepping:
        thread.start()
    for thread in stepping:
        thread.join()
    assert before is not None
    assert mujoco_batch._clock().value == before


def step_often(physics, state, command):
    for _ in range(60):
        physics.step(state, command)


def test_mujocos_clock_runs_on_after_physics(world):
    """The clock is stopped only during a rollout, whose data count their steps without timing them."""
    ours = AgentPhysics(world, 1, closed_form=False)
    ours.step(begun(world, 1), np.ones((1, 2)))
    step = mujoco.mjtTimer.mjTIMER_STEP
    assert ours._step_batch._data[0].timer[step].number >= SUBSTEPS
    assert ours._step_batch._data[0].timer[step].duration == 0
    data = mujoco.MjData(world.model)
    mujoco.mj_step(world.model, data)
    assert data.timer[step].duration > 0
