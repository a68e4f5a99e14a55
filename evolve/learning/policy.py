"""What an agent does with what it sees: an MLP per eye, a memory of frames, and an actor and a critic.

Every eye has weights of its own, and one encoder serves all its remembered frames: signals -> 16 -> 16 -> 16 per
frame, then `memory` x 16 -> 16 over the frames. The eyes' features are joined with contact and previous action.
Units are leaky rectifiers: tanh learnt detection from a third more samples, at ten times the cost per unit.
Receptors adapt: the first layer sees signals less their running mean, in units of their spread, as learning has met
them.
"""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Mapping
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
from torch import Tensor, nn

from evolve.learning.adam import Adam
from evolve.store.atomic_files import write_whole

ENCODER_WIDTHS = (16, 16, 16)  # hidden, hidden, code of one frame
EYE_FEATURES = 16  # what the temporal layer makes of an eye's remembered codes
FIRST_TURN = 0.5  # standard deviation of the first turns: with 1, a third of them are clipped
DARK = 1e-6  # spread of signals that all are the same: keeps weights finite
CONTRAST = 0.4  # what a signal one spread off its mean counts, where 675 move a unit together; 1 learnt no faster
UNITS = nn.LeakyReLU  # of all hidden layers; leaky, so that none dies


class TrainingDiverged(FloatingPointError):
    """Learning produced numbers that are none; the message says which."""


@dataclass(frozen=True)
class PolicyConfig:
    """The shape of a policy: all that is needed to build it again.

    eyes is the shape of the observation's `eyes` (memory, eye, channel, height, width); neurons the width of the
    `layers` hidden layers of actor and critic.
    """

    eyes: tuple[int, ...]
    neurons: int
    layers: int = 2

    def observation_space(self) -> spaces.Dict:
        """The observation that sim's environments give with these eyes."""
        return spaces.Dict(
            {
                "eyes": spaces.Box(-np.inf, np.inf, self.eyes, np.float32),
                "contact": spaces.Box(0.0, 1.0, (1,), np.float32),
                "previous_action": spaces.Box(-1.0, 1.0, (2,), np.float32),
            }
        )


class PerEyeLinear(nn.Module):
    """A linear layer with weights per eye: (eye, inputs, sample) -> (eye, outputs, sample).

    Samples come last because W x is then one batched GEMM with no copy; x Wᵀ with so few outputs took three
    times as long, forward and backward.
    """

    def __init__(self, n_eyes: int, inputs: int, outputs: int) -> None:
        super().__init__()
        self.weight = nn.Parameter(torch.empty(n_eyes, outputs, inputs))
        self.bias = nn.Parameter(torch.zeros(n_eyes, outputs, 1))
        for weight in self.weight.data:
            nn.init.orthogonal_(weight, gain=math.sqrt(2))

    def forward(self, x: Tensor) -> Tensor:
        return torch.baddbmm(self.bias, self.weight, x)


class AdaptedLinear(PerEyeLinear):
    """The same over signals less each receptor's running mean, in units of their eye's spread about it.

    Signals of one scene are mostly alike from moment to moment, and behind a small pupil they are small numbers: raw,
    their means would saturate the units and their changes hardly move them. Folded into weight and bias, it is free.
    """

    def __init__(self, n_eyes: int, inputs: int, outputs: int) -> None:
        super().__init__(n_eyes, inputs, outputs)
        self.register_buffer("mean", torch.zeros(n_eyes, inputs, 1))
        self.register_buffer("variance", torch.ones(n_eyes, 1, 1))
        self.register_buffer("seen", torch.zeros(1))  # frames

    def forward(self, x: Tensor) -> Tensor:
        weight = CONTRAST * self.weight * torch.rsqrt(self.variance + DARK**2)
        return torch.baddbmm(self.bias - weight @ self.mean, weight, x)

    @torch.no_grad()
    def adapt(self, x: Tensor) -> None:
        """Take signals (eye, inputs, sample) into mean and spread (Chan, Golub and LeVeque 1983, eq. 2.1)."""
        share = x.shape[2] / (self.seen + x.shape[2])
        deviation = x - self.mean
        step = deviation.mean(dim=2, keepdim=True)
        variance = deviation.square().mean(dim=2, keepdim=True) - share * step**2
        self.variance.lerp_(variance.mean(dim=1, keepdim=True), share)
        self.mean.add_(share * step)
        self.seen.add_(x.shape[2])


