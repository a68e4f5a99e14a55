"""Features at every step of a rollout against features of an environment's stacks of frames."""

import pytest
import torch

from evolve.learning.eye_features import EyeFeatures
from evolve.learning.policy import PolicyConfig

SEGMENTS, STEPS = 3, 6
# steps since the episode's first frame (step, segment)
AGE = torch.tensor([[0, 9, 2], [1, 9, 3], [2, 9, 0], [3, 0, 0], [4, 1, 1], [5, 2, 2]])


def features_of(memory):
    torch.manual_seed(0)
    space = PolicyConfig((memory, 2, 3, 1, 4), 8).observation_space()
    features = EyeFeatures(space, width=5).double()
    for parameter in features.parameters():
        parameter.data += 0.1 * torch.randn_like(parameter)
    return features


def unstacked(memory):
    frames = torch.rand(memory - 1 + STEPS, SEGMENTS, 2, 3, 1, 4, dtype=torch.float64)
    samples = STEPS * SEGMENTS
    return {
        "frames": frames,
        "age": AGE,
        "contact": torch.zeros(samples, 1).double(),
        "previous_action": torch.zeros(samples, 2).double(),
    }


def stacked(observation, memory):
    """Return stacks of frames, built by a plain loop.

    Each slot of a stack is a fixed number of steps back, but at most `age` steps, to the episode's first frame.
    """
    stacks = []
    for step in range(STEPS):
        for segment in range(SEGMENTS):
            back = [min(memory - 1 - slot, int(AGE[step, segment])) for slot in range(memory)]
            stacks.append(torch.stack([observation["frames"][memory - 1 + step - n, segment] for n in back]))
    known = {name: observation[name] for name in ("contact", "previous_action")}
    return {"eyes": torch.stack(stacks), **known}


@pytest.mark.parametrize("memory", [1, 2, 4])
def test_no_frame_is_remembered_from_before_the_episode(memory):
    features, observation = features_of(memory), unstacked(memory)
    found, expected = features(observation), features(stacked(observation, memory))
    torch.testing.assert_close(found, expected, rtol=0, atol=1e-12)  # the order of summation differs


@pytest.mark.parametrize("memory", [1, 4])
def test_every_weight_learns_the_same_from_both(memory):
    features, observation = features_of(memory), unstacked(memory)
    weights = torch.randn(STEPS * SEGMENTS, 13, dtype=torch.float64)
    gradients = []
    for seen in (observation, stacked(observation, memory)):
        (weights * features(seen)).sum().backward()
        gradients.append([parameter.grad.clone() for parameter in features.parameters()])
        features.zero_grad()
    for found, expected in zip(*gradients, strict=True):
        assert expected.abs().max() > 0
        torch.testing.assert_close(found, expected, rtol=0, atol=1e-10)


def test_the_slide_over_frames_has_the_derivatives_of_finite_differences():
    layer = features_of(3).temporal[0]
    codes = torch.randn(2, 5, 2 + 4, 3, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(layer.slide, (codes,))
