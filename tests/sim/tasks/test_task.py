"""Rewards, events, endings, placement and motion against their definitions."""

import dataclasses

import numpy as np
import pytest

from sim.physics.sliding_agents import MAX_TURN
from sim.tasks.placement import SpawnPoints
from sim.tasks.reach import first_reached
from sim.tasks.registry import task_of
from sim.tasks.reward import EVALUATION, TRAINING
from sim.tasks.simulation import Simulation
from sim.worlds.catalog import EPISODE_STEPS
from sim.worlds.layout import CLEARANCE, REACH, SEPARATION
from sim.worlds.world import build_world


@pytest.fixture(scope="module")
def field():
    return build_world("detection")


@pytest.fixture(scope="module")
def maze():
    return build_world("maze")


def facing(simulation, targets, distance):
    """Return a state with every agent `distance` in front of the object with that index, facing it at full speed."""
    state = simulation.reset()
    rows = np.arange(simulation.n)
    spots = state.objects[rows, targets, :2]
    return dataclasses.replace(
        state,
        position=spots - [distance, 0.0],
        heading=np.zeros(simulation.n),
        velocity=np.tile([9.9, 0.0], (simulation.n, 1)),
    )


AHEAD = np.array([1.0, 0.0])


def test_weights_are_the_papers():
    assert (TRAINING.progress, TRAINING.goal, TRAINING.adversary, TRAINING.contact) == (0.25, 1, -1, -1)
    assert (EVALUATION.progress, EVALUATION.goal, EVALUATION.adversary, EVALUATION.contact) == (1.5, 10, -10, -2)


def test_training_ends_at_goal_and_adversary(field):
    simulation = Simulation(task_of(field), 3, 0)
    simulation.state = facing(simulation, np.array([0, 1, 2]), 2.5)
    step = simulation.step(np.tile(AHEAD, (3, 1)))
    assert step.terminated.all()
    assert not step.truncated.any()
    assert step.success.tolist() == [True, False, False]
    assert step.reward_terms["goal"].tolist() == [1, 0, 0]
    assert step.reward_terms["adversary"].tolist() == [0, -1, -1]


def test_a_world_of_goals_alone(field):
    """Without adversaries, the nearest goal counts, and reaching a goal ends the episode."""
    goals = dataclasses.replace(field, objects=("goal",))
    simulation = Simulation(task_of(goals), 2, 0)
    state = facing(simulation, np.array([0, 0]), 2.5)
    away = dataclasses.replace(state, heading=np.array([0.0, np.pi]), velocity=state.velocity * [[1], [-1]])
    simulation.state = away
    step = simulation.step(np.tile(AHEAD, (2, 1)))
    assert step.reward_terms["goal"].tolist() == [1, 0]
    assert step.reward_terms["adversary"].tolist() == [0, 0]
    assert step.terminated.tolist() == [True, False]
    assert step.reward_terms["progress"][1] < 0


def test_passing_by_within_reach_counts_though_the_action_ends_beyond(field):
    """An action moves the agent 2 m. At its end the agent is 1.05 m past the goal, but it passed through the goal."""
    simulation = Simulation(task_of(field), 1, 0)
    state = facing(simulation, np.array([0]), 0.93)
    simulation.state = dataclasses.replace(state, position=state.position + np.array([0.0, 0.6]))
    step = simulation.step(AHEAD[None])
    assert np.linalg.norm(step.state.position - step.state.objects[:, 0, :2]) > REACH
    assert step.success[0]


def test_evaluation_respawns_and_goes_on(field):
    simulation = Simulation(task_of(field, "evaluation"), 2, 0)
    simulation.state = before = facing(simulation, np.array([0, 1]), 2.5)
    step = simulation.step(np.tile(AHEAD, (2, 1)))
    assert not step.done.any()
    assert step.reward_terms["goal"].tolist() == [10, 0]
    assert step.reward_terms["adversary"].tolist() == [0, -10]
    moved = np.any(step.state.objects != before.objects, axis=-1)
    assert moved.tolist() == [[True, False, False], [False, True, False]]
    gaps = np.linalg.norm(step.state.objects[:, :, :2] - step.state.position[:, None], axis=-1)
    assert gaps[moved].min() >= CLEARANCE
    assert step.state.goals_reached.tolist() == [1, 0]


