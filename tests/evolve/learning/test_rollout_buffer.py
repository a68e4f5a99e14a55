"""The rollout buffer against stable-baselines3's own, which stores every stacked observation."""

import numpy as np
import pytest
import torch
from stable_baselines3.common.buffers import DictRolloutBuffer

from evolve.learning.policy import build_policy
from evolve.learning.rollout_buffer import FrameRolloutBuffer
from tests.evolve.learning.bright_spot import BrightSpot

STEPS, WORLDS = 24, 6


@pytest.fixture(scope="module")
def buffers():
    """Return two buffers with the same rollout: episodes end inside it, and it starts in the middle of others."""
    worlds = BrightSpot(WORLDS, memory=5)
    worlds.limit = 7
    ours, theirs = (
        cls(STEPS, worlds.observation_space, worlds.action_space, "cpu", gae_lambda=0.9, gamma=0.95, n_envs=WORLDS)
        for cls in (FrameRolloutBuffer, DictRolloutBuffer)
    )
    random, observation, started = np.random.default_rng(1), worlds.reset(), np.ones(WORLDS, bool)
    for step in range(-3, STEPS):
        action = random.uniform(-1, 1, (WORLDS, 2)).astype(np.float32)
        following, reward, done, _ = worlds.step(action)
        value, log_prob = (torch.from_numpy(random.normal(size=shape)).float() for shape in ((WORLDS, 1), WORLDS))
        for buffer in (ours, theirs):
            if step >= 0:
                buffer.add(observation, action, reward, started, value, log_prob)
        observation, started = following, done
    for buffer in (ours, theirs):
        buffer.compute_returns_and_advantage(torch.ones(WORLDS, 1), done)
    return ours, theirs


def rows(batches, features):
    """Return samples in a canonical order, with features, actions, values, log_probs, advantages and returns
    concatenated.
    """
    table = []
    for batch in batches:
        with torch.no_grad():
            seen = features(batch.observations)
        others = (batch.old_values, batch.old_log_prob, batch.advantages, batch.returns)
        table.append(torch.cat([seen, batch.actions, *(column[:, None] for column in others)], 1).numpy())
    table = np.concatenate(table)
    return table[np.argsort(table[:, -3])]


def test_samples_are_those_of_the_stacked_buffer(buffers):
    """Samples have the same windows of frames at starts of episodes, within episodes and across the rollout's edge, and
    the same other values.
    """
    ours, theirs = buffers
    torch.manual_seed(0)
    features = build_policy_features(theirs.observation_space)
    # float32 through four layers; a frame from the wrong episode changes features by 0.01 and more
    np.testing.assert_allclose(rows(ours.get(48), features), rows(theirs.get(48), features), atol=2e-6)


def build_policy_features(space):
    from evolve.learning.policy import PolicyConfig

    extractor = build_policy(PolicyConfig(space["eyes"].shape, 8)).features_extractor
    with torch.no_grad():
        for parameter in extractor.parameters():
            parameter += 0.2 * torch.randn_like(parameter)
    return extractor


def test_mini_batches_have_the_size_asked_for_and_are_shuffled(buffers):
    ours, _ = buffers
    first, second = list(ours.get(48)), list(ours.get(48))
    assert [len(batch.actions) for batch in first] == [48] * 3
    assert not torch.equal(first[0].actions, second[0].actions)


def test_a_frame_is_kept_once(buffers):
    ours, theirs = buffers
    assert ours.frames.nbytes < 1.2 * theirs.observations["eyes"].nbytes / 5
