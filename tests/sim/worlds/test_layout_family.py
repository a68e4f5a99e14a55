"""Families of random layouts: courses and mazes in three disjoint sets."""

import hashlib
import os
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import sim
from sim.tasks.registry import task_of
from sim.tasks.simulation import Simulation
from sim.worlds import layout_family, random_course
from sim.worlds.course import MOST_FALL
from sim.worlds.layout import CELL
from sim.worlds.layout_family import COLUMNS, MOST_LAYOUTS, ROWS, SETS, LayoutFamily
from tests.sim.worlds.test_course import falls_on_shortest_way

SMALL = LayoutFamily(seed=3, n_training=3, n_selection=2, n_test=2, rows=9, columns=19)


TASKS = ("navigation", "maze")


def walls_of(layouts, task):
    return list(layouts.mazes) if task == "maze" else [course.walls for course in layouts.courses]


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**64), st.integers(7, 15), st.integers(15, 45), st.sampled_from([1, 3]))
def test_on_random_courses_the_distance_from_the_start_hardly_falls(seed, rows, columns, width):
    """The shortest path of every start is walked, which is independent of the course's own check."""
    course = random_course.draw_course((rows, columns), np.random.default_rng(seed), width)
    assert course.walls.shape == (rows, columns)
    assert len(course.starts) == width
    assert len(course.training_starts) == width + len(range(5, columns - 4, 5))
    for start in course.training_starts:
        assert falls_on_shortest_way(course, start) <= MOST_FALL
    assert np.isfinite(course.way[~course.walls]).all(), "a free cell has no path to the goal"


@pytest.mark.parametrize("task", TASKS)
def test_sets_have_no_layout_in_common_and_larger_ones_begin_alike(task):
    names = {name: walls_of(getattr(SMALL, name), task) for name in SETS}
    assert [len(of_set) for of_set in names.values()] == [3, 2, 2]
    everything = {walls.tobytes() for of_set in names.values() for walls in of_set}
    assert len(everything) == 7
    larger = LayoutFamily(seed=3, n_training=4, n_selection=1, n_test=2, rows=9, columns=19)
    assert all(np.array_equal(a, b) for a, b in zip(names["training"], walls_of(larger.training, task), strict=False))
    other = LayoutFamily(seed=4, n_training=3, n_selection=2, n_test=2, rows=9, columns=19)
    assert not everything & {walls.tobytes() for name in SETS for walls in walls_of(getattr(other, name), task)}


@pytest.mark.parametrize("task", TASKS)
def test_layouts_lie_side_by_side_and_look_the_same_in_a_larger_set(task):
    """The first layout of a set has the same boxes and stripes, whatever the number of layouts."""
    worlds = [
        sim.build_world(task, layouts=LayoutFamily(seed=3, n_training=n, rows=9, columns=19).training) for n in (1, 3)
    ]
    alone, together = (_boxes(world, 9 * CELL * n) for world, n in zip(worlds, (1, 3), strict=True))
    assert alone == together[: len(alone)]
    assert worlds[1].mazes == 3
    height = 9 * CELL
    owners = np.floor((worlds[1].starts.position[:, 1] + 1.5 * height) / height)
    assert set(owners) == {0, 1, 2}
    if task == "navigation":
        assert np.bincount(owners.astype(int)).tolist() == [3, 3, 3]


def _boxes(world, extent):
    """Return position from the south end, size and material of all walls, from south to north within each layout."""
    model = world.model
    geoms = [i for i in range(model.ngeom) if model.geom(i).name.startswith("wall")]
    shift = [0, extent / 2, 0]
    return [(*(model.geom_pos[i] + shift), *model.geom_size[i], model.mat(model.geom_matid[i]).name) for i in geoms]


