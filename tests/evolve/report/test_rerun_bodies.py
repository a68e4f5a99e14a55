"""A recording of a user task, read back: poses agree with a second simulation by MuJoCo."""

import copy
from contextlib import closing
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from evolve.episodes.recorder import Recorder
from evolve.learning.animal_task import animal_task
from evolve.learning.fitness import evaluate
from evolve.learning.policy import load_policy
from sim.envs.prepared_task import PreparedTask
from tests.evolve.learning.test_task_module import BALL, small
from tests.evolve.report.read_back import frames, read_back, vectors, views

SEED = 5
# An arm with every kind of geom swings on the cart. The arm and its geoms are rotated.
ARM = """<geom type="box" size=".15 .2 .1" rgba=".2 .4 .8 1" mass="1"/>
          <body name="arm/left" pos="-.3 .1 .2" euler="10 20 30">
            <joint name="swing" type="hinge" axis="0 0 1" range="-170 170"/>
            <geom name="shank" type="capsule" size=".05 .2" pos=".1 0 .3" euler="40 0 0" rgba=".9 .6 .3 .5"/>
            <geom name="drum" type="cylinder" size=".1 .02" pos="0 .2 .3" euler="0 30 0"/>
            <geom name="egg" type="ellipsoid" size=".1 .06 .04" pos="0 0 .6" euler="0 0 20"/>
            <geom name="wedge" type="mesh" mesh="wedge" pos=".3 0 .5" euler="0 50 0"/>
            <geom name="hidden" size=".1" group="4" pos="0 0 1"/>
          </body>"""
WEDGE = '<asset><mesh name="wedge" vertex="0 0 0  .2 0 0  0 .3 0  0 0 .1"/></asset><worldbody>'
VARY = {"ball.size": (0.5, 1.5), "ball.color": ((0, 0, 0), (1, 1, 1))}
CHANGES = {
    '<geom type="box" size=".15 .2 .1" rgba=".2 .4 .8 1" mass="1"/>': ARM,
    "<worldbody>": WEDGE,
    '<geom size=".3"': '<geom name="ball" size=".3"',
    "    episode_steps": f"    vary = {VARY}\n    episode_steps",
    'return {"near":': 'return {"total": data.qvel[1] / 100, "quite near":',
}


@pytest.fixture(scope="module")
def life(tmp_path_factory):
    """Return a configuration, an animal, and a policy with minimal training."""
    folder = tmp_path_factory.mktemp("armed")
    text = BALL.read_text()
    for old, new in CHANGES.items():
        assert text.count(old) == 1
        text = text.replace(old, new)
    (folder / "armed.py").write_text(text)
    eyes = ("genome.elevation_deg.start=15", "genome.placement_range_deg.start=80")
    config, animal = small(*eyes, named=f"{folder / 'armed.py'}:FindBall")
    evaluation = evaluate(animal, config, 3, folder / "policy")
    assert evaluation.failure is None
    return config, animal, load_policy(folder / "policy")


@pytest.fixture(scope="module")
def episode(life):
    config, animal, policy = life
    return Recorder(animal, config, policy).play(0, SEED)


@pytest.fixture(scope="module")
def columns(episode, tmp_path_factory):
    return read_back(episode, tmp_path_factory.mktemp("rrd"))


@pytest.fixture(scope="module")
def moments(life, episode):
    """Return the model of the episode, and its data before each action, from a second simulation by MuJoCo."""
    config, animal, _ = life
    datas = []
    with closing(PreparedTask(animal_task(animal, config)).vec_env(1, SEED)) as worlds:
        worlds.reset()
        data = worlds.worlds.datas[0]
        model = copy.copy(data.model)
        for action in episode.action:
            data = worlds.worlds.datas[0]
            datas.append({name: getattr(data, name).copy() for name in ("geom_xpos", "geom_xmat", "xpos", "xmat")})
            worlds.step(action[None].astype(np.float32))
    return model, datas


