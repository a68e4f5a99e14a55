"""What an eye's signals become before actor and critic see them: an MLP per eye over a memory of frames.

Every eye has weights of its own, and one encoder serves all its remembered frames: signals -> w -> w -> w per frame,
then `memory` x w -> w over the frames. The eyes' features are joined with what else is known: contact or, in a task of
one's own, what the animal feels, and the previous action.
Units are leaky rectifiers: tanh learnt detection from a third more samples, at ten times the cost per unit.
Receptors adapt: the first layer sees signals less their running mean, in units of their spread, as learning has met
them.
"""

from __future__ import annotations

import itertools
import math

import torch
from gymnasium import spaces
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from torch import Tensor, nn

__all__ = ["CONTRAST", "UNITS", "AdaptedLinear", "EyeFeatures", "PerEyeLinear", "known_beside_eyes"]

ENCODER_LAYERS = 3  # hidden, hidden, code of one frame
FARTHEST = 10.0  # spreads off the mean that anything felt counts, at most
DARK = 1e-6  # spread of signals that all are the same: keeps weights finite
CONTRAST = 0.4  # what a signal one spread off its mean counts, where 675 move a unit together; 1 learnt no faster
UNITS = nn.LeakyReLU  # of all hidden layers; leaky, so that none dies


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


class Felt(nn.Module):
    """What an animal feels, in whatever units: less its running mean, in units of its running spread, number by number
    (Welford 1962)."""

    def __init__(self, size: int) -> None:
        super().__init__()
        self.register_buffer("mean", torch.zeros(size))
        self.register_buffer("variance", torch.ones(size))
        self.register_buffer("seen", torch.zeros(1))  # observations

    def forward(self, x: Tensor) -> Tensor:
        return ((x - self.mean) * torch.rsqrt(self.variance + DARK)).clamp(-FARTHEST, FARTHEST)

    @torch.no_grad()
    def adapt(self, x: Tensor) -> None:
        """Take observations (sample, number) into mean and spread."""
        share = x.shape[0] / (self.seen + x.shape[0])
        deviation = x - self.mean
        step = deviation.mean(dim=0)
        self.variance.lerp_(deviation.square().mean(dim=0) - share * step**2, share)
        self.mean.add_(share * step)
        self.seen.add_(x.shape[0])


def known_beside_eyes(space: spaces.Dict) -> dict[str, int]:
    """What an observation holds beside "eyes", and how many numbers each, in the order in which brains see them."""
    return {name: math.prod(part.shape or (1,)) for name, part in sorted(space.spaces.items()) if name != "eyes"}


class EyeFeatures(BaseFeaturesExtractor):
    """Features of an observation: `width` per eye, as wide as each layer below, then what is known beside them.

    Two forms are understood. Stacked, as environments give it: `eyes` (sample, memory, eye, channel, height, width).
    Unstacked, as rollouts keep it, each frame once: `frames` (segment, memory - 1 + step, eye, channel, height, width)
    and `age` (segment, step), the steps since the episode's first frame; samples are (segment, step) flattened.
    Both give the same features: an episode's first frame stands in for those before it, as in sim's environments.
    """

    def __init__(self, observation_space: spaces.Dict, width: int) -> None:
        self.memory, self.n_eyes, *retina = observation_space["eyes"].shape
        beside = known_beside_eyes(observation_space)
        super().__init__(observation_space, width * self.n_eyes + sum(beside.values()))
        self.beside = tuple(beside)
        self.width = width
        self.n_receptors = math.prod(retina)
        widths = (self.n_receptors, *(width,) * ENCODER_LAYERS)
        layers: list[nn.Module] = [AdaptedLinear(self.n_eyes, *widths[:2]), UNITS()]
        for inputs, outputs in itertools.pairwise(widths[1:]):
            layers += [PerEyeLinear(self.n_eyes, inputs, outputs), UNITS()]
        self.encoder = nn.Sequential(*layers)
        self.temporal = nn.Sequential(PerEyeLinear(self.n_eyes, width * self.memory, width), UNITS())
        self.felt = Felt(beside["feels"]) if "feels" in beside else None

    def forward(self, observation: dict[str, Tensor]) -> Tensor:
        if "frames" in observation:
            codes = self._windows(self._encode(observation["frames"]), observation["age"])
        else:
            codes = self._encode(observation["eyes"]).permute(0, 1, 3, 2)
        codes = codes.reshape(self.n_eyes, self.width * self.memory, -1)
        features = self.temporal(codes).permute(2, 0, 1).flatten(1)
        beside = [self.felt(observation[n]) if n == "feels" and self.felt else observation[n] for n in self.beside]
        return torch.cat([features, *beside], dim=1)

    def _encode(self, frames: Tensor) -> Tensor:
        """(a, b, eye, channel, height, width) -> codes (eye, code, a, b)."""
        a, b = frames.shape[:2]
        return self.encoder(self._signals(frames)).unflatten(2, (a, b))

    def _signals(self, frames: Tensor) -> Tensor:
        """(..., eye, channel, height, width) -> (eye, receptors, sample)."""
        return frames.reshape(-1, self.n_eyes, self.n_receptors).permute(1, 2, 0)

    def adapt(self, frames: Tensor, feels: Tensor | None = None) -> None:
        """Adapt the receptors to more frames (..., eye, channel, height, width), and the rest to what was felt
        (..., number)."""
        self.encoder[0].adapt(self._signals(frames))
        if self.felt is not None and feels is not None:
            self.felt.adapt(feels.reshape(-1, feels.shape[-1]))

    def _windows(self, codes: Tensor, age: Tensor) -> Tensor:
        """Codes (eye, code, segment, memory - 1 + step) -> of remembered frames (eye, code, memory, segment, step)."""
        windows = codes.unfold(3, self.memory, 1).permute(0, 1, 4, 2, 3)
        back = torch.arange(self.memory - 1, -1, -1)[:, None, None]
        if not (back > age).any():
            return windows
        first = (self.memory - 1 + torch.arange(age.shape[1]) - age).clamp(min=0)
        first_codes = codes.gather(3, first.expand(*codes.shape[:2], -1, -1))
        return torch.where(back > age, first_codes[:, :, None], windows)
