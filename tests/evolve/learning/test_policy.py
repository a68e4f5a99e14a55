"""The policy's features against a plain loop, and its files."""

import json
import os
import pickle
from dataclasses import asdict

import numpy as np
import pytest
import safetensors.torch
import torch
from gymnasium import spaces
from safetensors.torch import save_file

from evolve.config.assemble import assemble
from evolve.genome.genotype import Genotype
from evolve.genome.phenotype import develop
from evolve.learning import policy as policy_module
from evolve.learning.eye_features import UNITS
from evolve.learning.per_eye_layers import CONTRAST
from evolve.learning.policy import Brain, EyePolicy, PolicyConfig, build_policy, learnt, load_policy, save_policy
from evolve.store.regular_files import StrangeFileError

CONFIG = PolicyConfig(eyes=(3, 2, 3, 2, 4), neurons=8)


@pytest.fixture
def policy():
    torch.manual_seed(0)
    policy = build_policy(CONFIG)
    with torch.no_grad():  # biases start at zero, which would hide a misplaced one
        for parameter in policy.features_extractor.parameters():
            parameter += 0.1 * torch.randn_like(parameter)
        for _ in range(2):  # signals have an arbitrary mean and spread per receptor
            policy.features_extractor.adapt(torch.rand(50, *CONFIG.eyes[1:]) * torch.rand(CONFIG.eyes[1:]) + 0.3)
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
    drive = parameters[f"{name}.weight"][eye] @ x + parameters[f"{name}.bias"][eye, :, 0]
    return np.where(drive > 0, drive, 0.01 * drive)


def test_features_are_those_of_a_loop_over_eyes_and_frames(policy):
    parameters = {name: p.detach().numpy() for name, p in learnt(policy.features_extractor).items()}
    observation = random_observation(CONFIG, 2)
    expected = []
    for sample in range(2):
        for eye in range(2):
            codes = []
            mean, variance = (parameters[f"encoder.0.{name}"][eye, :, 0] for name in ("mean", "variance"))
            for frame in (observation["eyes"][sample, :, eye].reshape(3, -1) - mean) * CONTRAST / np.sqrt(variance):
                for name in ("encoder.0", "encoder.2", "encoder.4"):
                    frame = layer(parameters, name, eye, frame)
                codes.append(frame)
            expected.append(layer(parameters, "temporal.0", eye, np.stack(codes, 1).ravel()))
        expected += [observation["contact"][sample], observation["previous_action"][sample]]
    # float32 sums of a few dozen terms of order 1
    np.testing.assert_allclose(features_of(policy, observation).ravel(), np.concatenate(expected), atol=2e-6)


def test_receptors_adapt_to_mean_and_spread_of_all_they_have_seen(policy):
    """The frames come in pieces of any size. Each eye has one spread, so that noise is not amplified in receptors with
    little change.
    """
    random = np.random.default_rng(1)
    seen = random.normal(0.4, 0.1, (70, *CONFIG.eyes[1:])).astype(np.float32)
    seen[:, 1] *= 3
    features = build_policy(CONFIG).features_extractor
    for piece in np.split(seen, [1, 20, 21]):
        features.adapt(torch.from_numpy(piece))
    layer, flat = features.encoder[0], seen.reshape(70, 2, -1)
    np.testing.assert_allclose(layer.mean[..., 0], flat.mean(0), rtol=1e-5)
    np.testing.assert_allclose(layer.variance[:, 0, 0], flat.var(0).mean(-1), rtol=1e-4)


def test_dim_light_looks_like_bright_light_once_adapted(policy):
    """A pupil one tenth as wide dims the signal a hundredfold; normalisation hides this from the learner."""
    random = np.random.default_rng(2)
    frames = random.uniform(0, 1, (40, *CONFIG.eyes[1:])).astype(np.float32)
    observation = random_observation(CONFIG, 5)

    def features(gain):
        torch.manual_seed(3)
        dim = build_policy(CONFIG)
        dim.features_extractor.adapt(torch.from_numpy(gain * frames))
        return features_of(dim, {**observation, "eyes": np.float32(gain) * observation["eyes"]})

    np.testing.assert_allclose(features(np.float32(0.01)), features(np.float32(1)), atol=1e-4)


