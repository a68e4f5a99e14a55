"""Frequencies of the light and of the soft edges of several pupils, for `window_edges`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

__all__ = ["EDGES", "Bands", "in_steps", "medians"]

EDGES = 4  # choice: number of sharpnesses of the edge per octave; equal ones share tables


@dataclass(frozen=True, eq=False)
class Bands:
    """Frequencies in cycles per radius, (beam,).

    density: frequencies that the samples must resolve.
    passband: passband of the soft edge.
    around: distance between the frequencies of the edge and those of the light that it sends into the window.
    """

    density: np.ndarray
    passband: np.ndarray
    around: np.ndarray

    def where(self, chosen: np.ndarray, other: Bands) -> Bands:
        """Return these bands for the chosen beams, and those of `other` for the rest."""
        pairs = (self.density, other.density), (self.passband, other.passband), (self.around, other.around)
        return Bands(*(np.where(chosen, own, their) for own, their in pairs))

    def stepped(self, chosen: np.ndarray) -> Bands:
        """Return these bands, with the densities of the chosen beams rounded up to a few values per octave.

        Pupils with similar light then have equal densities and share all arrays. The passband grows with the density.
        """
        density = in_steps(self.density)
        return Bands(density, self.passband * (density / self.density), self.around).where(chosen, self)


def in_steps(values: np.ndarray, count: int = EDGES) -> np.ndarray:
    """Return values rounded up to a few per octave; count: their number."""
    return np.asarray(2.0 ** (np.ceil(count * np.log2(values) - 1e-9) / count))


def medians(values: np.ndarray) -> np.ndarray:
    """Return the medians of rows; `np.median` takes several times as long."""
    last = values.shape[1] // 2
    first = (values.shape[1] - 1) // 2
    ordered = np.partition(values, sorted({first, last}), axis=1)
    return np.asarray((ordered[:, first] + ordered[:, last]) / 2)
