"""Convolution over the ommatidia of compound eyes, and policies with it."""

import numpy as np
import pytest
import safetensors.torch
import torch
from gymnasium import spaces

from evolve.config.run_config import LearningConfig
from evolve.config.settings import WiringConfig
from evolve.learning.eye_features import EyeFeatures
from evolve.learning.hexagonal_layers import HexagonalLayers, neighbourhoods
from evolve.learning.policy import Brain, PolicyConfig, build_policy, load_policy, save_policy
from evolve.learning.ppo import AdaptingPPO
from evolve.learning.tensor_file import read_tensors
from sim import hexagonal_patch, make_vec_env, whole_head
from sim.envs.ommatidia_space import OmmatidiaBox
from tests.sim.envs.test_ommatidia_in_worlds import Turning

PATCH = hexagonal_patch(4, 6.0, 30.0, 20.0)


@pytest.mark.parametrize("directions", [PATCH, whole_head(15.0), PATCH[:1], PATCH[:3]], ids=len)
def test_every_ommatidium_is_in_a_neighbourhood_of_near_ones(directions):
    places = neighbourhoods(directions)
    assert set(places.ravel()) == set(range(len(directions)))
    assert places.shape[1] == min(7, len(directions))
    assert len(places) <= max(1, 0.4 * len(directions))
    apart = np.linalg.norm(directions[places] - directions[places[:, :1]], axis=-1)
    assert np.all(apart[:, 0] == 0)
    closest = np.sort(np.linalg.norm(directions[:, None] - directions[places[:, 0]], axis=-1), axis=0)
    assert np.sort(apart, axis=1) == pytest.approx(closest[: places.shape[1]].T, abs=1e-7)


def test_neighbours_are_in_the_order_of_their_azimuths():
    """The order is right, upper right, upper left, left and so on, for complete hexagons near the middle of a patch
    that looks ahead.
    """
    patch, checked = hexagonal_patch(4, 3.0), 0
    for place in neighbourhoods(patch):
        step = patch[place[1:]] - patch[place[0]]
        if np.abs(np.degrees(np.linalg.norm(step, axis=1)) - 3).max() < 0.1:
            azimuths = np.degrees(np.arctan2(step[:, 2], -step[:, 1])) % 360
            assert (azimuths - np.arange(6) * 60 + 180) % 360 == pytest.approx(180, abs=3)
            checked += 1
    assert checked >= 3


def test_the_same_pattern_in_two_places_gives_the_same_response():
    """Weights are shared: a spot on the centre of any neighbourhood excites its unit alike."""
    torch.manual_seed(0)
    layers = HexagonalLayers(PATCH, 2, torch.nn.LeakyReLU)
    centres = layers.first[:, 0]
    dark = torch.zeros(1, len(PATCH), 2)
    responses = []
    for place, centre in enumerate(centres.tolist()):
        frame = dark.clone()
        frame[0, centre] = torch.tensor([1.0, -0.5])
        responses.append(layers.convolution(layers._gathered(frame))[place, :, 0])
    torch.testing.assert_close(torch.stack(responses), responses[0].expand(len(centres), -1))
    assert responses[0].abs().max() > 0.1


def test_adaptation_removes_the_mean_of_each_ommatidium_and_keeps_noise_in_the_dark_small():
    torch.manual_seed(0)
    layers = HexagonalLayers(PATCH, 1, torch.nn.LeakyReLU)
    means = torch.linspace(0, 5, len(PATCH))[:, None]
    spreads = torch.where(torch.arange(len(PATCH))[:, None] < 30, 1e-3, 1.0)
    frames = means + spreads * torch.randn(3000, len(PATCH), 1)
    layers.adapt(frames[:1000])
    layers.adapt(frames[1000:])
    mean = layers.convolution.mean[:, :, 0]
    torch.testing.assert_close(mean, means[:, 0][layers.first], atol=0.1, rtol=0)
    assert layers.convolution.variance.unique().numel() == 1
    found = layers.convolution(layers._gathered(frames))
    dark = (layers.first < 30).all(dim=1)
    assert found[dark].std() < 0.01 * found[~dark].std()


