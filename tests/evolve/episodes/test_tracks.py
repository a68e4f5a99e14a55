"""Tracks from above are those of recorded episodes, and all animals start in the same states."""

import contextlib
from dataclasses import replace

import numpy as np
import pytest

from evolve.config.assemble import assemble
from evolve.episodes.tracks import _Watcher, tracks
from evolve.learning.animal_task import animal_task
from evolve.learning.final_figures import UnfitPolicy, final_episodes
from evolve.learning.played_episodes import Episodes
from evolve.learning.policy import PolicyConfig, build_policy, load_policy
from sim.envs.prepared_task import PreparedTask
from tests.evolve.small_run import PHENOTYPE

MAZES = ("world.layouts=family", "world.family_seed=3", "eye.optics=false", "eye.rays_per_receptor=1")


def policy_of(phenotype):
    """Return an untrained policy for an animal."""
    shape = (phenotype.memory_frames, phenotype.n_eyes, 3, *phenotype.resolution)
    return build_policy(PolicyConfig(shape, phenotype.neurons))


def test_a_track_is_that_of_the_recorded_episode(run, episode):
    candidate = run.candidate(None)
    (track,) = tracks(candidate.phenotype, run.config, load_policy(run.policy_path(candidate.id)), 3, 1)
    np.testing.assert_array_equal(track.position, episode.position)
    np.testing.assert_array_equal(track.objects, episode.objects[..., :2])
    assert track.total == pytest.approx(episode.reward.sum(), rel=1e-6)
    assert track.solved == episode.solved
    assert track.plan.bounds == episode.plan.bounds
    steps = np.hypot(*np.diff(episode.position, axis=0).T)
    assert track.length == pytest.approx(steps.sum())


def test_animals_with_different_eyes_start_in_the_same_places_of_unseen_mazes():
    config = assemble("maze", assignments=MAZES)
    other = replace(PHENOTYPE, n_eyes=3, resolution=(2, 3))
    policy = policy_of(PHENOTYPE)
    some, others = (
        tracks(PHENOTYPE, config, policy, 7, 6, "test"),
        tracks(other, config, policy_of(other), 7, 6, "test"),
    )
    assert len({track.plan.bounds for track in some}) > 1
    for one, two in zip(some, others, strict=True):
        np.testing.assert_array_equal(one.position[0], two.position[0])
        assert one.plan.bounds == two.plan.bounds
        low, high = np.reshape(one.plan.bounds, (2, 2))
        assert ((one.position > low) & (one.position < high)).all()
    final = final_episodes(PHENOTYPE, config, policy, 7, 6)
    np.testing.assert_allclose([track.total for track in some], final.returns, rtol=1e-6)
    starts = [[tuple(track.position[0]) for track in tracks(PHENOTYPE, config, policy, 7, 6, mode)]
              for mode in ("training", "evaluation", "test")]  # fmt: skip
    assert starts[0] != starts[1] != starts[2]


def test_another_animals_policy_is_refused():
    config = assemble("detection", assignments=MAZES[2:])
    with pytest.raises(UnfitPolicy, match="its eyes have the shape"):
        tracks(PHENOTYPE, config, policy_of(replace(PHENOTYPE, resolution=(2, 3))), 0, 1)


def test_a_track_ends_with_its_episode():
    config = assemble("detection", assignments=MAZES[2:])
    prepared = PreparedTask(animal_task(PHENOTYPE, config))
    with contextlib.closing(prepared.vec_env(2, 0, PHENOTYPE.memory_frames)) as worlds:
        worlds.reset()
        watcher = _Watcher(worlds, prepared.task.agents()[0].kinds[0].mounts[0])
        for playing in ([True, True], [True, True], [True, False]):
            watcher.watch(np.array(playing))
            worlds.step(np.full((2, 2), 0.5, np.float32))
    found = watcher.tracks(Episodes(np.array([1.0, 2.0]), np.array([1, 0])))
    assert [len(track.position) for track in found] == [len(track.objects) for track in found] == [3, 2]
    assert [(track.total, track.solved) for track in found] == [(1.0, True), (2.0, False)]
