"""A recorded episode agrees with the worlds in which it was played, and with its file."""

import contextlib
import dataclasses
import io
import json
import math
import os
import pickle
import zipfile

import numpy as np
import pytest
import torch

import evolve
import sim
from evolve.config.run_config import WorldConfig
from evolve.episodes import episode_file
from evolve.episodes.episode_file import load_episode, save_episode
from evolve.episodes.recorder import Recorder, record
from evolve.learning.animal_task import animal_task
from evolve.learning.policy import PolicyConfig, build_policy, load_policy, save_policy
from evolve.report import exr_export, replay
from evolve.store.directory import RunError
from sim.envs.prepared_task import PreparedTask
from tests.evolve.episodes.compared import assert_same
from tests.evolve.first_form import of_first_form
from tests.evolve.small_run import PHENOTYPE, small_config


def cut(episode, n):
    """Return the episode's first n actions."""
    arrays = {k: v[:n] for k, v in vars(episode).items() if isinstance(v, np.ndarray) and len(v) == len(episode)}
    terms, beside = ({name: a[:n] for name, a in of.items()} for of in (episode.reward_terms, episode.beside))
    scene = {k: v[:n] for k, v in vars(episode.scene).items() if isinstance(v, np.ndarray)}
    moved = dataclasses.replace(episode.scene, **scene)
    return dataclasses.replace(episode, **arrays, reward_terms=terms, beside=beside, scene=moved)


def test_shapes(episode):
    t = len(episode)
    assert t == 256
    assert episode.signals.shape == episode.perfect_signals.shape == (t, 2, 3, 4, 5)
    assert episode.radiance_frames.tolist() == [0, 64, 128, 192]
    assert episode.radiance.shape == (4, 2, len(episode.wavelengths_nm), 48, 60)
    assert episode.position.shape == (t, 2)
    assert episode.objects.shape == (t, 3, 3)


def test_what_happens_in_it_is_consistent(episode):
    np.testing.assert_allclose(sum(episode.reward_terms.values()), episode.reward, rtol=1e-6)
    np.testing.assert_array_equal(episode.beside["contact"][:, 0] > 0, episode.reward_terms["contact"] < 0)
    turns = np.diff(np.unwrap(episode.heading))
    np.testing.assert_allclose(turns, np.pi / 4 * episode.action[:-1, 1], atol=1e-6)
    calm = (episode.reward_terms["goal"] == 0)[:-1]  # steps in which the goal does not move
    distance = np.linalg.norm(episode.objects[:, 0, :2] - episode.position, axis=1)
    progress = -1.5 * np.diff(distance)
    np.testing.assert_allclose(episode.reward_terms["progress"][:-1][calm], progress[calm], atol=1e-6)


def test_signals_are_the_scene_at_the_recorded_pose_plus_noise(episode):
    """Receptors see the mean of the radiance ahead of them. The noise has the eye's standard deviation (0.05)."""
    residual = episode.signals - episode.perfect_signals
    assert abs(residual.mean()) < 0.01
    # one ray per receptor against sixteen: aliasing at edges adds to the noise, but a wrong pose adds 0.1 and more
    assert np.sqrt((residual**2).mean()) < 0.08
    weights = episode.eyes.eye().spectral_bands.weights
    fine = np.einsum("cb,febyx->fecyx", weights, episode.radiance)
    coarse = fine.reshape(4, 2, 3, 4, 12, 5, 12).mean(axis=(4, 6))
    np.testing.assert_allclose(coarse, episode.perfect_signals[episode.radiance_frames], atol=0.05)


def test_same_seed_same_episode(run, episode):
    again, other = record(run, 0, seed=3, radiance_every=64), record(run, 0, seed=4, radiance_every=64)
    assert_same(again, episode)
    assert not np.array_equal(episode.position, other.position)


def test_file_holds_the_episode(episode, tmp_path):
    save_episode(episode, tmp_path / "episode.npz")
    stored = load_episode(tmp_path / "episode.npz")
    assert_same(stored, episode)
    assert [path.name for path in tmp_path.iterdir()] == ["episode.npz"]


def test_a_file_holds_nothing_else_with_the_first_numpy_2(episode, tmp_path, monkeypatch):
    """NumPy 2.0's savez treats every argument as an array."""
    save = np.savez_compressed

    def of_2_0(file, **arrays):
        with zipfile.ZipFile(file, "w") as archive:
            for name, value in arrays.items():
                content = io.BytesIO()
                np.save(content, value)
                archive.writestr(f"{name}.npy", content.getvalue())

    monkeypatch.setattr(np, "savez_compressed", of_2_0)
    save_episode(episode, tmp_path / "then.npz")
    monkeypatch.setattr(np, "savez_compressed", save)
    save_episode(episode, tmp_path / "now.npz")
    with np.load(tmp_path / "then.npz") as then, np.load(tmp_path / "now.npz") as now:
        assert set(then) == set(now)
    assert load_episode(tmp_path / "then.npz").seed == episode.seed


