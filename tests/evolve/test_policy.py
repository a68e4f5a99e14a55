"""The policy's features against a plain loop, and its files."""

import os
import pickle

import numpy as np
import pytest
import torch

from evolve.policy import SIGNAL_GAIN, PolicyConfig, build_policy, load_policy, save_policy

CONFIG = PolicyConfig(eyes=(3, 2, 3, 2, 4), neurons=8)


@pytest.fixture
def policy():
    torch.manual_seed(0)
    policy = build_policy(CONFIG)
    with torch.no_grad():  # biases start at zero, where a misplaced one would not show
        for parameter in policy.features_extractor.parameters():
            parameter += 0.1 * torch.randn_like(parameter)
    return policy


def random_observation(config, samples, seed=0):
    random = np.random.default_rng(seed)
    return {
        "eyes": random.uniform(0, 1, (samples, *config.eyes)).astype(np.float32),
        "contact": random.integers(0, 2, (samples, 1)).astype(np.float32),
        "previous_action": random.uniform(-1, 1, (samples, 2)).astype(np.float32),
    }


def features_of(policy, observation):
    with torch.no_grad():
        return policy.features_extractor({name: torch.from_numpy(array) for name, array in observation.items()}).numpy()


def layer(parameters, name, eye, x):
    return np.tanh(parameters[f"{name}.weight"][eye] @ x + parameters[f"{name}.bias"][eye, :, 0])


def test_features_are_those_of_a_loop_over_eyes_and_frames(policy):
    parameters = {name: p.detach().numpy() for name, p in policy.features_extractor.named_parameters()}
    observation = random_observation(CONFIG, 2)
    expected = []
    for sample in range(2):
        for eye in range(2):
            codes = []
            for frame in SIGNAL_GAIN * observation["eyes"][sample, :, eye].reshape(3, -1):
                for name in ("encoder.0", "encoder.2", "encoder.4"):
                    frame = layer(parameters, name, eye, frame)
                codes.append(frame)
            expected.append(layer(parameters, "temporal.0", eye, np.stack(codes, 1).ravel()))
        expected += [observation["contact"][sample], observation["previous_action"][sample]]
    # float32 sums of a few dozen terms of order 1
    np.testing.assert_allclose(features_of(policy, observation).ravel(), np.concatenate(expected), atol=2e-6)


def test_an_eye_moves_its_own_features_only(policy):
    observation = random_observation(CONFIG, 1)
    before = features_of(policy, observation)
    observation["eyes"][:, :, 1] += 0.5
    changed = (features_of(policy, observation) != before).ravel()
    assert not changed[:16].any()
    assert changed[16:32].all()
    assert not changed[32:].any()


def test_memory_costs_temporal_weights_only():
    """The same encoder sees every remembered frame; flattening the stack would give it ten times the weights."""

    def encoder_weights(memory):
        policy = build_policy(PolicyConfig((memory, 2, 3, 2, 4), 8))
        return sum(p.numel() for p in policy.features_extractor.encoder.parameters())

    assert encoder_weights(10) == encoder_weights(1)


def test_a_stored_policy_acts_the_same(policy, tmp_path):
    save_policy(policy, tmp_path / "a.safetensors")
    observation = random_observation(CONFIG, 5)
    stored = load_policy(tmp_path / "a.safetensors")
    assert stored.config == CONFIG
    np.testing.assert_array_equal(
        stored.predict(observation, deterministic=True)[0], policy.predict(observation, deterministic=True)[0]
    )
    assert [path.name for path in tmp_path.iterdir()] == ["a.safetensors"]


class Hostile:
    """Unpickling this writes a file."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return (os.system, (f"touch {self.path}",))


@pytest.mark.parametrize(
    "write", [lambda o, f: pickle.dump(o, f), lambda o, f: torch.save(o, f)], ids=["pickle", "torch"]
)
def test_a_pickle_is_refused_and_not_run(write, tmp_path):
    path, proof = tmp_path / "a.safetensors", tmp_path / "executed"
    with path.open("wb") as file:
        write({"weights": Hostile(proof)}, file)
    with pytest.raises(ValueError, match="not a rhabdom policy"):
        load_policy(path)
    assert not proof.exists()


def test_a_damaged_file_is_refused_by_name(policy, tmp_path):
    path = tmp_path / "a.safetensors"
    save_policy(policy, path)
    whole = path.read_bytes()
    for damaged in (b"", whole[:100], whole[:-1], whole.replace(b"encoder.0.weight", b"encoder.0.wright")):
        path.write_bytes(damaged)
        with pytest.raises(ValueError, match=r"a\.safetensors is not a rhabdom policy"):
            load_policy(path)
    with pytest.raises(ValueError, match="no policy at"):
        load_policy(tmp_path / "b.safetensors")
