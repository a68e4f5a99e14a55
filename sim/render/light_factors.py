"""Factors by which all lights of each world are multiplied."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


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
            ValueError: `light` has another shape.
        """
        if np.shape(light) != shape:
            raise ValueError(f"light has shape {np.shape(light)}: must be (env, band), {shape}")
        return cls(np.array(light, np.float32))

    @property
    def is_level(self) -> bool:
        """True if all bands of a world have the same factor, so that it can multiply the signals."""
        return bool((self.bands == self.bands[:, :1]).all())

    @property
    def level(self) -> np.ndarray:
        """Common factor of all bands in each world, in the shape of signals (env, eye, channel, height, width)."""
        return self.bands[:, :1, None, None, None]

    def on_bands(self, layers: np.ndarray, basis: np.ndarray | None, n_eyes: int) -> np.ndarray:
        """Return light in bands, multiplied by these factors, (layer, band, all rays of all views).

        layers: light in components, (layer, component, all rays of all views)
        basis: contribution of a component to each band, (component, band); None: components are bands
        """
        if basis is not None:
            layers = np.einsum("lkn,kb->lbn", layers, basis.astype(np.float32))
        per_view = np.repeat(self.bands.T, n_eyes, axis=1)[..., None]  # (band, view, 1)
        lit: np.ndarray = layers.reshape(*layers.shape[:2], per_view.shape[1], -1) * per_view
        return lit.reshape(layers.shape)