def test_a_file_that_is_no_episode_is_refused(episode, tmp_path):
    path = tmp_path / "episode.npz"
    save_episode(episode, path)
    whole = path.read_bytes()
    np.savez(tmp_path / "pickled.npz", rest=np.array([{}], dtype=object))
    for content in (b"", whole[: len(whole) // 2], pickle.dumps({}), (tmp_path / "pickled.npz").read_bytes()):
        path.write_bytes(content)
        with pytest.raises(ValueError, match=r"episode\.npz contains no episode"):
            load_episode(path)


def test_candidates_that_are_not_there_are_named(run, tmp_path):
    with pytest.raises(RunError, match="there is no candidate 7"):
        record(run, 7)
    policy = run.policy_path(0)
    whole = policy.read_bytes()
    try:
        policy.write_bytes(pickle.dumps({}))
        with pytest.raises(RunError, match=f"{policy.name} is not a rhabdom policy"):
            record(run)
    finally:
        policy.write_bytes(whole)


@pytest.mark.slow
def test_an_agent_can_be_taken_out_of_its_run(run):
    """The public names of the package are enough to obtain the agent of a run, as in the tutorial."""
    opened = evolve.Run.open(run.path)
    best = opened.best
    worlds = sim.make_vec_env(
        opened.config.task, best.phenotype.eyes(opened.config.eye), 2, seed=0, memory=best.phenotype.memory_frames
    )
    policy = evolve.load_policy(opened.policy_path(best.id))
    actions, _ = policy.predict(worlds.reset(), deterministic=True)
    assert actions.shape == (2, 2)
    assert np.isfinite(worlds.step(actions)[1]).all()


def test_policies_of_another_animal_or_damaged_are_named(run):
    policy = run.policy_path(0)
    whole = policy.read_bytes()
    try:
        seen = load_policy(policy).observation_space["eyes"].shape
        save_policy(build_policy(PolicyConfig((*seen[:-1], seen[-1] + 1), 8)), policy)
        with pytest.raises(RunError, match=f"{policy.name} is another animal's: its eyes have the shape "):
            record(run)
        for damage, named in (
            (math.nan, "it contains numbers that are not finite"),
            (3e38, "is damaged: policy's actions"),
        ):
            policy.write_bytes(whole)
            broken = load_policy(policy)
            with torch.no_grad():
                for tensor in broken.parameters():
                    tensor.fill_(damage)
            save_policy(broken, policy)
            with pytest.raises(RunError, match=f"{policy.name}.*{named}"):
                record(run)
    finally:
        policy.write_bytes(whole)


@pytest.mark.slow
def test_perfect_eyes_are_shown_the_same_light():
    """A tenth of the light on the course has been reflected more than once. An eye in dim light receives it, and the
    images of the episode contain it.
    """
    config = small_config("navigation", noise_sigma=0.02)
    config = dataclasses.replace(config, eye=dataclasses.replace(config.eye, rays_per_receptor="auto"))
    animal = dataclasses.replace(PHENOTYPE, resolution=(4, 6), fov_deg=60.0)
    recorder = Recorder(animal, config, build_policy(PolicyConfig((3, 2, 3, 4, 6), 16)), radiance_every=1)
    prepared = PreparedTask(animal_task(animal, config))
    with contextlib.closing(prepared.vec_env(1, 0)) as worlds:
        worlds.reset()
        assert worlds.renderer.fidelity.light == "all"
        poses, ones = worlds.simulation.poses(), np.ones((1, worlds.renderer.eye.bands), np.float32)
        views = recorder._perfect_views(prepared, worlds.simulation, [poses], ones)
        exact = worlds.renderer.signals(poses)
    assert views["perfect_signals"].mean() == pytest.approx(exact.mean(), rel=0.04)
    weights = worlds.renderer.eye.spectral_bands.weights
    seen = np.tensordot(weights, views["radiance"].mean(axis=(0, 1, 3, 4)), axes=1).mean()
    assert seen == pytest.approx(exact.mean(), rel=0.04)


def test_exr_files_hold_what_the_eyes_saw(run, episode, tmp_path):
    files = exr_export.export_episode(run, episode, tmp_path / "exr")
    assert [path.name for path in files] == [f"candidate000000_seed3_t{t:04}.exr" for t in (0, 64, 128, 192)]
    left, right = sim.read_exr(files[1])
    assert (left.name, right.name) == ("left", "right")
    np.testing.assert_array_equal(left.radiance, episode.radiance[1, 0])
    np.testing.assert_array_equal(right.receptors, episode.signals[64, 1])
    assert left.attributes["position_m"] == episode.position[64].tolist()
    assert left.attributes["eye_azimuth_deg"] == pytest.approx(30)
    red, green, blue = left.peaks_nm  # previews choose their colours by these peaks
    assert red > green > blue


def test_replay_sums_up_and_writes_a_page(run, episode):
    played, (page,) = replay.write_replay(run, seed=3)
    table = replay.episode_table(played)
    printed = dict(line.split(None, 1) for line in table.splitlines() if len(line.split()) == 2)
    assert replay.episode_facts(played)["return"] == pytest.approx(float(printed["return"]), abs=0.01)
    assert float(printed["return"]) == pytest.approx(episode.reward.sum(), abs=0.01)
    assert sum(float(printed[name]) for name in ("progress", "goal", "adversary", "contact")) == pytest.approx(
        episode.reward.sum(), abs=0.03
    )
    assert printed["actions"] == "256"
    assert page.parent == run.path
    assert page.read_text().startswith("<!doctype html>")


def test_a_maze_is_that_which_was_walked_through(episode, tmp_path):
    """The maze of the world is in the file and in the ground plan. Files that are older than this setting show the
    first maze.
    """
    world = WorldConfig(mazes=2, unseen=True)
    columns, rest = of_first_form(dataclasses.replace(episode, task="maze", world=world))
    columns["objects"] = columns["objects"][:, :0]
    np.savez(tmp_path / "walked.npz", rest=np.array(json.dumps(rest)), **columns)
    again = load_episode(tmp_path / "walked.npz")
    assert again.world == world
    model = sim.build_world("maze", seed=1, mazes=2).model
    walls = [i for i in range(model.ngeom) if model.geom(i).name.startswith("wall")]
    shown, y = again.plan, model.geom_pos[walls, 1]
    north = y[y > 0] if again.position[0, 1] > 0 else y[y < 0]
    np.testing.assert_array_equal(shown.walls[:, 1], north)
    assert shown.bounds[3] - shown.bounds[1] == pytest.approx(26.0)
    (x_min, low, _, high), alone = shown.goal_region, sim.build_world("maze").goal_region
    assert (x_min, high - low) == pytest.approx((alone[0], alone[3] - alone[1]))
    del rest["world"]
    np.savez(tmp_path / "old.npz", rest=np.array(json.dumps(rest)), **columns)
    assert load_episode(tmp_path / "old.npz").world == WorldConfig()


def test_files_of_worlds_out_of_range_are_refused(episode, tmp_path):
    """The error names the setting, before any world is built."""
    columns, rest = of_first_form(dataclasses.replace(episode, task="maze", world=WorldConfig(mazes=10**9)))
    np.savez(tmp_path / "large.npz", rest=np.array(json.dumps(rest)), **columns)
    with pytest.raises(ValueError, match=r"large\.npz contains no episode: world\.mazes = 1000000000: must be"):
        load_episode(tmp_path / "large.npz")


def test_archives_that_would_fill_the_memory_are_refused(tmp_path, monkeypatch):
    """The size is read from the directory of the archive, before anything is unpacked. A pipe is refused, too."""
    bomb = tmp_path / "bomb.npz"
    np.savez_compressed(bomb, returns=np.zeros(2**22))
    monkeypatch.setattr(episode_file, "MOST_BYTES", 2**20)
    with pytest.raises(ValueError, match=r"bomb.npz contains no episode: it would unpack to 33,554,\d+ bytes"):
        load_episode(bomb)
    os.mkfifo(tmp_path / "pipe.npz")
    with pytest.raises(ValueError, match=r"pipe.npz contains no episode"):
        load_episode(tmp_path / "pipe.npz")


def test_an_episode_of_a_run_in_little_light_is_dark_throughout(run):
    """The signals of a perfect lens are dim, too: they differ from the eye's signals only by the noise."""
    dusk = dataclasses.replace(run.config.world, least_light=1e-3)
    dark = dataclasses.replace(run, config=dataclasses.replace(run.config, world=dusk))
    plain, dim = (record(one, 0, seed=5, radiance_every=64) for one in (run, dark))
    level = dim.perfect_signals[0].mean() / plain.perfect_signals[0].mean()
    assert 1e-3 <= level < 0.9
    assert dim.radiance[0].mean() / plain.radiance[0].mean() == pytest.approx(level, rel=1e-5)
    assert np.sqrt(np.square(dim.signals - dim.perfect_signals).mean()) < 0.08


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
def test_an_episode_is_solved_if_the_first_thing_reached_is_a_goal(episode, tmp_path, goal, adversary, after, expected):
    """The rule also holds for files of the first format, and if one action reaches a goal and an adversary."""
    episode = cut(episode, len(goal))
    told = {"goal": np.array(goal), "adversary": np.array(adversary)}
    arrays, rest = of_first_form(dataclasses.replace(episode, reward_terms=episode.reward_terms | told), after)
    np.savez(tmp_path / "then.npz", **arrays, rest=np.array(json.dumps(rest)))
    assert load_episode(tmp_path / "then.npz").solved is expected
