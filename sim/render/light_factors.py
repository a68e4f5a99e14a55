"""Factors by which all lights of each world are multiplied."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from optics.numerics.arguments import reals, shown
from optics.numerics.number_types import all_finite


@dataclass(frozen=True)
class LightFactors:
    """Factors by which all lights of each world are multiplied.

    bands: factors in each band, (env, band) float32
    """

    bands: np.ndarray

    @classmethod
    def from_light(cls, light: np.ndarray, shape: tuple[int, int]) -> LightFactors:
        """Return a copy of the factors `light`, which must have this shape, (env, band).

        Raises:
            ValueError: `light` has another shape, or an entry is negative or not finite.
        """
        factors = reals("light", light).astype(np.float32)
        if factors.shape != shape:
            raise ValueError(f"light has shape {factors.shape}: must be (env, band), {shape}")
        if not all_finite(factors) or (factors < 0).any():
            raise ValueError(f"light = {shown(light)}: must be finite factors of at least 0")
        return cls(factors)

    @property
    def is_level(self) -> bool:
        """True if each world has the same factor in all its bands. Signals can then be multiplied by this factor."""
        return bool((self.bands == self.bands[:, :1]).all())

    @property
    def level(self) -> np.ndarray:
        """Factor by which the signals of each world are multiplied, (env, 1, 1, 1, 1).

        It may be used only if all bands of a world have the same factor (`is_level`).
        """
        return self.bands[:, :1, None, None, None]

    def on_bands(self, layers: np.ndarray, basis: np.ndarray | None, n_eyes: int) -> np.ndarray:
        """Return light in bands, multiplied by these factors, (layer, band, all rays of all views).

        layers: light in each depth layer and each component of the spectrum, (layer, component, all rays of all views)
        basis: contribution of a component to each band, (component, band); None: components are bands
        """
        if basis is not None:
            layers = np.einsum("lkn,kb->lbn", layers, basis.astype(np.float32))
        per_view = np.repeat(self.bands.T, n_eyes, axis=1)[..., None]  # (band, view, 1)
        lit: np.ndarray = layers.reshape(*layers.shape[:2], per_view.shape[1], -1) * per_view
        return lit.reshape(layers.shape)
