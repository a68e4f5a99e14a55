"""A recording for rerun, read back: it contains the numbers of the episode."""

import sys

import numpy as np
import pytest

from evolve.cli.main import main
from evolve.report import replay
from tests.evolve.report.read_back import frames, read_back, vectors, views


@pytest.fixture(scope="module")
def columns(episode, tmp_path_factory):
    return read_back(episode, tmp_path_factory.mktemp("rrd"))


def test_actions_rewards_and_contact_are_numbers_over_time(columns, episode):
    for name, values in {
        "action/speed": episode.action[:, 0],
        "action/turn": episode.action[:, 1],
        "reward": episode.reward,
        "contact": episode.beside["contact"][:, 0],
        **{f"reward/{name}": term for name, term in episode.reward_terms.items()},
    }.items():
        assert vectors(columns, f"/{name}", "Scalars:scalars").tolist() == values.astype(float).tolist(), name


def test_agent_and_objects_move_as_they_did(columns, episode):
    place = vectors(columns, "/world/bodies/agent", "Transform3D:translation")
    np.testing.assert_allclose(place[:, :2], episode.position, atol=1e-5)
    (path,) = vectors(columns, "/world/path", "LineStrips3D:strips")
    np.testing.assert_array_equal(path, place)
    ahead = frames(columns, "/world/bodies/agent")[:, :, 0]
    cosine, sine = np.cos(episode.heading), np.sin(episode.heading)
    np.testing.assert_allclose(ahead, np.stack([cosine, sine, 0 * sine], axis=1), atol=1e-6)
    for i, name in enumerate(("goal", "adversary_0", "adversary_1")):
        place = vectors(columns, f"/world/bodies/{name}", "Transform3D:translation")
        np.testing.assert_allclose(place, episode.objects[:, i], atol=1e-5)


def test_signals_are_those_that_the_brain_got(columns, episode):
    for eye, name in enumerate(("left", "right")):
        tensors = columns[f"/signals/{name}", "Tensor:data"]
        assert tensors[0][0]["shape"] == list(episode.signals.shape[2:])
        signals = np.array([tensor[0]["buffer"] for tensor in tensors]).reshape(-1, *episode.signals.shape[2:])
        np.testing.assert_array_equal(signals, episode.signals[:, eye])


def test_pictures_are_there_of_every_eye_at_every_time(columns, episode):
    for name in ("left", "right"):
        for entity, times in (("world/eyes", 256), ("perfect_lens", 256), ("scene", 4)):
            pictures = columns[f"/{entity}/{name}", "Image:buffer"]
            assert len(pictures) == times
        assert len(pictures[0][0]) == 48 * 60 * 3


def test_eyes_are_cameras_that_look_where_the_eyes_look(columns, episode):
    """A point straight ahead of an eye is on its camera's axis: R (0, 0, 1) = (cos, sin, 0) of heading + azimuth."""
    for name, azimuth in zip(("left", "right"), np.radians([30, -30]), strict=True):
        turned, angle = frames(columns, f"/world/eyes/{name}"), episode.heading + azimuth
        ahead = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
        np.testing.assert_allclose(turned @ [0, 0, 1], ahead, atol=1e-6)
        np.testing.assert_allclose(turned @ [0, -1, 0], [[0, 0, 1]] * len(turned), atol=1e-6, err_msg="up")
        np.testing.assert_allclose(np.linalg.det(turned), 1, atol=1e-5)
        camera = columns[f"/world/eyes/{name}", "Pinhole:image_from_camera"][0][0]
        assert camera[0] == pytest.approx(5 / (2 * np.tan(np.radians(33) / 2)), rel=1e-6)


def test_time_is_the_worlds(columns, episode):
    seconds = np.array([value.total_seconds() for value in columns["/contact", "time"]])
    np.testing.assert_allclose(seconds, np.arange(256) * episode.seconds, atol=1e-6)


def test_replay_writes_page_and_recording(run, columns, capsys):
    _, (page, recording) = replay.write_replay(run, seed=3, also=["rrd"])
    assert (page.suffix, recording.suffix) == (".html", ".rrd")
    assert recording.stat().st_size > 100_000
    assert [path.suffix for path in replay.write_replay(run, seed=3)[1]] == [".html"]


def test_without_the_extra_one_line_says_so(run, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "rerun", None)
    assert main(["replay", str(run.path), "--rrd"]) == 2
    assert capsys.readouterr().err == "evolve: error: --rrd needs rerun: pip install 'rhabdom[rerun]'\n"


def test_agent_and_objects_are_balls_of_their_size(columns, episode):
    plan = episode.plan
    sizes = {"agent": plan.body_radius, **dict(zip(plan.object_names, plan.object_radius, strict=True))}
    for name, radius in sizes.items():
        (half,) = columns[f"/world/bodies/{name}/{name}", "Ellipsoids3D:half_sizes"]
        np.testing.assert_allclose(half, [[radius] * 3], rtol=1e-6)


def test_it_opens_with_the_world_numbers_over_time_and_every_eye(columns, episode, tmp_path):
    shown = views(episode, tmp_path)
    assert shown["3D"] == {"/world"}
    assert shown["TimeSeries"] == {"/reward", "/action", "/contact"}
    above = ("world/eyes", "perfect_lens", "scene")
    assert shown["2D"] == {f"/{entity}/{eye}" for entity in above for eye in ("left", "right")}
    assert shown["Tensor"] == {"/signals/left", "/signals/right"}
    there = {entity for entity, _ in columns}
    assert all(any(entity.startswith(origin) for entity in there) for origins in shown.values() for origin in origins)
