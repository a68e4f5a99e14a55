"""Policy of an animal: an actor and a critic. Their inputs are features of the animal's eyes and other observations.

A policy is stored in a safetensors file, with its `PolicyConfig` in the metadata. The file contains no code.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import safetensors
import safetensors.torch
import torch
from gymnasium import spaces
from stable_baselines3.common.distributions import Distribution
from stable_baselines3.common.policies import MultiInputActorCriticPolicy
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from torch import Tensor

from evolve.config.checks import check_values
from evolve.config.settings import DIRECT, WiringConfig
from evolve.genome.phenotype import FORMER_ENCODER
from evolve.learning.adam import Adam
from evolve.learning.distribution import Gaussian, Within
from evolve.learning.eye_features import UNITS, EyeFeatures
from evolve.learning.hexagonal_layers import directions_from_record
from evolve.learning.observed import CONTACT, FEELS, Entry, entries_from_record, entries_of, known_beside_eyes
from evolve.learning.tensor_file import read_tensors
from evolve.store.atomic_files import write_whole
from sim.envs.ommatidia_space import OmmatidiaBox

LARGEST_COUNT = 4096  # upper limit of each number in the shape of a policy in a file; genes allow at most 512
MOST_SIGNALS = 2**24  # upper limit for the number of signals in a policy's memory; genes allow at most half of it
FIRST_SPREAD = 0.5  # standard deviation of an untrained policy's actions; with 1, a third of them would be clipped


class TrainingDiverged(FloatingPointError):
    """Learning or playing produced numbers that are not finite; the message states which."""


@dataclass(frozen=True)
class Brain:
    """Size and wiring of a brain.

    neurons, layers: the actor and the critic have `layers` hidden layers of `neurons` units each
    encoder: number of units in each layer of the encoders, the networks that process the signals of each eye first
    wiring: connections between receptors and encoders
    """

    neurons: int
    layers: int = 2
    encoder: int = FORMER_ENCODER
    wiring: WiringConfig = DIRECT


@dataclass(frozen=True)
class PolicyConfig:
    """Shape of a policy, from which an untrained policy can be built.

    eyes: shape of the observation's `eyes` (memory, eye, channel, height, width), or (memory, ommatidium, channel)
    neurons, layers, encoder, wiring: see `Brain`
    actions: number of elements of an action
    beside: entries of the observation other than the eyes' signals and the previous action
    directions: viewing directions of the ommatidia of a compound eye, unit vectors; empty for other eyes
    """

    eyes: tuple[int, ...]
    neurons: int
    layers: int = 2
    encoder: int = FORMER_ENCODER
    actions: int = 2
    beside: tuple[Entry, ...] = (CONTACT,)
    wiring: WiringConfig = DIRECT
    directions: tuple[tuple[float, ...], ...] = ()

    @classmethod
    def from_space(cls, space: spaces.Dict, brain: Brain) -> PolicyConfig:
        """Return the sizes and wiring of a policy for the observations of an environment of `sim`."""
        actions = known_beside_eyes(space)["previous_action"]
        sizes = (brain.neurons, brain.layers, brain.encoder)
        eyes = space["eyes"]
        found: tuple[tuple[float, ...], ...] = ()
        if isinstance(eyes, OmmatidiaBox):
            found = tuple(tuple(way) for way in eyes.directions.tolist())
        return cls(tuple(eyes.shape), *sizes, actions, entries_of(space), brain.wiring, found)

    @property
    def brain(self) -> Brain:
        """Size and wiring of the policy's brain."""
        return Brain(self.neurons, self.layers, self.encoder, self.wiring)

    def observation_space(self) -> spaces.Dict:
        """Return the space of the observations that an environment of `sim` passes to this policy."""
        eyes = spaces.Box(-np.inf, np.inf, self.eyes, np.float32)
        if self.directions:
            eyes = OmmatidiaBox(-np.inf, np.inf, self.eyes, np.array(self.directions))
        known: dict[str, spaces.Space[Any]] = {
            "eyes": eyes,
            "previous_action": spaces.Box(-1.0, 1.0, (self.actions,), np.float32),
        }
        return spaces.Dict(known | {entry.name: entry.space for entry in self.beside})

    def record(self) -> dict[str, Any]:
        """Return the fields by name as JSON values.

        The record of a run contains a hash of each policy file. All versions of rhabdom must therefore write the same
        bytes for a policy. Older versions lacked the fields `wiring` and `beside`. Policies that these versions could
        describe are still written without these two fields.
        """
        left_out = {"beside"} | ({"wiring"} if self.wiring == DIRECT else set())
        left_out |= set() if self.directions else {"directions"}
        values = {name: value for name, value in asdict(self).items() if name not in left_out}
        if self.beside == (CONTACT,) and self.actions == 2:
            del values["actions"]
            return values
        size = sum(entry.size for entry in self.beside)
        if self.beside == ((Entry(FEELS, size),) if size else ()):
            return {**values, FEELS: size}
        return {**values, "beside": [entry.record() for entry in self.beside]}

    @classmethod
    def from_record(cls, stored: Mapping[str, Any]) -> PolicyConfig:
        """Return the configuration of a policy from the return value of `record`.

        Raises:
            KeyError: an entry is missing.
            TypeError: an entry has the wrong type, or an entry of `wiring` is unknown.
            ValueError: an entry has an impossible value.
        """
        return cls(
            eyes=tuple(int(n) for n in stored["eyes"]),
            neurons=int(stored["neurons"]),
            layers=int(stored.get("layers", 2)),
            encoder=int(stored.get("encoder", FORMER_ENCODER)),
            actions=int(stored.get("actions", 2)),
            beside=entries_from_record(stored),
            wiring=_wiring(stored.get("wiring", {})),
            directions=directions_from_record(stored),
        )


