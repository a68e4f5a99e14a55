"""Linear layers for each eye: a plain layer, a layer that normalises its inputs, and a layer that combines frames.

The last axis of the inputs x is that of the samples in a batch. A layer W x is then one batched matrix product (GEMM)
without a copy. With samples on the first axis, the product x Wᵀ took three times as long, both forward and backward,
because layers have few outputs.
"""

from __future__ import annotations

import math
from typing import Any

import torch
from torch import Tensor, nn

__all__ = ["CONTRAST", "AdaptedLinear", "MemoryLinear", "PerEyeLinear"]

DARK = 1e-6  # lower limit of the standard deviation of signals, so that weights stay finite if all signals are equal
CONTRAST = 0.4  # standard deviation of normalised signals, chosen for 675 inputs per unit; 1 made learning no faster


class PerEyeLinear(nn.Module):
    """Linear layer for each eye: (eye, inputs, sample) -> (eye, outputs, sample).

    shared: True if all eyes have the same weights; False if each eye has its own
    """

    def __init__(self, n_eyes: int, inputs: int, outputs: int, shared: bool = False) -> None:
        super().__init__()
        sets = 1 if shared else n_eyes
        self.n_eyes = n_eyes
        self.weight = nn.Parameter(torch.empty(sets, outputs, inputs))
        self.bias = nn.Parameter(torch.zeros(sets, outputs, 1))
        for weight in self.weight.data:
            nn.init.orthogonal_(weight, gain=math.sqrt(2))

    @property
    def weights(self) -> tuple[Tensor, Tensor]:
        """Weights (eye, outputs, inputs) and biases (eye, outputs, 1).

        If eyes share them, the entries of all eyes are views of the same numbers.
        """
        return self.weight.expand(self.n_eyes, -1, -1), self.bias.expand(self.n_eyes, -1, -1)

    def forward(self, x: Tensor) -> Tensor:
        weight, bias = self.weights
        return torch.baddbmm(bias, weight, x)


class AdaptedLinear(PerEyeLinear):
    """Linear layer on signals that are normalised by their running mean and standard deviation.

    Each channel of a receptor has its own mean, and each eye its own standard deviation, even if the eyes share their
    weights. Within a scene, signals vary little around their means, and behind a small pupil all signals are small.
    Without normalisation, the units would respond almost only to the means, and hardly to the variations around them.
    Weight and bias are rescaled instead of the signals, so that normalisation takes almost no time.
    """

    def __init__(self, n_eyes: int, inputs: int, outputs: int, shared: bool = False) -> None:
        super().__init__(n_eyes, inputs, outputs, shared)
        self.register_buffer("mean", torch.zeros(n_eyes, inputs, 1))
        self.register_buffer("variance", torch.ones(n_eyes, 1, 1))
        self.register_buffer("seen", torch.zeros(1))  # number of frames

    def forward(self, x: Tensor) -> Tensor:
        weight, bias = self.weights
        weight = CONTRAST * weight * torch.rsqrt(self.variance + DARK**2)
        return torch.baddbmm(bias - weight @ self.mean, weight, x)

    @torch.no_grad()
    def adapt(self, x: Tensor) -> None:
        """Update the running means and variances with further signals, (eye, inputs, sample).

        The update follows Chan, Golub and LeVeque (1983), eq. 2.1.
        """
        share = x.shape[2] / (self.seen + x.shape[2])
        deviation = x - self.mean
        step = deviation.mean(dim=2, keepdim=True)
        variance = deviation.square().mean(dim=2, keepdim=True) - share * step**2
        self.variance.lerp_(variance.mean(dim=1, keepdim=True), share)
        self.mean.add_(share * step)
        self.seen.add_(x.shape[2])


class MemoryLinear(PerEyeLinear):
    """Linear layer on the codes of the last frames: (eye, code, memory, sample) -> (eye, outputs, sample).

    A frame's code is the encoder's output for the signals of one eye in this frame.

    memory: number of frames
    code: number of elements of a code
    """

    def __init__(self, n_eyes: int, memory: int, code: int, outputs: int, shared: bool = False) -> None:
        super().__init__(n_eyes, code * memory, outputs, shared)
        self.memory = memory

    def forward(self, codes: Tensor) -> Tensor:
        return super().forward(codes.flatten(1, 2))

    def slide(self, codes: Tensor) -> Tensor:
        """Return the outputs at each step, which depend on the codes of the last `memory` frames.

        A segment is a sequence of steps of one world. The result has the axes (eye, output, sample), where samples are
        the pairs (step, segment) in row-major order.

        codes: codes of the frames of all segments, (eye, element of the code, memory - 1 + step, segment)
        """
        weight, bias = self.weights
        return _Slide.apply(codes, weight.unflatten(2, (-1, self.memory)), bias)


class _Slide(torch.autograd.Function):
    """Sum of W[lag] codes[lag : lag + steps] over lag = 0, ..., memory - 1, and the gradient of this sum.

    A code is the encoder's output for a frame of one eye. At each step, the agent remembers the codes of the last
    frames, and W[lag] are the weights of the code in place `lag`, from the oldest to the newest. Each term is a matrix
    product (GEMM) on the stored codes. A version that copied the remembered codes of each step into a new array took
    four times as long, both forward and backward.
    """

    @staticmethod
    def forward(ctx: Any, codes: Tensor, weight: Tensor, bias: Tensor) -> Tensor:
        """Return the sum of the weighted codes plus `bias`, (eye, output, sample).

        A segment is a sequence of steps of one world. The samples are the pairs (step, segment).

        codes: outputs of the encoder for the frames of all segments, (eye, element of the code, frame, segment)
        weight: weights, (eye, output, element of the code, lag)
        bias: biases, (eye, output, 1)
        """
        weights = weight.permute(3, 0, 1, 2).contiguous()
        total, *pieces = _slices(codes, len(weights))
        result = torch.baddbmm(bias, weights[0], total)
        for one, piece in zip(weights[1:], pieces, strict=True):
            result.baddbmm_(one, piece)
        ctx.save_for_backward(codes, weights)
        return result

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        codes, weights = ctx.saved_tensors
        of_codes, of_weights = torch.zeros_like(codes), torch.empty_like(weights)
        pieces = zip(_slices(codes, len(weights)), _slices(of_codes, len(weights)), strict=True)
        for lag, (piece, of_piece) in enumerate(pieces):
            of_piece.baddbmm_(weights[lag].transpose(1, 2), gradient)
            torch.bmm(gradient, piece.transpose(1, 2), out=of_weights[lag])
        return of_codes, of_weights.permute(1, 2, 3, 0), gradient.sum(2, keepdim=True)


def _slices(codes: Tensor, memory: int) -> list[Tensor]:
    """Return the codes of the oldest remembered frame of all steps, those of the second oldest, etc. up to the newest.

    A code is the encoder's output for a frame of one eye. At each step, the agent remembers the last `memory` frames.
    Each element of the list is a view without a copy, (eye, element of the code, sample). The samples are the pairs
    (step, segment) in row-major order, where a segment is a sequence of steps of one world.

    codes: codes of the frames of all segments, (eye, element of the code, frame, segment)
    memory: number of frames in memory
    """
    segments, frames = codes.shape[3], codes.flatten(2)
    samples = frames.shape[2] - (memory - 1) * segments
    return [frames[:, :, lag * segments :][:, :, :samples] for lag in range(memory)]
