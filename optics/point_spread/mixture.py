"""Sums over wavelengths, and the interface of PSFs for light of several wavelengths."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from optics.numerics.autodiff import Array
from optics.numerics.precision import padded_for_packets, precision

__all__ = ["Mixture", "a_mixture", "flat", "mixed"]


class Mixture(Protocol):
    """Interface of PSFs for light of several wavelengths, such as a WhitePSF.

    For its methods, see `optics.mtf`, `optics.strehl_ratio` and `optics.encircled_energy`.
    """

    def mtf(self, tolerance: float = 0.02) -> Any: ...

    def strehl_ratio(self, with_error: bool = False) -> Any: ...

    def encircled_energy(
        self,
        radii: np.ndarray | float,
        centre: tuple[float, float] | None = None,
        with_error: bool = False,
    ) -> Any: ...


def a_mixture(result: Any) -> Mixture:
    """Return `result`; ValueError unless it is a Mixture. A batch or a plain array, for example, is refused."""
    if not hasattr(result, "strehl_ratio"):
        batch = ", as its `result(eye)` is" if hasattr(result, "result") else ""
        raise ValueError(f"result is a {type(result).__name__}: must be a PSFResult{batch}, or a WhitePSF")
    found: Mixture = result
    return found


def mixed(tensor: np.ndarray | Array, weights: np.ndarray) -> Array:
    """Return Σ_λ weights[row, λ] tensor[λ, …] as a Dr.Jit tensor (row, …) with derivatives."""
    import drjit as dr

    types = precision("float64")
    count, rest = tensor.shape[0], tuple(tensor.shape[1:])
    values, size = types.Float(flat(tensor)), int(np.prod(rest))
    planes = [dr.gather(types.Float, values, dr.arange(types.Index, size) + index * size) for index in range(count)]
    sums = [sum(float(w) * plane for w, plane in zip(row, planes, strict=True)) for row in weights]
    return types.Tensor(sums[0] if len(sums) == 1 else dr.concat(sums), (len(sums), *rest))


def flat(tensor: np.ndarray | Array) -> Array:
    """Return a Dr.Jit or NumPy tensor as a flat array, row by row."""
    import drjit as dr

    return padded_for_packets(tensor) if isinstance(tensor, np.ndarray) else dr.ravel(tensor)