@pytest.mark.parametrize("task", TASKS)
def test_agents_start_in_the_free_cells_of_every_layout(task):
    world = sim.build_world(task, layouts=SMALL.training)
    walls = np.concatenate(walls_of(SMALL.training, task))
    for mode in ("training", "test"):
        state = Simulation(task_of(world, mode), 128, 0).reset()
        columns = np.rint(state.position[:, 0] / CELL + (walls.shape[1] - 1) / 2).astype(int)
        rows = np.rint(state.position[:, 1] / CELL + (walls.shape[0] - 1) / 2).astype(int)
        assert not walls[rows, columns].any()
        assert set(rows // 9) == {0, 1, 2}
        plan = task_of(world, mode).ground_plan(state.position[0])
        assert plan.bounds[3] - plan.bounds[1] <= 9 * CELL
        assert plan.bounds[1] < state.position[0, 1] < plan.bounds[3]


def test_a_family_sets_the_length_of_episodes():
    family = LayoutFamily(seed=3, n_training=1, n_selection=1, n_test=1, rows=9, columns=19, episode_steps=7)
    simulation = Simulation(task_of(sim.build_world("maze", layouts=family.test), "test"), 1, 0)
    simulation.reset()
    ends = [bool(simulation.step(np.array([[-1.0, 0.0]])).truncated[0]) for _ in range(7)]
    assert ends == 6 * [False] + [True]


def test_layouts_do_not_depend_on_the_process_or_its_hash_seed():
    code = (
        "import hashlib; from sim.worlds.layout_family import LayoutFamily as F; "
        "f = F(seed=2**100, n_training=2, n_selection=1, n_test=1, rows=9, columns=19); "
        "print(hashlib.sha256(b''.join(c.drawing.encode() for c in f.test.courses + f.training.courses)).hexdigest())"
    )
    family = LayoutFamily(seed=2**100, n_training=2, n_selection=1, n_test=1, rows=9, columns=19)
    drawings = b"".join(course.drawing.encode() for course in family.test.courses + family.training.courses)
    environment = {**os.environ, "PYTHONHASHSEED": "7"}
    said = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert said.stdout.strip() == hashlib.sha256(drawings).hexdigest()


def test_equal_layouts_are_refused(monkeypatch):
    """Courses drawn without chance are equal. The message names the two sets."""
    draw = {"maze": lambda family, rng: np.ones((family.rows, family.columns), bool)}
    monkeypatch.setattr(layout_family, "_DRAW", draw)
    family = LayoutFamily(seed=99, n_training=1, n_selection=1, n_test=1)
    with pytest.raises(ValueError, match="layouts training 0 and selection 0 have the same walls: must differ; use"):
        _ = family.training.mazes


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"n_training": 0}, rf"LayoutFamily: n_training = 0: must be a whole number in \[1, {MOST_LAYOUTS}\]"),
        ({"n_test": MOST_LAYOUTS + 1}, rf"n_test = {MOST_LAYOUTS + 1}: must be a whole number"),
        ({"rows": ROWS[0] - 2}, rf"rows = {ROWS[0] - 2}: must be a whole number in \[7, 31\]"),
        ({"columns": COLUMNS[1] + 2}, rf"columns = {COLUMNS[1] + 2}: must be a whole number in \[15, 99\]"),
        ({"rows": 12}, r"rows = 12: must be odd, such as 11"),
        ({"path_width": 2}, r"path_width = 2: must be odd, such as 1"),
        ({"episode_steps": 0}, r"episode_steps = 0: must be a whole number in"),
        ({"seed": -1}, r"seed = -1: must be a whole number"),
        ({"seed": "a"}, r"seed = 'a': must be a whole number"),
    ],
)
def test_families_of_impossible_numbers_are_refused(given, message):
    with pytest.raises(ValueError, match=message):
        LayoutFamily(**given)


@pytest.mark.parametrize(
    ("task", "given", "message"),
    [
        (
            "detection",
            {"layouts": SMALL.test},
            "layouts: must be left out for 'detection', only 'navigation' and 'maze'",
        ),
        ("maze", {"layouts": SMALL}, "layouts = .*: must be a kind of LayoutSet, such as sim.LayoutFamily"),
        ("maze", {"layouts": SMALL.test, "mazes": 2}, "layouts: seed, mazes and course must be left out"),
        ("maze", {"layouts": SMALL.test, "seed": 2}, "layouts: seed, mazes and course must be left out"),
        ("navigation", {"layouts": SMALL.test, "course": "long"}, "layouts: seed, mazes and course must be left out"),
        ("maze", {"wall_height": 0.3}, r"wall_height = 0\.3: must lie in \[0\.4, 100"),
        ("maze", {"wall_height": "high"}, "wall_height = 'high': must be a number"),
    ],
)
def test_layouts_that_do_not_fit_are_refused(task, given, message):
    with pytest.raises(ValueError, match=message):
        sim.build_world(task, **given)


@pytest.mark.parametrize("task", ["navigation", "maze", "detection"])
def test_walls_have_the_requested_height(task):
    """All walls end at this height and stand on the floor. Only the height differs from the default."""
    low, default = sim.build_world(task, wall_height=0.5).model, sim.build_world(task).model
    walls = [i for i in range(low.ngeom) if low.geom(i).name.startswith("wall")]
    assert (low.geom_pos[walls, 2] + low.geom_size[walls, 2] == 0.5).all()
    assert (low.geom_pos[walls, 2] - low.geom_size[walls, 2] == 0.0).all()
    assert (default.geom_size[walls, 2] == 0.5).all()
    assert np.array_equal(low.geom_pos[:, :2], default.geom_pos[:, :2])
    assert np.array_equal(low.geom_size[:, :2], default.geom_size[:, :2])


def test_eyes_see_over_low_walls():
    """A tall eye that faces a wall sees darkness above it, which begins lower above a low wall."""
    shares = []
    for height in (0.5, 1.0):
        eyes = sim.Eyes(n_eyes=1, resolution=(16, 16), noise_sigma=0.0)
        venv = sim.make_vec_env("detection", eyes, 4, seed=1, wall_height=height, rays_per_receptor=4)
        shares.append((venv.reset()["eyes"] == 0).mean())
        venv.close()
    assert shares[0] > shares[1] + 0.05