def test_progress_is_the_change_of_distance(field, maze):
    simulation = Simulation(task_of(field), 4, 1)
    before = simulation.reset()
    step = simulation.step(np.random.default_rng(0).uniform(-1, 1, (4, 2)))
    distances = [np.linalg.norm(s.objects[:, 0, :2] - s.position, axis=-1) for s in (before, step.state)]
    np.testing.assert_allclose(step.reward_terms["progress"], -0.25 * (distances[1] - distances[0]))
    simulation = Simulation(task_of(maze, "evaluation"), 4, 1)
    simulation.reset()
    total = np.zeros(4)
    for _ in range(3):
        step = simulation.step(np.random.default_rng(0).uniform(-1, 1, (4, 2)))
        total += step.reward_terms["progress"]
    away = np.linalg.norm(step.state.position - step.state.start, axis=-1)
    np.testing.assert_allclose(total, 1.5 * away)


def test_maze_is_left_through_its_goal_region(maze):
    simulation = Simulation(task_of(maze), 1, 0)
    state = simulation.reset()
    x0, y0, x1, y1 = maze.goal_region
    inside = np.array([[(x0 + x1) / 2, (y0 + y1) / 2]])
    simulation.state = dataclasses.replace(state, position=inside)
    assert simulation.step(np.array([[-1.0, 0.0]])).success[0]
    simulation.state = state
    assert not simulation.step(np.array([[-1.0, 0.0]])).success[0]


def test_contact_is_penalised(field):
    simulation = Simulation(task_of(field), 1, 0)
    state = simulation.reset()
    simulation.state = dataclasses.replace(state, position=np.array([[10.7, 0.0]]), heading=np.zeros(1))
    step = simulation.step(AHEAD[None])
    assert simulation.felt[0]["contact"][0]
    assert step.reward_terms["contact"][0] == -1


def test_time_limit_truncates_and_does_not_terminate(field):
    simulation = Simulation(task_of(field, "evaluation"), 1, 0)
    simulation.reset()
    for _ in range(EPISODE_STEPS):
        step = simulation.step(np.array([[-1.0, 0.0]]))
    assert step.truncated[0]
    assert not step.terminated[0]


def test_actions_steer(field):
    simulation = Simulation(task_of(field), 2, 0)
    before = simulation.reset()
    step = simulation.step(np.array([[-1.0, 0.5], [-1.0, -1.0]]))
    turned = (step.state.heading - before.heading + np.pi) % (2 * np.pi) - np.pi
    np.testing.assert_allclose(turned, [0.5 * MAX_TURN, -MAX_TURN])
    np.testing.assert_allclose(step.state.position, before.position, atol=1e-9)  # -1 means stop


def _first_reached(path: np.ndarray, before: float, after: np.ndarray) -> list[list[int]]:
    """Return the substep at which agents reach the object in worlds of one object each, on the x-axis."""
    objects = [np.stack([x, np.zeros_like(x), np.zeros_like(x)], axis=-1)[:, None] for x in (before + 0 * after, after)]
    return first_reached(path, *objects).tolist()


def test_first_reached_follows_moving_objects():
    path = np.zeros((1, 10, 2))
    assert _first_reached(path, 2.0, np.array([0.0])) == [[5]]  # 2 - 0.2 s < 1 from the sixth substep on
    assert _first_reached(path, 2.0, np.array([1.5])) == [[10]]


def test_a_broken_world_hides_no_event_of_its_neighbours():
    path = np.zeros((2, 10, 2))
    path[0] = np.nan
    path[1, :, 0] = np.linspace(0, 2, 10)  # the agent passes the object and goes on for a metre
    assert _first_reached(path, 0.5, np.array([np.nan, 0.5]))[1] == [0]


