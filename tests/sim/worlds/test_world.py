"""Worlds: positions of objects, the agent's motion, and its contacts."""

import hashlib

import mujoco
import numpy as np
import pytest

import sim
from sim.eyes.eyes import BODY_RADIUS, eye_positions
from sim.physics.agent_motion import AgentPhysics
from sim.scene.color import decode_srgb
from sim.scene.surfaces import image
from sim.tasks.registry import task_of
from sim.tasks.simulation import Simulation
from sim.worlds import detection, materials, maze
from sim.worlds.layout import CELL
from sim.worlds.striped_walls import merge_walls
from sim.worlds.world import MAX_SPEED

ACTION = 10  # substeps per action


@pytest.fixture(scope="module")
def field():
    return sim.build_world("detection")


def started(world, x, y):
    data = mujoco.MjData(world.model)
    data.qpos[:2] = x, y
    mujoco.mj_forward(world.model, data)
    return data


def test_speed_rises_as_in_the_published_environment(field):
    """The agent moves 0.44, 1.12, 1.50 and 1.71 m per action from rest, with a limit of 1.98 m (from the published
    code, to 1 cm).

    That code reads `xpos` after mj_step, which is one substep old. The test reads the same value.
    """
    data = started(field, -10, 0)
    data.ctrl[:] = MAX_SPEED, 0
    body, x = field.model.body("agent").id, [-10.0]
    for _ in range(9):
        for _ in range(ACTION):
            mujoco.mj_step(field.model, data)
        x.append(data.xpos[body, 0])
    steps = np.diff(x)
    np.testing.assert_allclose(steps[:4], [0.44, 1.12, 1.50, 1.71], atol=0.01)
    assert 1.95 < steps[-1] < 1.98
    # The continuous lag, v = 9.9 (1 - exp(-t/0.35)), integrated over the first action; the difference is a first-order
    # method's error.
    assert data.qvel[0] == pytest.approx(9.9 * (1 - np.exp(-1.8 / 0.35)), rel=2e-3)


@pytest.mark.parametrize("direction", [(1, 0), (0.6, 0.8), (0.98, 0.199)])
def test_no_eye_ever_passes_through_a_wall(field, direction):
    """The agent drives at full speed against the walls from many distances, so that contact occurs at different
    substeps.
    """
    azimuths = np.linspace(0, 2 * np.pi, 36)
    for start in np.linspace(-3, -2, 7):
        data = started(field, start, start)
        data.ctrl[:] = MAX_SPEED * np.array(direction)
        touched = False
        for _ in range(25 * ACTION):
            mujoco.mj_step(field.model, data)
            eyes = data.qpos[:2] + eye_positions(azimuths)[:, :2]
            assert np.all(np.abs(eyes) < [11.0, 9.0])
            touched |= data.sensordata[0] > 0
            # The agent does not bounce: each substep pushes it back by at most a fifth of the whiskers' length.
            assert np.all(data.qvel[:2] > -0.2 * 0.2 / 0.02 - 0.01)
        assert touched
        assert data.sensordata[0] > 0  # the agent still leans against the wall
        # ... and is at rest along the wall's normal.
        assert np.abs(data.qvel[0]) < 0.02


def test_objects_are_no_obstacles(field):
    data = started(field, -2, 0)
    data.ctrl[:] = MAX_SPEED, 0
    for _ in range(3 * ACTION):
        mujoco.mj_step(field.model, data)
        assert data.ncon == 0
    assert data.qpos[0] > 0.5  # the agent has passed through the goal at the origin
    assert data.sensordata[0] == 0


@pytest.mark.parametrize("task", sim.TASKS)
def test_only_pairs_of_agent_and_wall_can_touch(task):
    model = sim.build_world(task).model
    agent = model.geom("agent").id
    for a in range(model.ngeom):
        for b in range(a):
            meets = (model.geom_contype[a] & model.geom_conaffinity[b]) | (
                model.geom_contype[b] & model.geom_conaffinity[a]
            )
            wall = {model.geom(g).name.split("_")[0] for g in (a, b)} - {"agent"} == {"wall"}
            assert bool(meets) == (agent in (a, b) and wall)
    assert model.opt.jacobian == mujoco.mjtJacobian.mjJAC_DENSE


def test_joints_read_world_coordinates(field):
    data = started(field, 3.0, -4.0)
    np.testing.assert_allclose(data.xpos[field.model.body("agent").id], [3, -4, BODY_RADIUS])
    np.testing.assert_allclose(field.model.qpos0[:2], field.agent_spawn[0])


def test_starts_are_apart_from_objects_and_walls(field):
    apart = np.linalg.norm(field.agent_spawn[:, None] - field.object_spawn[None], axis=2)
    assert apart.min() >= 2 * CELL
    assert np.abs(np.concatenate([field.agent_spawn, field.object_spawn])).max(0) == pytest.approx([10, 8])


def test_objects_differ_only_in_the_orientation_of_their_stripes(field):
    model = field.model
    goal, *adversaries = (model.geom(name).id for name in field.objects)
    for geom in adversaries:
        assert np.array_equal(model.geom_size[geom], model.geom_size[goal])
        assert np.array_equal(model.mat_rgba[model.geom_matid[geom]], model.mat_rgba[model.geom_matid[goal]])
    upright = image(model, model.texture("upright_stripes").id)[..., 0]
    level = image(model, model.texture("level_stripes").id)[..., 0]
    # A viewer sees half of the sectors and the same number of bands: the lowest of the seven bands is hidden below.
    assert len(stripe_bounds(upright[0])) == 2 * detection.STRIPES - 1
    assert len(stripe_bounds(level[:, 0])) == detection.STRIPES
    assert {level.max(), level.min()} == {upright.max(), upright.min()}