def space_of(directions, memory=2, channels=3):
    return spaces.Dict(
        {
            "eyes": OmmatidiaBox(0.0, 2.0, (memory, len(directions), channels), directions),
            "previous_action": spaces.Box(-1, 1, (2,)),
        }
    )


def test_features_of_stacks_equal_those_of_frames_stored_once():
    torch.manual_seed(0)
    features = EyeFeatures(space_of(PATCH), width=5)
    frames = torch.rand(1 + 4, 3, len(PATCH), 3)
    stacks = torch.stack([frames[:-1], frames[1:]], dim=2).flatten(0, 1)
    last = torch.zeros(12, 2)
    found = features({"frames": frames, "age": torch.full((4, 3), 9), "previous_action": last})
    torch.testing.assert_close(found, features({"eyes": stacks, "previous_action": last}), rtol=0, atol=1e-5)
    assert found.shape == (12, 5 + 2)


@pytest.mark.parametrize("wiring", [{"pool_side": 4}, {"repeat_side": 15}])
def test_grids_of_signals_are_refused(wiring):
    with pytest.raises(ValueError, match="must be 0, ommatidia have no rows and columns"):
        EyeFeatures(space_of(PATCH), 5, WiringConfig(**wiring))


def test_a_policy_is_restored_from_its_file(tmp_path):
    torch.manual_seed(0)
    config = PolicyConfig.from_space(space_of(PATCH), Brain(8, encoder=6))
    policy = build_policy(config)
    save_policy(policy, tmp_path / "policy.safetensors")
    found = load_policy(tmp_path / "policy.safetensors")
    assert found.config == config
    seen = {"eyes": torch.rand(3, 2, len(PATCH), 3), "previous_action": torch.zeros(3, 2)}
    with torch.no_grad():
        assert torch.equal(found.predict_values(seen), policy.predict_values(seen))


def test_neighbours_in_a_file_do_not_replace_those_of_the_directions(tmp_path):
    policy = build_policy(PolicyConfig.from_space(space_of(PATCH), Brain(8)))
    save_policy(policy, tmp_path / "policy.safetensors")
    metadata, tensors = read_tensors(tmp_path / "policy.safetensors")
    assert all(tensor.is_floating_point() for tensor in tensors.values())
    tensors["features_extractor.grid.first"] = policy.features_extractor.grid.first + len(PATCH)
    (tmp_path / "policy.safetensors").write_bytes(safetensors.torch.save(tensors, metadata))
    with pytest.raises(ValueError, match=r"tensors missing or unknown: \['features_extractor.grid.first'\]"):
        load_policy(tmp_path / "policy.safetensors")


@pytest.mark.parametrize(
    "change",
    [
        {"directions": [[1.0, 0, 0]]},
        {"directions": []},
        {"directions": [[2.0, 0, 0]] * len(PATCH)},
        {"directions": [[10.0, 0.0]] * len(PATCH)},
    ],
)
def test_directions_that_do_not_fit_are_refused(change):
    record = PolicyConfig.from_space(space_of(PATCH), Brain(8)).record()
    with pytest.raises(ValueError, match="directions"):
        PolicyConfig.from_record({**record, **change})


def test_ppo_changes_the_shared_weights():
    env = make_vec_env(Turning(), n_envs=2)
    learner = AdaptingPPO(env, Brain(8, encoder=8), LearningConfig(n_steps=8, batch_size=16, n_epochs=1), 0)
    grid = learner.policy.features_extractor.grid
    before = grid.convolution.weight.detach().clone()
    learner.learn(16)
    assert not torch.equal(before, grid.convolution.weight)
    assert grid.convolution.seen > 0
    env.close()
