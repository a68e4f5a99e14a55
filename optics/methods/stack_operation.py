"""PSFs of several sources through one pupil, as a single operation of PyTorch with its own derivative.

This is faster than one operation of PyTorch for each step of the calculation. The light behind the pupil is
P = S e^{2πi w}. The phase w [waves] of relief and wavefront carries derivatives, and the remaining factor S does not.
The intensity is |U|², where `window_field` computes U from P. For a loss L with the gradient
G = ∂L/∂Re P + i ∂L/∂Im P, the gradient with respect to the phase is 2π (Re P Im G - Im P Re G).
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from optics.methods.window_sums import WindowSums, intensity_of, pupil_gradient, window_field
from optics.numerics.array_library import library, on_host, turned
from optics.numerics.autodiff import Array, carries_derivative

__all__ = ["is_single", "stack_images"]


def is_single(size: Array, waves: Array | None) -> bool:
    """Return whether `stack_images` can compute the PSFs.

    The light behind the pupil is S e^{2πi w}. The phase w (`waves`) must be a tensor of PyTorch in the processor's
    memory and carry derivatives. The factor S (`size`) must not carry derivatives.

    size: S, the light without the phase of relief and wavefront.
    waves: w, the phase of relief and wavefront [waves]; None without relief and wavefront.
    """
    tensor = waves is not None and library(waves) is not np and on_host(waves)
    return tensor and carries_derivative(waves) and not carries_derivative(size)


def stack_images(size: Array, waves: Array, sums: WindowSums, dtype: str, many: int) -> Array:
    """Return the intensity |U|² over the window as a tensor of PyTorch, (source, y, x).

    The light behind the pupil is S e^{2πi w}. Derivatives with respect to w are supported.

    size: S, the light without the phase of relief and wavefront, times the areas of the samples, complex. Its shape is
        (source, row of the pupil's samples, column).
    waves: phase w of relief and wavefront [waves], (row, column).
    sums: arrays with which `window_field` computes the field U over the window from this light.
    dtype: "float32" or "float64".
    many: largest number of sources for which U is computed at the same time. It limits the memory.
    """
    return _operation(library(waves)).apply(waves, size.numpy(), sums, dtype, many)


@lru_cache(maxsize=1)
def _operation(torch: Any) -> Any:
    class StackImages(torch.autograd.Function):
        @staticmethod
        def forward(ctx: Any, waves: Array, size: np.ndarray, sums: WindowSums, dtype: str, many: int) -> Array:
            light = size * turned(1.0, waves.detach().numpy(), dtype)
            parts = [light[first : first + many] for first in range(0, len(light), many)]
            fields = [window_field(part, sums.kernel, sums.down, sums.across) for part in parts]
            ctx.sums, ctx.pairs = sums, list(zip(parts, fields, strict=True))
            return torch.from_numpy(np.concatenate([intensity_of(field) for field in fields]))

        @staticmethod
        def backward(ctx: Any, *gradients: Array) -> tuple[Array | None, ...]:
            own, first, total = gradients[0].detach().resolve_neg().numpy(), 0, np.zeros(())
            for light, field in ctx.pairs:
                cotangent = 2 * own[first : first + len(field)] * field
                found = pupil_gradient(cotangent, ctx.sums.kernel, ctx.sums.down, ctx.sums.across)
                total = total + (light.real * found.imag - light.imag * found.real).sum(0)
                first += len(field)
            return torch.from_numpy(total * np.float64(2 * np.pi)), None, None, None, None

    return StackImages