def _wiring(stored: Mapping[str, Any]) -> WiringConfig:
    wiring = WiringConfig(**stored)
    check_values(wiring, prefix="wiring.")
    return wiring


class EyePolicy(MultiInputActorCriticPolicy):
    """Actor and critic of stable-baselines3 (SB3), whose inputs are the outputs of EyeFeatures.

    brain: size and wiring of the brain
    first_actions: mean and standard deviation of each element of an action before training; None: 0 and 0.5
    """

    def __init__(
        self,
        observation_space: spaces.Dict,
        action_space: spaces.Box,
        lr_schedule: Any,
        *,
        brain: Brain,
        first_actions: Sequence[tuple[float, float]] | None = None,
        **kwargs: Any,
    ) -> None:
        kwargs |= {
            "features_extractor_class": EyeFeatures,
            "features_extractor_kwargs": {"width": brain.encoder, "wiring": brain.wiring},
            "net_arch": [brain.neurons] * brain.layers,
            "activation_fn": UNITS,
            "optimizer_class": Adam,
        }
        super().__init__(observation_space, action_space, lr_schedule, **kwargs)
        self.config = PolicyConfig.from_space(observation_space, brain)
        with torch.no_grad():
            means, spreads = zip(*(first_actions or [(0.0, FIRST_SPREAD)] * self.config.actions), strict=True)
            self.action_net.bias.copy_(torch.tensor(means))
            self.log_std.copy_(torch.tensor(spreads, device="cpu").log())

    def _build(self, lr_schedule: Any) -> None:
        self.action_dist = Gaussian(self.action_space.shape[0])
        super()._build(lr_schedule)

    def extract_features(
        self, obs: dict[str, Tensor], features_extractor: BaseFeaturesExtractor | None = None
    ) -> Tensor:
        """Return the features without SB3's preprocessing, which expects 8-bit images and stacked frames."""
        return (features_extractor or self.features_extractor)(obs)

    def _get_action_dist_from_latent(self, latent_pi: Tensor) -> Distribution:
        if not torch.isfinite(latent_pi).all():
            raise TrainingDiverged("policy's actions not finite")
        mean = Within.apply(self.action_net(latent_pi))
        return self.action_dist.proba_distribution(mean, self.log_std)


def build_policy(config: PolicyConfig, learning_rate: float = 1e-3) -> EyePolicy:
    """Return an untrained policy; its random weights depend on torch's global random state."""
    action_space = spaces.Box(-1.0, 1.0, (config.actions,), np.float32)
    return EyePolicy(config.observation_space(), action_space, lambda _: learning_rate, brain=config.brain)


