"""Signal of a photoreceptor from the light on it: throughput, spectral weighting, noise.

`optics.Eye.see` draws noise with the functions of this module. Simulated worlds use `sim.render.receptor_noise`.
"""

from __future__ import annotations

import numpy as np

from optics.numerics.arguments import in_range, positive, reals
from optics.numerics.autodiff import Array, Scalar
from optics.numerics.matrices import matmul
from optics.numerics.precision import Precision, opaque

__all__ = ["gaussian_noise", "noise_on", "own_type", "photon_noise", "quantum_catch", "throughput"]

MOST_PHOTONS = 1e18  # counts of photons must fit into 64-bit integers


def throughput(relative_aperture: Scalar, open_share: float = 1.0) -> Scalar:
    """Return the throughput: squared `relative_aperture` times `open_share`, the open fraction of the aperture's disk.

    This is the pupil's open area divided by the area of the widest pupil. The result is a Dr.Jit array if
    relative_aperture is a Dr.Jit array.
    """
    a = in_range("relative_aperture", relative_aperture, 0.0, 1.0 + 1e-9, carried=True)
    if a > 1:  # rounding could exceed 1
        relative_aperture = relative_aperture * (1 / a)
    return relative_aperture * relative_aperture * open_share


def quantum_catch(irradiance: Array, weights: np.ndarray, gathered: Scalar, types: Precision) -> Array:
    """Return the signals of channels c, `gathered` Σ_b weights[c, b] irradiance[b], as a Dr.Jit tensor (channel, y, x).

    irradiance: irradiance in spectral bands b, a Dr.Jit tensor (band, y, x).
    weights: sensitivity of each channel in each band, array (channel, band).
    gathered: throughput of the aperture.
    """

    bands, height, width = irradiance.shape
    flat = matmul(types.Tensor(weights), types.Tensor(irradiance.array, (bands, height * width)))
    return types.Tensor(flat.array * types.Float(opaque(types, gathered)), (len(weights), height, width))


def own_type(signals: Array, mosaic: np.ndarray, types: Precision) -> Array:
    """Return the signal of each receptor in a mosaic, which has a receptor of one type at each position.

    The result is Dr.Jit (1, y, x).

    signals: signals that receptors of every type would have at each position, Dr.Jit (type, y, x).
    mosaic: type of the receptor at each position, (y, x).
    """
    import drjit as dr

    mine = mosaic == np.arange(signals.shape[0])[:, None, None]
    return types.Tensor(dr.sum(signals * types.Tensor(mine.astype(np.float64)), axis=0).array, (1, *mosaic.shape))


def gaussian_noise(signal: np.ndarray, sigma: float, rng: np.random.Generator) -> np.ndarray:
    """Return a signal with Gaussian noise of the standard deviation `sigma` [units of the signal]."""
    sigma = in_range("sigma", sigma, 0.0, 1e6)
    return reals("signal", signal) + sigma * rng.standard_normal(np.shape(signal))


def photon_noise(signal: np.ndarray, photons: float | np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return a signal with Poisson noise, whose standard deviation is √(signal/photons).

    signal: (channel, y, x).
    photons: absorbed photons for a signal of 1: a number, an array with one per channel, (channel,) or
        (channel, 1, 1), or an array with one per receptor, (channel, y, x).

    Raises:
        ValueError: a signal is negative, a number of photons is not positive, or a receptor absorbs more than 1e18.
    """
    signal, budget = reals("signal", signal), np.atleast_1d(reals("photons", photons))
    positive("photons", float(budget.min()), "1")
    if not np.all(signal >= 0):
        raise ValueError(f"signal = {np.min(signal):g} at its least: must not be negative")
    if budget.ndim == 1:
        budget = budget.reshape(-1, *(1,) * (np.ndim(signal) - 1))
    expected = signal * budget
    in_range("signal x photons", float(expected.max(initial=0.0)), 0, MOST_PHOTONS)
    return rng.poisson(expected) / budget


def noise_on(clean: np.ndarray, photons: np.ndarray | None, sigma: float, rng: np.random.Generator) -> np.ndarray:
    """Return the sum of Poisson and Gaussian noise for signals (channel, y, x).

    photons: absorbed photons for a signal of 1, see `photon_noise`; None for no Poisson noise.
    """
    counted = clean if photons is None else photon_noise(np.maximum(clean, 0), photons, rng)
    return gaussian_noise(counted, sigma, rng) - clean
