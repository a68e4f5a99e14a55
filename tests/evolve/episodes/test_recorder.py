"""A run of a user task from the command line: evolved, resumed, replayed, reported, exported."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import sim
from evolve.analysis.vision import SCENES, seen_and_perfect, vision
from evolve.cli.main import main
from evolve.config.assemble import to_toml
from evolve.episodes.episode import Pictures
from evolve.episodes.episode_file import load_episode, save_episode
from evolve.episodes.recorder import Recorder, record
from evolve.learning.fitness import evaluate
from evolve.learning.policy import load_policy
from evolve.report.exr_export import export_episode
from evolve.report.picture_sheet import film_of_pictures
from evolve.store.directory import Run
from evolve.store.versions import fingerprint, run_id
from sim.scene.variation import DAYLIGHT, filter_to
from tests.evolve.episodes.compared import assert_same
from tests.evolve.learning.test_task_module import small, written

BALL = Path(__file__).parents[3] / "examples" / "find_ball.py"
NAMED = f"{BALL}:FindBall"
SETTINGS = (
    *("search.population=2", "search.generations=1", "learning.n_envs=8", "learning.n_steps=16"),
    *("learning.total_steps=128", "learning.batch_size=64", "learning.n_epochs=1", "evaluation.episodes=2"),
    # Eyes that see the ball, whatever the directions of the first animals.
    *("eye.optics=false", "genome.placement_range_deg.start=40", "genome.fov_deg.start=60"),
    "genome.resolution.start=8",
    *("genome.elevation_deg.open=true", "genome.elevation_deg.low=-5", "genome.elevation_deg.high=5"),
)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """Return the path of a run of two animals, made by the command."""
    path = tmp_path_factory.mktemp("own") / "run"
    settings = [part for setting in SETTINGS for part in ("--set", setting)]
    assert main(["run", NAMED, "--preset", "quick", "--workers", "1", "--quiet", "--out", str(path), *settings]) == 0
    return path


@pytest.fixture(scope="module")
def episode(path):
    return record(Run.open(path, NAMED), radiance_every=8)


def test_the_record_is_data_that_needs_no_code(path, call):
    run = Run.open(path)
    assert len(run.candidates) == 2
    assert all(candidate.failure is None for candidate in run.candidates)
    assert len({candidate.phenotype.elevation_deg for candidate in run.candidates}) == 2
    assert call("status", path)[0] == 0
    for command in ("replay", "report", "export"):
        code, _, complaint = call(command, path)
        assert code == 2
        assert re.search(r"add --task find_ball\.py:FindBall", complaint)
    assert call("resume", path, "--task", NAMED)[0] == 0


def test_an_episode_is_what_was_seen_and_done(path, episode):
    assert len(episode) == 20
    assert (
        episode.signals.shape == episode.perfect_signals.shape == (20, episode.eyes.n_eyes, 3, *episode.eyes.resolution)
    )
    np.testing.assert_allclose(sum(episode.reward_terms.values()), episode.reward, rtol=1e-5)
    assert episode.pictures.pixels.shape == (20, 360, 480, 3)
    assert episode.plan is None
    assert episode.seconds == pytest.approx(0.1)
    # Behind perfect lenses, signals equal the recorded scene except for noise and rays. The scene of another episode
    # differs.
    other = record(Run.open(path, NAMED), seed=1)
    off = [np.square(episode.signals - seen.perfect_signals).mean() ** 0.5 for seen in (episode, other)]
    assert off[0] < 0.02
    assert off[1] > 1.5 * off[0]


def test_the_fine_picture_is_the_same_scene(episode):
    weights = episode.eyes.eye().spectral_bands.weights
    fine = np.einsum("cb,febyx->fecyx", weights, episode.radiance)
    height, width = episode.eyes.resolution
    shape = (*fine.shape[:3], height, fine.shape[3] // height, width, fine.shape[4] // width)
    coarse = fine.reshape(shape).mean(axis=(4, 6))
    # 16 rays per receptor against 16 per pixel: the position of an edge through a receptor is known to about 1/16 of
    # its step.
    np.testing.assert_allclose(coarse, episode.perfect_signals[episode.radiance_frames], atol=0.08)


@pytest.mark.slow
def test_the_same_again(path, episode):
    again = record(Run.open(path, NAMED), radiance_every=8)
    assert_same(again, episode)


def test_a_file_holds_it_without_its_code(episode, tmp_path, monkeypatch):
    save_episode(episode, tmp_path / "episode.npz")
    monkeypatch.setattr(Path, "read_text", None)
    assert_same(load_episode(tmp_path / "episode.npz"), episode)


@pytest.mark.slow
def test_replay_report_and_exr_show_it(path, call, tmp_path):
    code, out, _ = call("replay", path, "--task", NAMED, "--gif", "--json", "--out", tmp_path / "replay.html")
    assert code == 0
    facts = json.loads(out)
    assert facts["task"] == "find_ball.py:FindBall"
    assert facts["terms"].keys() == {"near"}
    with Image.open(tmp_path / "replay.gif") as moving:
        assert moving.n_frames == 20
    page = (tmp_path / "replay.html").read_text()
    assert "data:image/jpeg;base64," in page
    film = json.loads(re.search(r'<script type="application/json" class="film">(.*?)</script>', page)[1])
    assert film["pictures"]["shown"] == list(range(20))
    assert np.shape(film["action"]) == (20, 1)
    assert call("report", path, "--task", NAMED, "--out", tmp_path / "report.html")[0] == 0
    assert "a user task" in (tmp_path / "report.html").read_text()
    assert call("export", path, "--task", NAMED, "--out", tmp_path / "exr")[0] == 0
    views = sim.read_exr(sorted((tmp_path / "exr").glob("*.exr"))[0])
    assert views[0].attributes["eye_elevation_deg"] == pytest.approx(Run.open(path).best.phenotype.elevation_deg)


@pytest.mark.slow
def test_exr_files_of_a_user_task_have_run_and_poses(path, episode, tmp_path):
    """The eyes are on an arc at the front of the cart, which moves along y, and are tilted by the evolved elevation."""
    run = Run.open(path)
    file = export_episode(run, episode, tmp_path / "exr")[1]
    views = sim.read_exr(file)
    t, elevation = int(episode.radiance_frames[1]), np.radians(run.best.phenotype.elevation_deg)
    assert t == 8
    assert len(views) == run.best.phenotype.n_eyes
    for view, azimuth in zip(views, episode.azimuths, strict=True):
        known = view.attributes
        assert (known["run_id"], known["settings"]) == (run_id(path), fingerprint(to_toml(run.config)))
        x, y, z = known["eye_position_m"]
        assert (x, z) == pytest.approx((0.26 * np.cos(azimuth), 0.32))
        cart = episode.scene.positions[t, episode.scene.bodies.index("cart"), 1]
        assert y - cart == pytest.approx(0.26 * np.sin(azimuth))
        level = np.cos(elevation)
        ahead = [level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)]
        np.testing.assert_allclose(known["eye_ahead"], ahead, atol=1e-9)
        assert known["eye_up"][2] == pytest.approx(level)


def test_replay_records_it_for_rerun(path, call, tmp_path):
    pytest.importorskip("rerun", reason="the extra rerun is not installed")
    assert call("replay", path, "--task", NAMED, "--rrd", "--out", tmp_path / "replay.html")[0] == 0
    assert (tmp_path / "replay.rrd").stat().st_size > 10_000


def test_the_latest_picture_is_shown(episode):
    assert episode.gain == 1
    kept = np.arange(0, 20, 3)
    assert film_of_pictures(episode.pictures, kept)["pictures"]["shown"] == kept.tolist()
    few = Pictures(episode.pictures.times[::4], episode.pictures.pixels[::4])
    assert film_of_pictures(few, kept)["pictures"]["shown"] == [0, 0, 1, 2, 3, 3, 4]


@pytest.mark.slow
def test_eyes_are_judged_by_the_scenes_of_the_task(path):
    run = Run.open(path, NAMED)
    seen = vision(run.best.phenotype, run.config)
    assert seen.psnr_db > 60  # a perfect lens compared with itself: the same rays
    seen, perfect = seen_and_perfect(run.best.phenotype, run.config)
    assert len(seen) == SCENES
    assert len(np.unique(perfect, axis=0)) > SCENES / 2, "few eyes see the ball, whose position varies"


def test_another_task_is_refused(path, call, tmp_path):
    other = tmp_path / "find_ball.py"
    other.write_text(BALL.read_text().replace("class FindBall", "class LoseBall"))
    code, _, complaint = call("resume", path, "--task", f"{other}:LoseBall")
    assert code == 2
    assert "this run evolves find_ball.py:FindBall, not LoseBall" in complaint
    other.write_text(BALL.read_text() + "\n")
    code, _, complaint = call("replay", path, "--task", f"{other}:FindBall")
    assert code == 2
    assert "has changed since the run began" in complaint


@pytest.mark.slow
def test_light_that_varies_is_in_what_is_recorded(tmp_path):
    """The recorded scene has the same dim, reddish light as the signals."""
    films = []
    for level, kelvins in ((0.3, 2500), (1, DAYLIGHT)):
        vary = f'vary = {{"light": ({level}, {level}), "color_temperature": ({kelvins}, {kelvins})}}'
        named = written(tmp_path, "    episode_steps", f"    {vary}\n    episode_steps")
        config, animal = small("genome.placement_range_deg.start=40", "genome.fov_deg.start=60", named=named)
        if not films:
            evaluate(animal, config, 3, tmp_path / "policy")
        films.append(Recorder(animal, config, load_policy(tmp_path / "policy")).play(0, 1))
    dim, plain = films
    assert np.square(dim.signals - dim.perfect_signals).mean() ** 0.5 < 0.02
    red, blue = (dim.perfect_signals[0, :, c].mean() / plain.perfect_signals[0, :, c].mean() for c in (0, 2))
    assert red > 1.5 * blue
    shares = dim.radiance[0].mean(axis=(0, 2, 3)) / plain.radiance[0].mean(axis=(0, 2, 3))
    np.testing.assert_allclose(shares, 0.3 * filter_to(2500, 1e-9 * dim.wavelengths_nm), rtol=1e-4)
