"""The player's film shows the episode frame by frame on the ground plan of its world."""

import re
from dataclasses import replace

import numpy as np
import pytest

import sim
from evolve.episodes.episode import Pictures
from evolve.episodes.recorder import Recorder
from evolve.learning.fitness import evaluate
from evolve.learning.policy import load_policy
from evolve.report.picture import display
from evolve.report.player import episode_sentence, write_player
from sim.worlds.ground_plan import GroundPlan
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


def test_images_follow_the_agent_next_to_the_plan(run, episode, tmp_path):
    pixels = np.zeros((3, 36, 48, 3), np.uint8)
    pixels[1], pixels[2] = 100, 200
    pictured = replace(episode, pictures=Pictures(np.array([0, 100, 200]), pixels))
    text = write_player(pictured, tmp_path / "replay.html").read_text()
    film = film_of(text)
    assert {"bounds", "walls", "position"} <= film.keys(), "the plan is still there"
    assert [film["pictures"]["shown"][frame] for frame in (0, 99, 100, 199, 200, 255)] == [0, 0, 1, 1, 2, 2]
    classes = [value for tag, name, value in Page(text).attributes if (tag, name) == ("canvas", "class")]
    assert classes == ["pictures", "world", "rewards"]


def test_eyes_are_shown_large_and_by_their_names(episode, tmp_path):
    text = write_player(episode, tmp_path / "replay.html").read_text()
    looks = re.findall(r'data-eye="\d+"[^>]*? data-look="(\w+)"', text)
    assert len(looks) == 2 * 2
    assert all(float(re.search(rf'data-look="{look}"\]{{width:([\d.]+)px', text)[1]) >= 200 for look in looks)
    assert re.findall(r'<span class="name">(\w+)</span>', text) == ["left", "right"] == list(episode.eyes.names())


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


@pytest.mark.parametrize(("mode", "name"), [("evaluation", "Evaluation"), ("test", "Test")])
def test_the_sentence_names_the_kind_of_episode(episode, mode, name):
    assert episode_sentence(replace(episode, mode=mode)).startswith(f"{name} episode with seed {episode.seed}: ")


def test_long_films_of_many_receptors_are_thinned(episode, tmp_path):
    fine = np.repeat(np.repeat(episode.signals, 20, axis=-1), 20, axis=-2)
    phenotype = replace(episode.phenotype, resolution=(80, 100))
    many = replace(episode, signals=fine, perfect_signals=fine, phenotype=phenotype)
    film = film_of(write_player(many, tmp_path / "replay.html").read_text())
    steps = np.diff(film["times"])
    assert steps[0] > 0.2
    assert steps[:-1] == pytest.approx(steps[0])
    assert film["times"][-1] == pytest.approx(255 * 0.2), "the last action's time includes the final return"
    assert film["total"][-1] == pytest.approx(many.reward.sum(), abs=1e-3)
    assert len(film["times"]) * fine[0, :, 0].size * 3 <= 1.6e6
    assert len(film["position"]) == len(film["total"]) == len(film["times"])


@pytest.mark.slow
def test_a_task_may_name_no_reward(tmp_path):
    """A user task may return no reward terms. The player then shows a return of zero at every moment."""
    config, animal = small("genome.placement_range_deg.start=40", named=written(tmp_path, NEAR, "{}"))
    assert evaluate(animal, config, 3, tmp_path / "policy").failure is None
    episode = Recorder(animal, config, load_policy(tmp_path / "policy")).play(0, 1)
    assert episode.reward_terms == {}
    text = write_player(episode, tmp_path / "replay.html").read_text()
    shown = film_of(text)
    assert shown["terms"] == {}
    assert shown["total"] == [0.0] * len(shown["times"]) == [0.0] * 20
    assert "20 actions, return 0." in text


def test_the_plan_is_the_world(episode):
    assert episode.plan.bounds == pytest.approx((-13, -11, 13, 11))  # 11 x 9 cells of 2 m and walls of 2 m
    assert episode.plan.object_radius == (0.5, 0.5, 0.5)
    assert episode.gain == pytest.approx(1 / 0.3**2)
    assert episode.seconds == pytest.approx(0.2)


def test_ground_plan_of_the_maze_leaves_free_cells_free():
    world = sim.build_world("navigation")
    spots, plan = world.agent_spawn, GroundPlan.from_world(world, np.zeros(2))
    gap = np.abs(spots[:, None] - plan.walls[None, :, :2]) - plan.walls[None, :, 2:]
    assert (gap.max(axis=-1) > 0.5).all()  # a cell's centre is 1 m from the next wall
    x0, y0, x1, y1 = plan.bounds
    walls = 4 * plan.walls[:, 2:].prod(axis=1).sum()
    assert 0.3 < walls / ((x1 - x0) * (y1 - y0)) < 0.7