def entity(model, geom):
    body = model.body(model.geom_bodyid[geom]).name or f"body_{model.geom_bodyid[geom]}"
    return f"/world/bodies/{body}/{model.geom(geom).name or f'geom_{geom}'}".replace("arm/left", r"arm\/left")


def turned(columns, name):
    """Return the rotation of a static entity."""
    x, y, z, w = columns[name, "Transform3D:quaternion"][0][0]
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, [w, x, y, z])
    return matrix.reshape(3, 3)


def test_every_geom_is_where_mujoco_has_it(columns, moments):
    model, datas = moments
    seen = [g for g in range(model.ngeom) if model.geom_group[g] < 3]
    assert {tuple(key[0].split("/")[1:3]) for key in columns} >= {("world", "bodies")}
    assert len({key[0] for key in columns if key[0].count("/") > 3 and "bodies" in key[0]}) >= len(seen)
    for g in seen:
        name = entity(model, g)
        body = name.rsplit("/", 1)[0]
        places, rotations = vectors(columns, body, "Transform3D:translation"), frames(columns, body)
        offset, own = columns[name, "Transform3D:translation"][0][0], turned(columns, name)
        # Recordings contain float32.
        np.testing.assert_allclose(
            places + rotations @ offset, [data["geom_xpos"][g] for data in datas], atol=1e-6, err_msg=name
        )
        truth = np.reshape([data["geom_xmat"][g] for data in datas], (-1, 3, 3))
        np.testing.assert_allclose(rotations @ own, truth, atol=1e-6, err_msg=name)
    assert not any("hidden" in key[0] for key in columns)
    swung = frames(columns, r"/world/bodies/arm\/left")
    assert np.abs(swung[-1] - swung[0]).max() > 0.01, "the arm turns"


def test_shapes_are_those_of_the_episodes_own_model(columns, moments):
    """The ball has the episode's own size and colour, which differ between episodes."""
    model, _ = moments
    sizes = {model.geom(g).name: model.geom_size[g] for g in range(model.ngeom)}
    of = {name: entity(model, model.geom(name).id) for name in sizes if name}
    (half,) = vectors(columns, of["ball"], "Ellipsoids3D:half_sizes")
    np.testing.assert_allclose(half, np.repeat(sizes["ball"][0], 3), rtol=1e-6)
    assert abs(half[0] - 0.3) > 0.01, "the size differs from the default"
    color = columns[of["ball"], "Ellipsoids3D:colors"][0][0]
    np.testing.assert_allclose(
        [(color >> shift) & 255 for shift in (24, 16, 8, 0)], 255 * model.geom("ball").rgba, atol=0.5
    )
    (half,) = vectors(columns, of["egg"], "Ellipsoids3D:half_sizes")
    np.testing.assert_allclose(half, [0.1, 0.06, 0.04], rtol=1e-6)
    for name, kind, long in (("shank", "Capsules3D", 0.4), ("drum", "Cylinders3D", 0.04)):
        assert columns[of[name], f"{kind}:lengths"][0][0] == pytest.approx(long)
        assert columns[of[name], f"{kind}:radii"][0][0] == pytest.approx(sizes[name][0])
    # Rerun's capsules start at the centre of one end, and MuJoCo's are centred.
    ends = vectors(columns, of["shank"], "Capsules3D:translations")[0]
    np.testing.assert_allclose(ends, [0, 0, -0.2], atol=1e-7)
    corners = np.array(columns[of["wedge"], "Mesh3D:vertex_positions"][0])
    mesh = model.mesh_vert[: model.mesh_vertnum[0]]
    assert {tuple(v) for v in corners.astype(np.float32)} == {tuple(v) for v in mesh}
    floor = "/world/bodies/world/geom_0"
    assert vectors(columns, floor, "Boxes3D:half_sizes")[0].tolist() == [6, 3, 0]