class EyeFeatures(BaseFeaturesExtractor):
    """Features of an observation: 16 per eye, then contact and previous action.

    Two forms are understood. Stacked, as environments give it: `eyes` (sample, memory, eye, channel, height, width).
    Unstacked, as rollouts keep it, each frame once: `frames` (segment, memory - 1 + step, eye, channel, height, width)
    and `age` (segment, step), the steps since the episode's first frame; samples are (segment, step) flattened.
    Both give the same features: an episode's first frame stands in for those before it, as in sim's environments.
    """

    def __init__(self, observation_space: spaces.Dict) -> None:
        self.memory, self.n_eyes, *retina = observation_space["eyes"].shape
        others = observation_space["contact"].shape[0] + observation_space["previous_action"].shape[0]
        super().__init__(observation_space, EYE_FEATURES * self.n_eyes + others)
        self.n_receptors = math.prod(retina)
        widths = (self.n_receptors, *ENCODER_WIDTHS)
        layers: list[nn.Module] = [AdaptedLinear(self.n_eyes, *widths[:2]), UNITS()]
        for inputs, outputs in itertools.pairwise(widths[1:]):
            layers += [PerEyeLinear(self.n_eyes, inputs, outputs), UNITS()]
        self.encoder = nn.Sequential(*layers)
        self.temporal = nn.Sequential(
            PerEyeLinear(self.n_eyes, ENCODER_WIDTHS[-1] * self.memory, EYE_FEATURES), UNITS()
        )

    def forward(self, observation: dict[str, Tensor]) -> Tensor:
        if "frames" in observation:
            codes = self._windows(self._encode(observation["frames"]), observation["age"])
        else:
            codes = self._encode(observation["eyes"]).permute(0, 1, 3, 2)
        codes = codes.reshape(self.n_eyes, ENCODER_WIDTHS[-1] * self.memory, -1)
        features = self.temporal(codes).permute(2, 0, 1).flatten(1)
        return torch.cat([features, observation["contact"], observation["previous_action"]], dim=1)

    def _encode(self, frames: Tensor) -> Tensor:
        """(a, b, eye, channel, height, width) -> codes (eye, code, a, b)."""
        a, b = frames.shape[:2]
        return self.encoder(self._signals(frames)).unflatten(2, (a, b))

    def _signals(self, frames: Tensor) -> Tensor:
        """(..., eye, channel, height, width) -> (eye, receptors, sample)."""
        return frames.reshape(-1, self.n_eyes, self.n_receptors).permute(1, 2, 0)

    def adapt(self, frames: Tensor) -> None:
        """Adapt the receptors to more frames (..., eye, channel, height, width)."""
        self.encoder[0].adapt(self._signals(frames))

    def _windows(self, codes: Tensor, age: Tensor) -> Tensor:
        """Codes (eye, code, segment, memory - 1 + step) -> of remembered frames (eye, code, memory, segment, step)."""
        windows = codes.unfold(3, self.memory, 1).permute(0, 1, 4, 2, 3)
        back = torch.arange(self.memory - 1, -1, -1)[:, None, None]
        if not (back > age).any():
            return windows
        first = (self.memory - 1 + torch.arange(age.shape[1]) - age).clamp(min=0)
        first_codes = codes.gather(3, first.expand(*codes.shape[:2], -1, -1))
        return torch.where(back > age, first_codes[:, :, None], windows)


class _Within(torch.autograd.Function):
    """Means of actions whose gradient may push them up to the bounds, -1 and 1, and back, but not further out.

    Commands beyond the bounds are clipped: a mean far out acts as if it did not explore at all, so nothing would ever
    bring it back (Hausknecht and Stone 2016, section 5.2, "zeroing gradients").
    """

    @staticmethod
    def forward(ctx: Any, mean: Tensor) -> Tensor:
        ctx.save_for_backward(mean)
        return mean.clone()

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> Tensor:
        (mean,) = ctx.saved_tensors
        # Descent raises the mean where the gradient is negative.
        return gradient * torch.where(gradient < 0, mean < 1, mean > -1)


