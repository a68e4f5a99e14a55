"""Signal of a photoreceptor from the light on it: throughput, spectral weighting, noise."""

from __future__ import annotations

import numpy as np

from optics.numerics.arguments import in_range, positive
from optics.numerics.autodiff import Array, Scalar
from optics.numerics.matrices import matmul
from optics.numerics.precision import Precision, opaque

__all__ = ["gaussian_noise", "noise_on", "own_type", "photon_noise", "quantum_catch", "throughput"]

MOST_PHOTONS = 1e18  # a count must fit a 64-bit integer


def throughput(relative_aperture: Scalar, open_share: float = 1.0) -> Scalar:
    """Relative amount of light gathered: a² times the open share of the disk.

    It is the pupil's open area divided by the area of the widest disk (diameter = sensor width). It is a Dr.Jit array
    if relative_aperture is one.
    """
    a = in_range("relative_aperture", relative_aperture, 0.0, 1.0 + 1e-9, carried=True)
    if a > 1:  # from rounding
        relative_aperture = relative_aperture * (1 / a)
    return relative_aperture * relative_aperture * open_share


def quantum_catch(irradiance: Array, weights: np.ndarray, gathered: Scalar, types: Precision) -> Array:
    """a² Σ_b weights[c, b] irradiance[b]: Dr.Jit (band, y, x) -> (channel, y, x); gathered: a²."""

    bands, height, width = irradiance.shape
    flat = matmul(types.Tensor(weights), types.Tensor(irradiance.array, (bands, height * width)))
    return types.Tensor(flat.array * types.Float(opaque(types, gathered)), (len(weights), height, width))


def own_type(signals: Array, mosaic: np.ndarray, types: Precision) -> Array:
    """Signal of each receptor's own type in a mosaic (y, x), out of the signals of all types at that place.

    Dr.Jit (type, y, x) -> (1, y, x).
    """
    import drjit as dr

    mine = mosaic == np.arange(signals.shape[0])[:, None, None]
    return types.Tensor(dr.sum(signals * types.Tensor(mine.astype(np.float64)), axis=0).array, (1, *mosaic.shape))


def gaussian_noise(signal: np.ndarray, sigma: float, rng: np.random.Generator) -> np.ndarray:
    """Add noise of a fixed standard deviation `sigma` [signal units], which limits dim eyes most."""
    sigma = in_range("sigma", sigma, 0.0, 1e6)
    return signal + sigma * rng.standard_normal(signal.shape)


def photon_noise(signal: np.ndarray, photons: float | np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Add Poisson noise if a signal of 1 is `photons` absorbed photons: standard deviation √(signal/photons).

    signal: (channel, y, x).
    photons: one number, one per channel, or one per receptor (channel, y, x).
    """
    budget = np.atleast_1d(np.asarray(photons, dtype=np.float64))
    positive("photons", float(budget.min()), "1")
    if not np.all(signal >= 0):
        raise ValueError(f"signal = {np.min(signal):g} at its least: must not be negative")
    if budget.ndim == 1:
        budget = budget.reshape(-1, *(1,) * (np.ndim(signal) - 1))
    expected = np.asarray(signal, dtype=np.float64) * budget
    in_range("signal x photons", float(expected.max(initial=0.0)), 0, MOST_PHOTONS)
    return rng.poisson(expected) / budget


def noise_on(
    clean: np.ndarray, photons: np.ndarray | None, mosaic: np.ndarray | None, sigma: float, rng: np.random.Generator
) -> np.ndarray:
    """Sum of both kinds of noise on signals (channel, y, x).

    photons: per type, or None.
    mosaic: see `own_type`.
    """
    if photons is not None and mosaic is not None:
        photons = photons[mosaic][None]
    caught = clean if photons is None else photon_noise(np.maximum(clean, 0), photons, rng)
    return gaussian_noise(caught, sigma, rng) - clean
