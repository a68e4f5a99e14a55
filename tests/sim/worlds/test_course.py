"""A course can be solved by always increasing the distance from its start."""

import ast
import math
import re
from contextlib import suppress

import numpy as np
import pytest

import sim
from sim.physics.agent_motion import AgentPhysics
from sim.tasks.find_way import HEADING_SPREAD
from sim.tasks.registry import task_of
from sim.tasks.simulation import LEAST_RETURN, Simulation
from sim.worlds import maze
from sim.worlds.catalog import COURSES
from sim.worlds.course import MOST_FALL, Course
from sim.worlds.layout import CELL
from sim.worlds.navigation import DRAWN
from sim.worlds.world import MAX_SPEED

STRAIGHT = """
##########
#S.......#
##########
"""
# The only path leads back towards the start for three cells.
HOOK = """
#############
#S......#####
#######.#####
###.....#####
###.#########
###.........#
#############
"""


def falls_on_shortest_way(course, start):
    """Return the largest decrease of the distance from the start along the shortest path [m]."""
    cell, far, worst = start, 0.0, 0.0
    while not course.goal[cell]:
        cell = min(course._next_to(cell), key=lambda other: course.way[other])
        apart = CELL * math.hypot(cell[0] - start[0], cell[1] - start[1])
        far = max(far, apart)
        worst = max(worst, far - apart)
    return worst


@pytest.mark.parametrize("name", COURSES)
def test_the_distance_from_the_start_hardly_falls_on_any_way(name):
    course = DRAWN[name]
    for start in course.training_starts:
        assert course.fall(start)[0] <= MOST_FALL
        assert falls_on_shortest_way(course, start) <= MOST_FALL


def test_lengths_of_the_ways():
    """The short course takes about 50 actions at top speed from the west. The long course is twice as long."""
    short, long = (DRAWN[name].way[DRAWN[name].starts[0]] for name in COURSES)
    assert 82 < short < 104
    assert 1.8 < long / short < 2.2
    per_action = 0.2 * MAX_SPEED
    assert long < 128 * per_action < 2 * long, "128 actions must suffice at top speed, but not at half of it"


@pytest.mark.parametrize("name", COURSES)
def test_ways_part_and_join_again(name):
    """Free cells without islands would form a tree of corridors. Every island of walls is a choice between two
    paths.
    """
    import scipy.ndimage

    walls = DRAWN[name].walls
    islands = scipy.ndimage.label(walls, np.ones((3, 3)))[1] - 1  # the outer wall is one component
    assert islands == {"short": 2, "long": 4}[name]


@pytest.mark.parametrize("name", COURSES)
def test_agents_start_along_the_way_in_training_and_in_the_west_in_evaluation(name):
    world = sim.build_world("navigation", course=name)
    x_min, *_ = world.goal_region
    training = Simulation(task_of(world), 256, 0).reset()
    evaluation = Simulation(task_of(world, "evaluation"), 256, 0).reset()
    assert np.ptp(evaluation.position[:, 0]) == 0
    assert len(np.unique(training.position[:, 0])) >= 5
    assert training.position[:, 0].max() < x_min
    course = DRAWN[name]
    for state in (training, evaluation):
        columns = np.rint(state.position[:, 0] / CELL + (course.walls.shape[1] - 1) / 2).astype(int)
        rows = np.rint(state.position[:, 1] / CELL + (course.walls.shape[0] - 1) / 2).astype(int)
        along = np.array([course.heading((int(r), int(c))) for r, c in zip(rows, columns, strict=True)])
        off = (state.heading - along + np.pi) % (2 * np.pi) - np.pi
        assert np.abs(off).max() <= HEADING_SPREAD + 1e-9
        assert np.abs(off).max() > 0.9 * HEADING_SPREAD
        assert abs(off.mean()) < 4 * HEADING_SPREAD / np.sqrt(3 * len(off))


def test_free_cells_are_free_and_walls_are_walls():
    """The check includes places where invisible walls have been omitted."""
    world, course = sim.build_world("navigation"), DRAWN["short"]
    physics = AgentPhysics(world, 1)
    centers = course.places([tuple(cell) for cell in np.argwhere(~course.walls)])
    in_wall = [((physics.free_motion.lower < c) & (physics.free_motion.upper > c)).all(axis=1).any() for c in centers]
    assert not any(in_wall)
    beside = [
        (int(r), int(c))
        for r, c in np.argwhere(course.walls)
        if (~course.walls[max(r - 1, 0) : r + 2, max(c - 1, 0) : c + 2]).any()
    ]
    for center in course.places(beside):
        assert ((physics.free_motion.lower < center) & (physics.free_motion.upper > center)).all(axis=1).any()


def test_walls_have_stripes_of_differing_frequency():
    model = sim.build_world("navigation").model
    repeats = {
        float(model.mat_texrepeat[model.geom_matid[i]][0]) for i in range(model.ngeom) if "wall" in model.geom(i).name
    }
    assert len(repeats) == 4