def save_policy(policy: EyePolicy, path: Path | str) -> None:
    """Write a policy as a safetensors file, completely or not at all.

    Raises:
        OSError: the file cannot be written.
    """
    tensors = {name: tensor.detach().clone() for name, tensor in learnt(policy).items()}
    # One entry only: safetensors writes several entries in random order, but equal policies must give equal bytes.
    metadata = {"config": json.dumps({**policy.config.record(), "units": UNITS.__name__})}
    write_whole(Path(path), safetensors.torch.save(tensors, metadata))


def load_policy(path: Path | str) -> EyePolicy:
    """Return the policy that a file contains; nothing in the file is executed.

    Torch is set to one thread, as in learning: several threads would vary the order of sums, and thereby actions.

    Raises:
        ValueError: the file does not exist, or is not a policy; for example, it is a pickle or truncated.
        OSError: the file cannot be read, is too large, or is a link, FIFO or directory (StrangeFileError).
    """
    try:
        metadata, tensors = read_tensors(Path(path))
        stored = json.loads(metadata["config"])
        if stored.get("units") != UNITS.__name__:
            raise ValueError(f"its units are not {UNITS.__name__}, which this version uses")
        config = PolicyConfig.from_record(stored)
        if not all(torch.isfinite(tensor).all() for tensor in tensors.values()):
            raise ValueError("it contains numbers that are not finite")
        _require_shape(config, tensors)
        policy = build_policy(config)
        set_learnt(policy, tensors)
    except FileNotFoundError:
        raise ValueError(f"no policy at {path}") from None
    except (safetensors.SafetensorError, KeyError, TypeError, ValueError, RuntimeError, OverflowError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ValueError(f"{path} is not a rhabdom policy (safetensors expected): {reason}") from None
    policy.set_training_mode(False)
    torch.set_num_threads(1)
    return policy


def learnt(policy: EyePolicy) -> dict[str, Tensor]:
    """Return all tensors that learning changes, by name: weights, and running means and variances of inputs.

    Tables that follow from the policy's shape, such as the neighbours of ommatidia, are not among them.
    """
    found, changing = {**dict(policy.named_parameters()), **dict(policy.named_buffers())}, policy.state_dict().keys()
    return {name: tensor for name, tensor in found.items() if name in changing}


@torch.no_grad()
def set_learnt(policy: EyePolicy, tensors: Mapping[str, Tensor]) -> None:
    """Set the tensors that `learnt` returns.

    Raises:
        ValueError: a name or a shape differs from the policy's.
    """
    own = learnt(policy)
    require_same_shapes(own, tensors)
    for name, tensor in own.items():
        tensor.copy_(tensors[name])


def _require_shape(config: PolicyConfig, tensors: Mapping[str, Tensor]) -> None:
    """Check that a policy with this `config` has these `tensors`, before memory for the policy is allocated."""
    known = sum(entry.size for entry in config.beside)
    counts = [
        *(config.eyes[::2] if config.directions else config.eyes),
        config.neurons,
        config.layers,
        config.encoder,
        config.actions,
        known + 1,
    ]
    if min(counts) < 1 or max(counts) > LARGEST_COUNT or math.prod(config.eyes) > MOST_SIGNALS:
        raise ValueError(f"its shape is impossible: {config}")
    if config.layers > len(tensors):
        raise ValueError(f"it has {len(tensors)} tensors, too few for {config.layers} layers")
    with torch.device("meta"):  # shapes without storage
        require_same_shapes(learnt(build_policy(config)), tensors)


def require_same_shapes(own: Mapping[str, Tensor], tensors: Mapping[str, Tensor]) -> None:
    """Check that `tensors` have the same names and shapes as `own`, the tensors of a policy.

    Raises:
        ValueError: a name or a shape differs.
    """
    if tensors.keys() != own.keys():
        raise ValueError(f"tensors missing or unknown: {sorted(tensors.keys() ^ own.keys())}")
    for name, tensor in own.items():
        if tensors[name].shape != tensor.shape:
            raise ValueError(f"{name} has shape {tuple(tensors[name].shape)}, expected {tuple(tensor.shape)}")
