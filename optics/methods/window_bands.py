"""Bands of spatial frequencies in several pupils, from which `window_edges` chooses soft edges and numbers of samples.

The light of a ray has a frequency in the pupil's plane: the number of cycles of its phase per radius of the pupil. An
edge diffracts the light of a ray to a band of frequencies around that of the ray.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

__all__ = ["EDGES", "Bands", "in_steps", "medians"]

EDGES = 4  # choice: number of sharpnesses of the edge per octave; equal ones share tables


@dataclass(frozen=True, eq=False)
class Bands:
    """Spatial frequencies for the samples and the soft edge of each pupil, in cycles per radius of the pupil.

    The shape of all arrays is (beam,).

    density: highest frequencies that the samples must resolve, which are also the numbers of samples per radius.
    passband: frequencies up to which softening the edge does not change the spectrum of the aperture.
    around: largest changes of frequency at the edge that matter. The edge diffracts a ray of one frequency to a band of
        frequencies around it. Only frequencies of light that arrives in the window are counted.
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
    """Return values rounded up to the next of the numbers 2^(k/count), where k is an integer.

    count: number of possible values per octave, which is a factor of 2.
    """
    return np.asarray(2.0 ** (np.ceil(count * np.log2(values) - 1e-9) / count))


def medians(values: np.ndarray) -> np.ndarray:
    """Return the median of each row of a matrix. The function `np.median` takes several times as long."""
    last = values.shape[1] // 2
    first = (values.shape[1] - 1) // 2
    ordered = np.partition(values, sorted({first, last}), axis=1)
    return np.asarray((ordered[:, first] + ordered[:, last]) / 2)