def test_most_mazes_are_no_courses():
    """The distance falls by metres even along the easiest path of a random maze. Such mazes are not valid courses."""
    refused = 0
    for seed in range(8):
        walls = maze.draw_maze(maze.MAZE, np.random.default_rng(seed))
        lines = ["".join("#" if wall else "." for wall in row) for row in walls[::-1]]
        lines[-2] = "#S" + lines[-2][2:]
        with suppress(ValueError):
            Course("\n".join(lines))
            continue
        refused += 1
    assert refused == 5


def test_a_course_of_ones_own():
    course = Course(STRAIGHT, episode_steps=20)
    world = sim.build_world("navigation", course=course)
    simulation = Simulation(task_of(world, "evaluation"), 2, 0)
    simulation.reset()
    for action in range(20):
        step = simulation.step(np.tile([-1.0, 0.0], (2, 1)))
        assert step.truncated.all() == (action == 19)
    assert course.heading((1, 1)) == 0
    assert course.way[1, 1] == 2 * 5, "the last three cells are the goal"


@pytest.mark.parametrize(
    ("drawing", "message"),
    [
        ("####\n#S.#\n###", "lines differ in length"),
        (STRAIGHT.replace("S", "Q"), r"signs \['Q'\]; must be lines of '#', '.', 'S' and 's'"),
        (STRAIGHT.replace("S", "."), "no start: must have an 'S'"),
        (STRAIGHT.replace("#S", ".S"), r"cell \(1, 0\) of its border is free: must be a wall"),
        (STRAIGHT.replace("S.", "S#"), r"start in cell \(1, 1\) has no path to the goal"),
        (
            STRAIGHT.replace("...#", "S..#"),
            r"start in cell \(1, 6\) is in the goal, .* last 3 columns .*: must be west",
        ),
        (STRAIGHT.replace("...#", "..s#"), r"start in cell \(1, 8\) is in the goal"),
        ("#####\n#S..#\n#####", r"start in cell \(1, 1\) is in the goal"),
        (HOOK, r"after cell \(\d, \d\), the distance from the start in cell \(5, 1\) has to fall by"),
    ],
)
def test_what_is_no_course_is_refused_by_name(drawing, message):
    with pytest.raises(ValueError, match=message):
        Course(drawing)


def test_courses_are_navigations_alone():
    with pytest.raises(ValueError, match="course: must be left out for 'detection'"):
        sim.build_world("detection", course="long")
    with pytest.raises(
        ValueError, match=r"course = 'lnog': must be sim.Course or one of 'short', 'long'; did you mean 'long'"
    ):
        sim.build_world("navigation", course="lnog")


@pytest.mark.parametrize("steps", [0, "10", 2.5, math.inf, [3]])
def test_a_courses_length_is_a_whole_number(steps):
    words = f"course: episode_steps = {steps!r}: must be a whole number in [1, 1000000000]"
    with pytest.raises(ValueError, match=f"^{re.escape(words)}$"):
        Course(STRAIGHT, episode_steps=steps)


def test_what_is_no_drawing_is_shown_one():
    with pytest.raises(ValueError, match="drawing = 3: must be a kind of str, such as '#") as caught:
        Course(3)
    example = str(caught.value).split("such as ")[1]
    course = Course(ast.literal_eval(example))
    assert course.way[course.starts[0]] > 0, "the start is at the goal"


def test_a_training_episode_ends_at_the_least_return():
    """An agent that drives against a wall gets -1 per action, and so -3 after three actions. The info gives the reason
    for the end.
    """
    venv = sim.make_vec_env("navigation", n_envs=2, least_return=-3.0, rays_per_receptor=1)
    venv.reset()
    total, ends = np.zeros(2), 0
    for _ in range(60):
        _, reward, done, infos = venv.step(np.tile([1.0, 0.0], (2, 1)))
        total += reward
        for world in np.flatnonzero(done):
            if total[world] > -3:
                continue
            assert total[world] <= -3 < total[world] - reward[world]
            assert infos[world]["given_up"] == LEAST_RETURN
            assert infos[world]["TimeLimit.truncated"]
            assert "terminal_observation" in infos[world]
            ends += 1
        total[done] = 0
        assert all("given_up" not in infos[world] for world in np.flatnonzero(~done))
    assert ends >= 4
    venv.close()


def test_a_least_return_is_below_zero_and_for_training():
    with pytest.raises(ValueError, match=r"least_return = 0\.0: must be below 0, or None"):
        sim.make_vec_env("navigation", n_envs=1, least_return=0.0)
    with pytest.raises(ValueError, match="least_return = -50: must be left out in mode 'evaluation'"):
        sim.make_vec_env("navigation", n_envs=1, least_return=-50, mode="evaluation")