def test_eyes_are_cameras_that_look_where_the_eyes_look(columns, moments, episode):
    """The eyes are at azimuths of ±40° and an elevation of 15° from the cart, 0.26 m out, in MuJoCo's frame of the
    cart.
    """
    model, datas = moments
    cart = model.body("cart").id
    for name, azimuth in zip(episode.eyes.names(), np.radians([40, -40]), strict=True):
        camera = frames(columns, f"/world/eyes/{name}")
        out = np.array([np.cos(azimuth), np.sin(azimuth), 0])
        ahead = np.cos(np.radians(15)) * out + [0, 0, np.sin(np.radians(15))]
        for t, data in enumerate(datas):
            rotation = data["xmat"][cart].reshape(3, 3)
            np.testing.assert_allclose(camera[t] @ [0, 0, 1], rotation @ ahead, atol=1e-6)
            assert np.linalg.det(camera[t]) == pytest.approx(1, abs=1e-5)
            assert (camera[t] @ [0, -1, 0])[2] == pytest.approx(np.cos(np.radians(15)), abs=1e-6), "not upright"
        place = vectors(columns, f"/world/eyes/{name}", "Transform3D:translation")
        truth = [d["xpos"][cart] + d["xmat"][cart].reshape(3, 3) @ (0.26 * out + [0, 0, 0.12]) for d in datas]
        np.testing.assert_allclose(place, truth, atol=1e-6)
        assert columns[f"/world/eyes/{name}", "Pinhole:resolution"][0][0] == list(episode.eyes.resolution[::-1])
    (path,) = vectors(columns, "/world/path", "LineStrips3D:strips")
    np.testing.assert_allclose(path, [data["xpos"][cart] for data in datas], atol=1e-6)
    assert np.ptp(path[:, 1]) > 0.01


def test_signals_pictures_and_times_are_the_episodes(columns, episode):
    for eye, name in enumerate(episode.eyes.names()):
        tensors = columns[f"/signals/{name}", "Tensor:data"]
        signals = np.array([tensor[0]["buffer"] for tensor in tensors]).reshape(-1, *episode.signals.shape[2:])
        np.testing.assert_array_equal(signals, episode.signals[:, eye])
        for of, times in (("world/eyes", 20), ("perfect_lens", 20), ("scene", 3)):
            assert len(columns[f"/{of}/{name}", "Image:buffer"]) == times
    seconds = [value.total_seconds() for value in columns[r"/world/bodies/arm\/left", "time"]]
    np.testing.assert_allclose(seconds, 0.1 * np.arange(20), atol=1e-6)


def test_reward_terms_sum_to_the_return(columns, episode):
    """One term has a name of two words, and one has the default name of the sum."""
    terms = [vectors(columns, f"/reward/{name}", "Scalars:scalars") for name in ("total", r"quite\ near")]
    total = vectors(columns, "/reward", "Scalars:scalars")
    np.testing.assert_allclose(np.sum(terms, axis=0), total, atol=1e-6)
    assert total.sum() == pytest.approx(episode.reward.sum(), abs=1e-5)
    np.testing.assert_array_equal(vectors(columns, "/action/0", "Scalars:scalars"), episode.action[:, 0])
    assert all(np.any(term) for term in terms)


@pytest.mark.parametrize(
    ("how", "told", "level"),
    [
        ({"solved": True}, "solved", "INFO"),
        ({"solved": False}, "not solved", "INFO"),
        ({"failure": "rewards, line 3 of mine.py: no"}, "failed: rewards, line 3 of mine.py: no", "ERROR"),
    ],
)
def test_how_it_ended_is_told(episode, tmp_path, how, told, level):
    columns = read_back(replace(episode, **how), tmp_path)
    assert columns["/outcome", "TextLog:text"] == [[told]]
    assert columns["/outcome", "TextLog:level"] == [[level]]


def test_it_opens_with_the_world_the_eyes_and_how_it_ended(columns, episode, tmp_path):
    shown = views(episode, tmp_path)
    there = {entity for entity, _ in columns}
    elsewhere = {origin for origins in shown.values() for origin in origins} - there
    assert elsewhere <= {"/world", "/action", "/feels"}, "only these entities or their children"
    assert shown["TextLog"] == {"/outcome"}
    eyes = {entity for entity, _ in columns if entity.startswith("/world/eyes/")}
    assert eyes
    assert eyes < shown["2D"]