def test_an_eye_moves_its_own_features_only(policy):
    observation = random_observation(CONFIG, 1)
    before = features_of(policy, observation)
    observation["eyes"][:, :, 1] += 0.5
    changed = (features_of(policy, observation) != before).ravel()
    assert not changed[:16].any()
    assert changed[16:32].all()
    assert not changed[32:].any()


def test_memory_costs_temporal_weights_only():
    """One encoder processes every remembered frame; flattening the stack would need ten times the weights."""

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


def test_a_policy_whose_file_names_no_encoder_has_one_of_16(tmp_path):
    """Files of this form load, and their policies act in the same way."""
    torch.manual_seed(0)
    policy = build_policy(PolicyConfig((3, 2, 3, 2, 4), neurons=8, layers=2, encoder=16))
    path = tmp_path / "a.safetensors"
    save_policy(policy, path)
    with safetensors.safe_open(path, framework="pt") as file:
        stored = json.loads(file.metadata()["config"])
        tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 (no mapping)
    assert stored.pop("encoder") == 16
    assert stored == {"eyes": [3, 2, 3, 2, 4], "neurons": 8, "layers": 2, "units": "LeakyReLU"}
    safetensors.torch.save_file(tensors, path, {"config": json.dumps(stored)})
    observation = random_observation(CONFIG, 5)
    np.testing.assert_array_equal(
        load_policy(path).predict(observation, deterministic=True)[0],
        policy.predict(observation, deterministic=True)[0],
    )


@pytest.mark.parametrize(("neurons", "encoder"), [(1, 1), (4, 1), (5, 2), (64, 16), (512, 128)])
def test_a_brain_is_as_narrow_as_its_gene_says_everywhere(neurons, encoder, tmp_path):
    """The layers of the encoder have a quarter of this width, and all layers learn."""
    config = assemble("detection", assignments=["eye.optics=false", f"genome.neurons.start={neurons}"])
    animal = develop(Genotype(config.genome).start, config)
    torch.manual_seed(0)
    policy = build_policy(PolicyConfig((3, 2, 3, 2, 4), animal.neurons, animal.layers, animal.encoder))
    widths = {
        name: parameter.shape[-2] if "features_extractor" in name else parameter.shape[0]
        for name, parameter in policy.named_parameters()
        if name.endswith("weight")
    }
    features = {width for name, width in widths.items() if name.startswith(("features", "pi_features", "vf_features"))}
    hidden = {width for name, width in widths.items() if name.startswith("mlp_extractor")}
    assert (features, hidden) == ({encoder}, {neurons})
    assert policy.features_dim == 2 * encoder + 3
    values, log_prob, _ = policy.evaluate_actions(
        {name: torch.from_numpy(array) for name, array in random_observation(CONFIG, 20).items()}, torch.ones(20, 2)
    )
    (values.sum() + log_prob.sum()).backward()
    assert all(parameter.grad.abs().max() > 0 for parameter in policy.parameters())
    save_policy(policy, tmp_path / "a.safetensors")
    assert load_policy(tmp_path / "a.safetensors").config == policy.config


def test_a_policy_of_other_units_is_refused(policy, tmp_path):
    """Earlier policies had tanh units; with the same weights they would act differently."""
    path = tmp_path / "a.safetensors"
    save_policy(policy, path)
    named = path.read_bytes()
    path.write_bytes(named.replace(b"LeakyReLU", b"SharpTanh"))
    assert path.read_bytes() != named
    with pytest.raises(ValueError, match="units are not LeakyReLU"):
        load_policy(path)


class Hostile:
    """A class that writes a file when it is unpickled."""

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


