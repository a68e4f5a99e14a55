"""Averaging and repetition of signals before the encoder, against plain loops."""

import numpy as np
import pytest
import torch

from evolve.config.settings import WiringConfig
from evolve.learning.eye_features import EyeFeatures
from evolve.learning.per_eye_layers import PerEyeLinear
from evolve.learning.policy import Brain, PolicyConfig, build_policy, learnt, load_policy, save_policy
from evolve.learning.regridding import Regridding


def regridded(signals, **wiring):
    grid = Regridding(signals.shape[-2:], WiringConfig(**wiring))
    return grid, grid(torch.from_numpy(signals)).numpy()


def test_signals_reach_the_encoder_unchanged_by_default():
    signals = torch.rand(2, 3, 4, 5)
    assert Regridding((4, 5), WiringConfig())(signals) is signals


@pytest.mark.parametrize(("height", "width", "side"), [(12, 8, 4), (4, 4, 4), (1, 8, 4)])
def test_averages_of_whole_blocks(height, width, side):
    signals = np.random.default_rng(0).random((2, 3, height, width))
    rows, columns = min(height, side), min(width, side)
    blocks = signals.reshape(2, 3, rows, height // rows, columns, width // columns).mean((3, 5))
    grid, found = regridded(signals, pool_side=side)
    assert grid.shape == (rows, columns)
    np.testing.assert_allclose(found, blocks, atol=1e-14)


@pytest.mark.parametrize(("n", "side"), [(15, 4), (7, 3), (5, 4)])
def test_averages_of_fractions_of_receptors_are_those_of_a_finer_retina(n, side):
    """Each receptor is divided into `side` equal parts with its signal, so that the intervals contain whole parts."""
    signals = np.random.default_rng(1).random((1, 1, n, n))
    parts = signals.repeat(side, -1).repeat(side, -2)
    blocks = parts.reshape(1, 1, side, n, side, n).mean((3, 5))
    np.testing.assert_allclose(regridded(signals, pool_side=side)[1], blocks, atol=1e-14)


def test_repetition():
    signals = np.random.default_rng(2).random((1, 2, 2, 3))
    grid, found = regridded(signals, repeat_side=6)
    assert grid.shape == (6, 6)
    np.testing.assert_array_equal(found, signals.repeat(3, -2).repeat(2, -1))
    unequal = regridded(np.array([[[[1.0, 2.0, 3.0, 4.0]]]]), repeat_side=15)[1]
    counts = [int((unequal[0, 0, 0] == value).sum()) for value in (1, 2, 3, 4)]
    assert (sum(counts), max(counts) - min(counts)) == (15, 1)
    assert (np.diff(unequal) >= 0).all()


def test_blurred_eyes_have_the_acuity_of_coarse_ones_and_as_many_inputs_as_before():
    signals = np.random.default_rng(3).random((1, 1, 15, 15))
    grid, found = regridded(signals, pool_side=4, repeat_side=15)
    coarse = regridded(signals, pool_side=4)[1]
    assert grid.shape == (15, 15)
    np.testing.assert_array_equal(np.unique(found.round(12)), np.unique(coarse.round(12)))
    assert np.unique(found.round(12)).size == 16


def features(shared, n_eyes=3):
    torch.manual_seed(0)
    space = PolicyConfig((2, n_eyes, 3, 2, 4), 8).observation_space()
    return EyeFeatures(space, 5, WiringConfig(shared_encoder=shared))


def seen(features, swap=False):
    torch.manual_seed(1)
    eyes = torch.rand(6, 2, 3, 3, 2, 4)
    features.adapt(eyes[:, -1].mean(dim=1, keepdim=True).expand(-1, 3, -1, -1, -1))  # the same for all eyes
    eyes = eyes.flip(2) if swap else eyes
    found = features({"eyes": eyes, "contact": torch.zeros(6, 1), "previous_action": torch.zeros(6, 2)})
    return found[:, :15].reshape(6, 3, 5).detach()


def test_eyes_with_a_shared_encoder_code_the_same_image_alike():
    """Eyes that exchange their images then exchange their features, too. With own encoders they do not."""
    torch.testing.assert_close(seen(features(True), swap=True), seen(features(True)).flip(1))
    assert (seen(features(False), swap=True) - seen(features(False)).flip(1)).abs().max() > 0.01


def test_gradients_of_shared_weights_are_sums_over_the_eyes():
    torch.manual_seed(0)
    x, weights = torch.rand(3, 4, 7), torch.rand(3, 2, 7)
    shared, own = PerEyeLinear(3, 4, 2, shared=True), PerEyeLinear(3, 4, 2)
    own.weight.data.copy_(shared.weight.data.expand(3, -1, -1))
    for layer in (shared, own):
        (weights * layer(x)).sum().backward()
    for name in ("weight", "bias"):
        alone, together = getattr(own, name).grad, getattr(shared, name).grad
        torch.testing.assert_close(together, alone.sum(0, keepdim=True))


def test_shared_encoders_have_a_fraction_of_the_weights():
    def sizes(shared):
        encoder = [tensor for name, tensor in features(shared).named_parameters()]
        return sum(tensor.numel() for tensor in encoder)

    assert sizes(False) == 3 * sizes(True)


@pytest.mark.parametrize("wiring", [WiringConfig(), WiringConfig(shared_encoder=True, pool_side=2, repeat_side=6)])
def test_stored_policies_keep_their_wiring(tmp_path, wiring):
    config = PolicyConfig((2, 3, 3, 4, 4), 8, wiring=wiring)
    policy = build_policy(config)
    save_policy(policy, tmp_path / "policy.safetensors")
    loaded = load_policy(tmp_path / "policy.safetensors")
    assert loaded.config == config
    assert config.brain == Brain(8, wiring=wiring)
    for name, tensor in learnt(policy).items():
        assert torch.equal(tensor, learnt(loaded)[name])
    assert ("wiring" in config.record()) == (wiring != WiringConfig())


@pytest.mark.parametrize(
    ("stored", "message"),
    [({"pool_side": -1}, "pool_side"), ({"sides": 3}, "sides"), ({"pool_side": 1.5}, "pool_side")],
)
def test_a_policy_with_an_impossible_wiring_is_refused(stored, message):
    config = {**PolicyConfig((2, 3, 3, 4, 4), 8).record(), "wiring": stored}
    with pytest.raises((TypeError, ValueError), match=message):
        PolicyConfig.from_record(config)