class EyePolicy(MultiInputActorCriticPolicy):
    """SB3's actor-critic over EyeFeatures, with `layers` hidden layers of `neurons` each for actor and critic.

    first_speed: mean of the untrained policy's speeds, and twice their standard deviation, as a part of the highest.
    """

    def __init__(
        self,
        observation_space: spaces.Dict,
        action_space: spaces.Box,
        lr_schedule: Any,
        *,
        neurons: int,
        layers: int = 2,
        first_speed: float = 0.5,
        **kwargs: Any,
    ) -> None:
        kwargs |= {
            "features_extractor_class": EyeFeatures,
            "net_arch": [neurons] * layers,
            "activation_fn": UNITS,
            "optimizer_class": Adam,
        }
        super().__init__(observation_space, action_space, lr_schedule, **kwargs)
        self.config = PolicyConfig(tuple(observation_space["eyes"].shape), neurons, layers)
        with torch.no_grad():
            self.action_net.bias.copy_(torch.tensor([2 * first_speed - 1, 0.0]))
            self.log_std.copy_(torch.tensor([first_speed, FIRST_TURN]).log())

    def extract_features(
        self, obs: dict[str, Tensor], features_extractor: BaseFeaturesExtractor | None = None
    ) -> Tensor:
        """As SB3's, without its preprocessing: signals are light, not 8-bit images, and rollouts come unstacked."""
        return (features_extractor or self.features_extractor)(obs)

    def _get_action_dist_from_latent(self, latent_pi: Tensor) -> Distribution:
        if not torch.isfinite(latent_pi).all():
            raise TrainingDiverged("policy's actions not finite")
        mean = _Within.apply(self.action_net(latent_pi))
        return self.action_dist.proba_distribution(mean, self.log_std)


def build_policy(config: PolicyConfig, learning_rate: float = 1e-3) -> EyePolicy:
    """An untrained policy, drawn from torch's random state."""
    action_space = spaces.Box(-1.0, 1.0, (2,), np.float32)
    shape = {"neurons": config.neurons, "layers": config.layers}
    return EyePolicy(config.observation_space(), action_space, lambda _: learning_rate, **shape)


def save_policy(policy: EyePolicy, path: Path | str) -> None:
    """Write the policy's tensors as safetensors, its shape in the metadata; whole or not at all."""
    tensors = {name: tensor.detach().clone() for name, tensor in learnt(policy).items()}
    # One entry: safetensors writes several in random order, and the same policy must be the same bytes.
    metadata = {"config": json.dumps({**asdict(policy.config), "units": UNITS.__name__})}
    write_whole(Path(path), safetensors.torch.save(tensors, metadata))


def load_policy(path: Path | str) -> EyePolicy:
    """Build the policy a file holds. Nothing in the file is ever executed.

    Sets torch to one thread, as learning does: more sum in another order, and an episode must repeat.

    Raises:
        ValueError: one line, naming the file, if it is no policy written by `save_policy` (a pickle, say, or cut
            short).
    """
    try:
        with safetensors.safe_open(str(path), framework="pt") as file:
            metadata = file.metadata() or {}
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 (no mapping)
        stored = json.loads(metadata["config"])
        if stored.get("units") != UNITS.__name__:
            raise ValueError(f"its units are not {UNITS.__name__}, as those of this version's policies are")
        config = PolicyConfig(
            tuple(int(n) for n in stored["eyes"]), int(stored["neurons"]), int(stored.get("layers", 2))
        )
        if not all(torch.isfinite(tensor).all() for tensor in tensors.values()):
            raise ValueError("it holds numbers that are not finite")
        policy = build_policy(config)
        set_learnt(policy, tensors)
    except FileNotFoundError:
        raise ValueError(f"no policy at {path}") from None
    except (safetensors.SafetensorError, KeyError, TypeError, ValueError, RuntimeError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ValueError(f"{path} is not a rhabdom policy (safetensors expected): {reason}") from None
    policy.set_training_mode(False)
    torch.set_num_threads(1)
    return policy


def learnt(policy: EyePolicy) -> dict[str, Tensor]:
    """All that learning changes, by name: weights, and what the receptors have adapted to."""
    return {**dict(policy.named_parameters()), **dict(policy.named_buffers())}


@torch.no_grad()
def set_learnt(policy: EyePolicy, tensors: Mapping[str, Tensor]) -> None:
    """Inverse of `learnt`.

    Raises:
        ValueError: a name or a shape that the policy has not.
    """
    own = learnt(policy)
    if tensors.keys() != own.keys():
        raise ValueError(f"tensors missing or unknown: {sorted(tensors.keys() ^ own.keys())}")
    for name, tensor in own.items():
        if tensors[name].shape != tensor.shape:
            raise ValueError(f"{name} has shape {tuple(tensors[name].shape)}, expected {tuple(tensor.shape)}")
        tensor.copy_(tensors[name])
