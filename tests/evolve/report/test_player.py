"""The player's film is the episode, frame by frame, on the ground plan of its world."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import sim
from evolve.analysis.filmed_episode import film as filmed
from evolve.learning.fitness import evaluate
from evolve.learning.policy import load_policy
from evolve.report.ground_plan import GroundPlan
from evolve.report.picture import display
from evolve.report.player import write_player
from evolve.report.replay import solved
from tests.evolve.learning.test_task_module import small, written
from tests.evolve.report.reported import Page, film_of, picture

NEAR = '{"near": -abs(data.mocap_pos[0, 1] - data.qpos[0]) / 10}'


def test_film_is_the_episode(run, episode, content):
    film = film_of(content)
    assert len(film["times"]) == len(episode) == 256
    assert film["times"][:3] == [0, 0.2, 0.4]
    np.testing.assert_allclose(film["position"], episode.position, atol=6e-4)
    np.testing.assert_allclose(film["speed"], 5 * (episode.action[:, 0] + 1), atol=6e-4)
    turned = np.degrees(np.diff(np.unwrap(episode.heading)))
    np.testing.assert_allclose(film["turn_deg"][:-1], turned, atol=2e-2)
    np.testing.assert_allclose(film["objects"], episode.objects[..., :2], atol=6e-4)
    assert film["total"][-1] == pytest.approx(episode.reward.sum(), abs=1e-3)
    assert film["total"][0] == pytest.approx(episode.reward[0], abs=1e-3)
    np.testing.assert_allclose(film["terms"]["progress"], np.cumsum(episode.reward_terms["progress"]), atol=1e-3)
    assert np.degrees(film["fov"]) == pytest.approx(33.0)
    assert np.degrees(film["azimuths"]) == pytest.approx([30, -30], abs=1e-3)


def test_film_shows_what_each_eye_signalled(episode, content):
    film = film_of(content)
    height, width = episode.signals.shape[-2:]
    for sheet, signals, gain in (
        ("seen", episode.signals, 1 / 0.3**2),
        ("perfect", episode.perfect_signals, 1.0),
    ):
        pixels = picture(film["sheets"][sheet])
        for time, eye in ((0, 0), (0, 1), (100, 1), (255, 0)):
            row, column = divmod(time, film["sheet_columns"])
            x = (column * 2 + eye) * width
            cell = pixels[row * height : (row + 1) * height, x : x + width]
            np.testing.assert_array_equal(cell, display(signals[time, eye], gain))


def test_events_are_marked_when_they_happen(episode, content):
    goal = np.flatnonzero(episode.reward_terms["goal"]).tolist()
    adversary = np.flatnonzero(episode.reward_terms["adversary"]).tolist()
    expected = sorted([(t, "goal") for t in goal] + [(t, "adversary") for t in adversary])
    assert [tuple(event) for event in film_of(content)["events"]] == expected


def test_player_is_a_page_of_its_own(run, episode, tmp_path):
    path = write_player(episode, tmp_path / "replay.html")
    text = path.read_text()
    page = Page(text)
    assert page.tags["canvas"] == 2 + 2 * 2
    assert film_of(text)["total"][-1] == pytest.approx(episode.reward.sum(), abs=1e-3)
    assert not re.search(r"https?:", text)


def test_long_films_of_many_receptors_are_thinned(episode, tmp_path):
    fine = np.repeat(np.repeat(episode.signals, 20, axis=-1), 20, axis=-2)
    phenotype = replace(episode.phenotype, resolution=(80, 100))
    many = replace(episode, signals=fine, perfect_signals=fine, phenotype=phenotype)
    film = film_of(write_player(many, tmp_path / "replay.html").read_text())
    steps = np.diff(film["times"])
    assert steps[0] > 0.2
    assert steps[:-1] == pytest.approx(steps[0])
    assert film["times"][-1] == pytest.approx(255 * 0.2), "with the last action comes all that was earned"
    assert film["total"][-1] == pytest.approx(many.reward.sum(), abs=1e-3)
    assert len(film["times"]) * fine[0, :, 0].size * 3 <= 1.6e6
    assert len(film["position"]) == len(film["total"]) == len(film["times"])


@pytest.mark.slow
def test_a_task_may_name_no_reward(tmp_path):
    """One of somebody's own; what it earned is then nothing, at every moment."""
    config, animal = small("genome.placement_range_deg.start=40", named=written(tmp_path, NEAR, "{}"))
    assert evaluate(animal, config, 3, tmp_path / "policy").failure is None
    episode = filmed(animal, config, load_policy(tmp_path / "policy"), 0, 1, 8)
    assert episode.reward_terms == {}
    text = write_player(episode, tmp_path / "replay.html").read_text()
    shown = film_of(text)
    assert shown["terms"] == {}
    assert shown["total"] == [0.0] * len(shown["times"]) == [0.0] * 20
    assert "20 actions, return 0." in text


def test_stage_is_the_world(episode):
    stage = GroundPlan.of(episode)
    assert stage.bounds == pytest.approx((-13, -11, 13, 11))  # 11 x 9 cells of 2 m and walls of 2 m
    assert stage.object_radius == (0.5, 0.5, 0.5)
    assert stage.gain == pytest.approx(1 / 0.3**2)
    assert stage.seconds == pytest.approx(0.2)


def test_ground_plan_of_the_maze_leaves_free_cells_free(episode):
    stage = GroundPlan.of(replace(episode, task="navigation"))
    spots = sim.build_world("navigation").agent_spawn
    gap = np.abs(spots[:, None] - stage.walls[None, :, :2]) - stage.walls[None, :, 2:]
    assert (gap.max(axis=-1) > 0.5).all()  # a cell's centre is 1 m from the next wall
    x0, y0, x1, y1 = stage.bounds
    walls = 4 * stage.walls[:, 2:].prod(axis=1).sum()
    assert 0.3 < walls / ((x1 - x0) * (y1 - y0)) < 0.7


@pytest.mark.parametrize(
    ("goal", "adversary", "after", "expected"),
    [
        ([0, 10, 0], [0, 0, -10], [False] * 3, True),
        ([0, 0, 10], [0, -10, 0], [False, True, False], False),
        ([0, 10, 10], [0, -10, 0], [False, True, False], False),
        ([0, 10, 0], [0, -10, -10], [False, False, True], True),
        ([0, 10, 0], [0, -10, -10], None, True),
        ([0, 0, 0], [0, 0, 0], [False] * 3, False),
    ],
)
def test_an_episode_is_solved_if_the_first_thing_reached_is_a_goal(goal, adversary, after, expected):
    """Also where one action reaches both."""
    told = {"reward_terms": {"goal": np.array(goal), "adversary": np.array(adversary)}}
    assert solved(SimpleNamespace(**told, adversary_first=None if after is None else np.array(after))) is expected
