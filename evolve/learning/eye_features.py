"""Encoder of the eyes' signals for actor and critic: for each eye, a multilayer perceptron on its last frames.

Each eye has its own weights, unless `wiring.shared_encoder` is set. The same encoder is applied to each of the last
`memory` frames: three layers of width w map the signals of a frame to a code of w numbers. (For a compound eye, the
outputs of two hexagonal layers take the place of the signals, and all ommatidia count as one eye.) One further layer
then maps the codes of these frames, `memory` x w numbers, to the w features of the eye. The features of all eyes are
joined with the other entries of the observation, such as proprioception and the previous action.

Units are leaky rectifiers. With tanh, the agent needed a third more samples to learn the task `detection`, and each
unit took ten times as long to compute. Receptors adapt: the first layer subtracts the running mean of the signals, and
divides by their running standard deviation. Both are measured during learning.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping

import torch
from gymnasium import spaces
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from torch import Tensor, nn

from evolve.config.settings import DIRECT, WiringConfig
from evolve.learning.hexagonal_layers import HexagonalLayers
from evolve.learning.observed import entries_of, known_beside_eyes
from evolve.learning.per_eye_layers import DARK, AdaptedLinear, MemoryLinear, PerEyeLinear
from evolve.learning.regridding import Regridding
from sim.envs.ommatidia_space import OmmatidiaBox

__all__ = ["UNITS", "EyeFeatures"]

ENCODER_LAYERS = 3  # two hidden layers, and a layer that returns the code of a frame
FARTHEST = 10.0  # limit of normalised proprioception, in standard deviations from the mean
UNITS = nn.LeakyReLU  # units of all hidden layers; the gradient of a leaky unit is never 0


class Felt(nn.Module):
    """Normalisation of proprioception: each element by its own running mean and standard deviation (Welford 1962).

    Normalised elements are clipped to [-10, 10].
    """

    def __init__(self, size: int) -> None:
        super().__init__()
        self.register_buffer("mean", torch.zeros(size))
        self.register_buffer("variance", torch.ones(size))
        self.register_buffer("seen", torch.zeros(1))  # number of observations

    def forward(self, x: Tensor) -> Tensor:
        return ((x - self.mean) * torch.rsqrt(self.variance + DARK)).clamp(-FARTHEST, FARTHEST)

    @torch.no_grad()
    def adapt(self, x: Tensor) -> None:
        """Update the running mean and variance with further observations (sample, number)."""
        share = x.shape[0] / (self.seen + x.shape[0])
        deviation = x - self.mean
        step = deviation.mean(dim=0)
        self.variance.lerp_(deviation.square().mean(dim=0) - share * step**2, share)
        self.mean.add_(share * step)
        self.seen.add_(x.shape[0])


class EyeFeatures(BaseFeaturesExtractor):
    """Module that returns the features of observations: `width` numbers for each eye, then all other observations.

    All layers of the encoders have the same width. An observation may have one of two forms, which give the same
    features. Environments return stacked frames: `eyes` (sample, memory, eye, channel, height, width). Rollout buffers
    store each frame once: `frames` (memory - 1 + step, segment, eye, channel, height, width) and `age` (step, segment),
    the number of steps since the first frame of the episode. A segment is a sequence of steps of one world. The samples
    are then the pairs (step, segment) in row-major order.

    Frames of a compound eye have the axes (ommatidium, channel) instead of (eye, channel, height, width). Two layers of
    `hexagonal_layers` come before the encoder, and all ommatidia of the observation count as one eye.

    At the start of an episode, the memory is not yet full. As in sim's environments, the first frame of the episode
    fills the missing places.

    width: number of units in each layer of the encoders, and number of features of an eye
    wiring: connections between the receptors and the encoders

    Raises:
        ValueError: `wiring` pools or repeats the signals of a compound eye.
    """

    def __init__(self, observation_space: spaces.Dict, width: int, wiring: WiringConfig = DIRECT) -> None:
        eyes, first = observation_space["eyes"], AdaptedLinear
        grid: HexagonalLayers | Regridding
        if isinstance(eyes, OmmatidiaBox):
            if wiring.pool_side or wiring.repeat_side:
                raise ValueError("wiring: pool_side and repeat_side must be 0, ommatidia have no rows and columns")
            self.memory, self.n_eyes, first = eyes.shape[0], 1, PerEyeLinear
            grid = HexagonalLayers(eyes.directions, eyes.shape[2], UNITS)
            inputs = grid.outputs
        else:
            self.memory, self.n_eyes, channels, *retina = eyes.shape
            grid = Regridding((retina[0], retina[1]), wiring)
            inputs = channels * math.prod(grid.shape)
        beside = known_beside_eyes(observation_space)
        super().__init__(observation_space, width * self.n_eyes + sum(beside.values()))
        self.beside = tuple(beside)
        self.width, self.n_inputs, self.grid = width, inputs, grid
        widths, shared = (self.n_inputs, *(width,) * ENCODER_LAYERS), wiring.shared_encoder
        layers: list[nn.Module] = [first(self.n_eyes, widths[0], widths[1], shared), UNITS(inplace=True)]
        for inputs, outputs in itertools.pairwise(widths[1:]):
            layers += [PerEyeLinear(self.n_eyes, inputs, outputs, shared), UNITS(inplace=True)]
        self.encoder = nn.Sequential(*layers)
        self.temporal = nn.Sequential(MemoryLinear(self.n_eyes, self.memory, width, width, shared), UNITS(inplace=True))
        self.normalised = tuple(entry.name for entry in entries_of(observation_space) if entry.normalised)
        sizes = [beside[name] for name in self.normalised]
        self.felt = Felt(sum(sizes)) if sizes else None
        self._sizes = sizes

    def forward(self, observation: dict[str, Tensor]) -> Tensor:
        if "frames" in observation:
            features = self._at_each_step(self._encode(observation["frames"]), observation["age"])
        else:
            features = self.temporal(self._encode(observation["eyes"]).transpose(2, 3))
        features = features.permute(2, 0, 1).flatten(1)
        known = {**observation, **self._less_mean(observation)}
        return torch.cat([features, *(known[name] for name in self.beside)], dim=1)

    def _less_mean(self, observation: Mapping[str, Tensor]) -> dict[str, Tensor]:
        """Return, by name, normalised values of those entries of the observation that a policy normalises.

        If there are no such entries, the result is {}.
        """
        if self.felt is None:
            return {}
        joined = self.felt(torch.cat([observation[name] for name in self.normalised], dim=-1))
        return dict(zip(self.normalised, joined.split(self._sizes, dim=-1), strict=True))

    def _encode(self, frames: Tensor) -> Tensor:
        """Return codes (eye, code, a, b) of frames (a, b, eye, channel, height, width).

        A code is the encoder's output for a frame of one eye. The axes (a, b) of the frames are (sample, place in
        memory) or (frame, segment). For compound eyes, frames have the axes (a, b, ommatidium, channel), and the axis
        eye of the result has the length 1.
        """
        a, b = frames.shape[:2]
        return self.encoder(self._signals(frames)).unflatten(2, (a, b))

    def _signals(self, frames: Tensor) -> Tensor:
        """Return frames as the encoders' inputs (eye, inputs, sample).

        frames: (..., eye, channel, height, width), or (..., ommatidium, channel) of compound eyes
        """
        return self.grid(frames).reshape(-1, self.n_eyes, self.n_inputs).permute(1, 2, 0)

    def adapt(self, frames: Tensor, beside: Mapping[str, Tensor] | None = None) -> None:
        """Update the running means and variances of the inputs with further observations.

        frames: frames of the eyes, (..., eye, channel, height, width), or (..., ommatidium, channel) of a compound eye
        beside: other entries of the observations by name, (..., number); None: their normalisation does not change
        """
        if isinstance(self.grid, HexagonalLayers):
            self.grid.adapt(frames)
        else:
            self.encoder[0].adapt(self._signals(frames))
        if self.felt is not None and beside is not None:
            felt = torch.cat([beside[name] for name in self.normalised], dim=-1)
            self.felt.adapt(felt.reshape(-1, felt.shape[-1]))

    def _at_each_step(self, codes: Tensor, age: Tensor) -> Tensor:
        """Return the features of each eye at each step, which depend on the codes of the last `memory` frames.

        A code is the encoder's output for a frame of one eye. A segment is a sequence of steps of one world. Its frames
        are those of its steps, preceded by memory - 1 earlier ones. The result has the axes (eye, feature, sample),
        where samples are the pairs (step, segment) in row-major order.

        codes: codes of all frames of all segments, (eye, element of the code, frame, segment)
        age: steps since the first frame of the episode, (step, segment)
        """
        layer, unit = self.temporal
        features = layer.slide(codes)
        young = (age < self.memory - 1).flatten().nonzero()[:, 0]  # samples whose memory is not yet full
        if len(young):
            step, segment = young // age.shape[1], young % age.shape[1]
            first = self.memory - 1 + step - age.flatten()[young]
            frame = torch.maximum(first, step + torch.arange(self.memory)[:, None])
            features = features.index_copy(2, young, layer(codes[:, :, frame, segment]))
        return unit(features)
