"""What a photoreceptor makes of the light on it: throughput, spectral weighting, noise."""

import numpy as np

from optics.arguments import in_range, positive

__all__ = ["gaussian_noise", "photon_noise", "quantum_catch", "throughput"]


def throughput(relative_aperture: float) -> float:
    """Light gathered, a²: the pupil's area against that of the widest pupil (diameter = sensor width)."""
    return in_range("relative_aperture", relative_aperture, 0.0, 1.0) ** 2


def quantum_catch(irradiance: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Σ_b weights[c, b] irradiance[b]: (band, y, x) -> (channel, y, x)."""
    return np.tensordot(weights, irradiance, axes=(1, 0))


def gaussian_noise(signal: np.ndarray, sigma: float, rng: np.random.Generator) -> np.ndarray:
    """Signal plus noise of fixed standard deviation `sigma` [signal units]: a dim eye is a noisy eye."""
    sigma = in_range("sigma", sigma, 0.0, 1e6)
    return signal + sigma * rng.standard_normal(signal.shape)


def photon_noise(signal: np.ndarray, photons: float, rng: np.random.Generator) -> np.ndarray:
    """Poisson noise where a signal of 1 is `photons` absorbed photons: standard deviation √(signal/photons)."""
    budget = positive("photons", photons, "1")
    if np.any(signal < 0):
        raise ValueError(f"signal = {np.min(signal):g} at its least: must not be negative")
    return rng.poisson(signal * budget) / budget