def test_starts_are_apart_and_varied(field):
    rng = np.random.default_rng(0)
    places = SpawnPoints(field.agent_spawn, field.object_spawn)
    starts = [places.draw(rng, 3) for _ in range(200)]
    for agent, objects in starts:
        gaps = np.linalg.norm(objects[:, None] - objects[None], axis=-1)[np.triu_indices(3, 1)]
        assert gaps.min() >= SEPARATION
        assert np.linalg.norm(objects - agent, axis=-1).min() >= CLEARANCE
    assert len({tuple(objects[0]) for _, objects in starts}) > 20
    headings = Simulation(task_of(field), 64, 0).reset().heading
    assert np.ptp(headings) > 5.0


def test_too_small_a_field_is_refused(field):
    with pytest.raises(ValueError, match="object_spawn"):
        SpawnPoints(field.agent_spawn, field.object_spawn[:1]).draw(np.random.default_rng(0), 3)


def test_tracked_objects_wander_inside_and_apart():
    world = build_world("tracking")
    simulation = Simulation(task_of(world, "evaluation"), 16, 0)
    states = [simulation.reset()]
    stay = np.tile([-1.0, 0.0], (16, 1))
    for _ in range(100):
        before = states[-1]
        states.append(simulation.step(stay).state)
        walked = np.linalg.norm(states[-1].objects - before.objects, axis=-1)
        # the speed is 0.5 m/s; only respawned objects move farther
        assert walked[walked < 0.5].max() <= 0.5 * 0.2 + 1e-9
    paths = np.stack([s.objects[:, :, :2] for s in states])
    low, high = world.object_spawn.min(axis=0), world.object_spawn.max(axis=0)
    assert (paths >= low - 1e-9).all()
    assert (paths <= high + 1e-9).all()
    assert np.linalg.norm(paths[-1] - paths[0], axis=-1).mean() > 1.0
    gaps = np.linalg.norm(paths[:, :, :, None] - paths[:, :, None], axis=-1)
    assert gaps[..., *np.triu_indices(3, 1)].min() >= SEPARATION - 1e-9


def test_unknown_mode_and_task_are_refused(field):
    with pytest.raises(ValueError, match="mode"):
        Simulation(task_of(field, "testing"), 1, 0)
    with pytest.raises(ValueError, match="task"):
        task_of(dataclasses.replace(field, task="chess"))


@pytest.mark.parametrize("n", [1, 3])
def test_a_step_in_which_everybody_arrives_is_a_step_like_others(field, n):
    """The step works although all objects are goals and are reached in all worlds."""
    goals = dataclasses.replace(field, objects=("goal",))
    simulation = Simulation(task_of(goals), n, 0)
    simulation.state = facing(simulation, np.zeros(n, int), 2.5)
    step = simulation.step(np.tile(AHEAD, (n, 1)))
    assert step.success.all()
    assert step.terminated.all()


@pytest.mark.parametrize("adversary_first", [False, True])
def test_one_action_may_reach_both_and_says_which_was_first(field, adversary_first):
    """An action moves an agent up to 2 m. In evaluation, the reward includes both events."""
    simulation = Simulation(task_of(field, "evaluation"), 1, 0)
    state = simulation.reset()
    objects = state.objects.copy()
    near, far = (1, 0) if adversary_first else (0, 1)
    objects[0, near, :2], objects[0, far, :2], objects[0, 2, :2] = (0, 0), (2, 0), (-6, -6)
    simulation.state = dataclasses.replace(
        state,
        objects=objects,
        position=np.array([[-0.2, 0.5]]),
        heading=np.zeros(1),
        velocity=np.array([[9.0, 0.0]]),
    )
    step = simulation.step(AHEAD[None])
    assert step.reward_terms["goal"] == 10
    assert step.reward_terms["adversary"] == -10
    assert step.info[0].get("adversary_first", False) is adversary_first