def test_means_come_back_from_beyond_the_bounds_and_go_no_further():
    """The loss has a gradient towards higher (lower) means everywhere, but it is zero for means above 1 (below -1)."""
    policy = build_policy(PolicyConfig((1, 1, 1, 1, 1), 1))
    policy.action_net.weight.data = torch.eye(2)[:, :1] + 0.0
    policy.action_net.bias.data.zero_()
    gradients = {}
    for wish in (-1.0, 1.0):
        latent = torch.tensor([[-3.0], [-0.5], [0.5], [3.0]], requires_grad=True)
        mean = policy._get_action_dist_from_latent(latent).distribution.mean[:, 0]
        assert torch.equal(mean, latent[:, 0])
        (-wish * mean).sum().backward()
        gradients[wish] = latent.grad.ravel().tolist()
    assert gradients == {1.0: [-1, -1, -1, 0], -1.0: [0, 1, 1, 1]}


def test_first_actions_are_as_fast_as_asked():
    torch.manual_seed(0)
    space = CONFIG.observation_space()
    slow = EyePolicy(
        space, spaces.Box(-1.0, 1.0, (2,)), lambda _: 1e-3, brain=Brain(8), first_actions=[(-0.5, 0.25), (0.0, 0.5)]
    )
    n = 4000
    blank = {name: torch.zeros(n, *box.shape) for name, box in space.spaces.items()}
    speed, turn = ((slow(blank)[0] + torch.tensor([1.0, 0.0])) * torch.tensor([0.5, 1.0])).detach().T
    for values, mean, spread in ((speed, 0.25, 0.125), (turn, 0.0, 0.5)):
        assert abs(values.mean() - mean) < 5 * spread / n**0.5
        assert abs(values.std() - spread) < 5 * spread / (2 * n) ** 0.5


@pytest.mark.parametrize(
    "shape",
    [
        {"neurons": 20_000},
        {"layers": 10**9},
        {"eyes": [3, 10**9, 3, 1, 1]},
        {"eyes": [10**6, 10**6, 3, 1, 1]},
        {"eyes": [0, 2, 3, 4, 5]},
        {"neurons": float("inf")},
    ],
    ids=str,
)
def test_a_shape_that_the_tensors_do_not_have_is_refused_before_it_is_built(policy, tmp_path, shape, monkeypatch):
    """A forged file of some kilobytes must not allocate gigabytes."""
    path = tmp_path / "forged.safetensors"
    config = {**asdict(policy.config), "units": UNITS.__name__, **shape}
    save_file({n: t.detach().clone() for n, t in learnt(policy).items()}, path, {"config": json.dumps(config)})
    built, whole = [], policy_module.build_policy
    monkeypatch.setattr(policy_module, "build_policy", lambda c: built.append(torch.empty(1).device.type) or whole(c))
    with pytest.raises(ValueError, match=r"forged\.safetensors is not a rhabdom policy"):
        load_policy(path)
    assert set(built) <= {"meta"}


def test_a_policy_that_is_a_link_or_a_fifo_is_refused(policy, tmp_path):
    save_policy(policy, tmp_path / "mine.safetensors")
    (tmp_path / "link").symlink_to(tmp_path / "mine.safetensors")
    os.mkfifo(tmp_path / "fifo")
    for name in ("link", "fifo"):
        with pytest.raises(StrangeFileError, match="must be a regular file"):
            load_policy(tmp_path / name)


def test_one_number_that_is_none_spoils_a_policy(policy, tmp_path):
    save_policy(policy, tmp_path / "0.safetensors")
    stored = (tmp_path / "0.safetensors").read_bytes()
    spoilt = stored[:-4] + np.float32(np.nan).tobytes()
    (tmp_path / "0.safetensors").write_bytes(spoilt)
    with pytest.raises(ValueError, match="numbers that are not finite"):
        load_policy(tmp_path / "0.safetensors")