def stripe_bounds(values):
    """Return the boundaries between dark and light texels, with the mean of both as the threshold."""
    dark = values < (values.min() + values.max()) / 2
    return np.flatnonzero(np.diff(dark))


def test_mazes_have_a_way_and_no_dead_ends():
    for seed in range(20):
        walls = maze.draw_maze(maze.MAZE, np.random.default_rng(seed))
        assert walls[[0, -1]].all()
        assert walls[:, [0, -1]].all()
        free = ~walls
        neighbors = sum(np.roll(free, shift, axis) for axis in (0, 1) for shift in (1, -1))
        assert neighbors[free].min() >= 2
        reached = np.zeros_like(free)
        reached[1, 1] = True
        while True:  # grow along the corridors
            grown = free & sum((np.roll(reached, s, a) for a in (0, 1) for s in (1, -1)), reached.astype(int)).astype(
                bool
            )
            if np.array_equal(grown, reached):
                break
            reached = grown
        assert np.array_equal(reached, free)


def test_merged_walls_cover_the_maze_exactly():
    walls = maze.draw_maze(maze.MAZE, np.random.default_rng(3))
    covered = np.zeros(walls.shape, int)
    runs = merge_walls(walls, 4)
    for row, column, rows, columns in runs:
        covered[row : row + rows, column : column + columns] += 1
        assert min(rows, columns) == 1
        assert max(rows, columns) <= 4
    assert np.array_equal(covered, walls.astype(int))
    assert len(runs) < walls.sum() / 2


def test_a_maze_is_its_seeds():
    def walls(seed):
        return sim.build_world("maze", seed=seed).model.geom_pos

    assert np.array_equal(walls(1), walls(1))
    assert walls(1).shape != walls(2).shape or not np.array_equal(walls(1), walls(2))


def test_several_mazes_are_different_and_apart():
    """Episodes start in each of the mazes. The first maze is the same as in a world with one maze, and a wall as long
    as the world separates neighbours.
    """
    one, three = (sim.build_world("maze", seed=4, mazes=mazes) for mazes in (1, 3))
    height = 13 * 2.0
    centers = np.array([-height, 0.0, height])
    starts = [three.agent_spawn[np.abs(three.agent_spawn[:, 1] - c) < height / 2] - [0, c] for c in centers]
    assert {tuple(s) for s in starts[0]} == {tuple(s) for s in one.agent_spawn}
    assert len({tuple(map(tuple, s)) for s in starts}) > 1
    physics = AgentPhysics(three, 1)
    for border in (centers[:2] + centers[1:]) / 2:
        for x in np.arange(-38.9, 39, 0.5):
            inside = (physics.free_motion.lower < [x, border - 0.1]) & (physics.free_motion.upper > [x, border - 0.1])
            assert inside.all(axis=1).any()
    begun = {round(Simulation(task_of(three), 1, seed).reset().position[0, 1] / height) for seed in range(9)}
    assert begun == {-1, 0, 1}


def test_maze_starts_and_goal_lie_in_free_cells():
    world = sim.build_world("maze", seed=5)
    x_min, y_min, x_max, y_max = world.goal_region
    assert world.agent_spawn[:, 0].max() < x_min
    for x, y in world.agent_spawn:
        data = started(world, x, y)
        assert data.ncon == 0
    assert (x_max, y_max) == (37.0, 11.0)
    assert (x_min, y_min) == (31.0, -11.0)
    assert world.objects == ()


def test_stripes_start_light_and_split_evenly():
    picture = decode_srgb(materials.stripes((4, 64), 8, axis=1) / 255)[0, :, 0]
    np.testing.assert_allclose(picture[:8], materials.WHITE, atol=0.005)
    np.testing.assert_allclose(picture[8:16], materials.BLACK, atol=0.005)
    assert np.mean(picture > 0.5) == 0.5


def test_bad_input_is_named():
    with pytest.raises(ValueError, match="mazes = 2: must be 1, or more for 'maze'"):
        sim.build_world("detection", mazes=2)
    with pytest.raises(ValueError, match="did you mean 'navigation'"):
        sim.build_world("navigate")
    with pytest.raises(ValueError, match="seed = -1"):
        sim.build_world("detection", seed=-1)


def test_tracking_is_the_field_of_detection():
    assert sim.build_world("tracking").objects == detection.OBJECTS


def test_a_seeds_maze_stays_the_same():
    """The maze of a seed must not change between versions, because it would be another task. Each line is a row of
    walls and passages.
    """
    drawn = maze.draw_maze((7, 9), np.random.default_rng(0))
    assert ["".join(".#"[int(wall)] for wall in row) for row in drawn] == [
        "#########",
        "#.......#",
        "#.#####.#",
        "#.#.....#",
        "#.#.###.#",
        "#.......#",
        "#########",
    ]


def test_so_do_those_of_other_seeds():
    drawn = (maze.draw_maze((9, 13), np.random.default_rng(seed)) for seed in range(20))
    assert (
        hashlib.sha256(b"".join(np.packbits(walls).tobytes() for walls in drawn)).hexdigest()[:16] == "74e8c90da89a0d15"
    )
