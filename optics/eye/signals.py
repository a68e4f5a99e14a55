"""Signals of an eye's receptors for a scene: convolution with the eye's kernels, quantum catch, and noise."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from optics.eye.depth_range import inverse_distances_in
from optics.eye.eye_spec import EyeSpec
from optics.eye.kernel_bank import KernelBank
from optics.eye.layered_image import retinal_image
from optics.eye.photoreceptor import noise_on, own_type, quantum_catch
from optics.eye.retinal_image import at_receptors, mean_over, receptor_average
from optics.numerics.autodiff import Array, plain
from optics.numerics.precision import Precision, precision

__all__ = ["signals", "with_noise"]


def signals(eye: EyeSpec, parts: Sequence[tuple[np.ndarray, Any]], bank: KernelBank, s: int, z: Any) -> Array:
    """Return the signals (channel, h, w) without noise.

    parts: components of the light, (band, Y, X), each with its weight in the signals, a number or one per receptor (h,
        w).
    s: samples_per_receptor.
    z: distance [m] of the scene along the axis, a number or one per cell (Y, X).
    """
    types, shape = precision(eye.dtype), (eye.resolution[0] * s, eye.resolution[1] * s)
    depth = inverse_distances_in(parts[0][0].shape[1:], z)
    total: Any = None
    for light, taken in parts:
        catch = _quantum_catch(eye, retinal_image(light, depth, bank, shape, types), s, types)
        if np.ndim(taken):
            catch *= types.Tensor(np.broadcast_to(taken, catch.shape).copy())
        total = catch if total is None else total + catch
    return total if eye.mosaic is None else own_type(total, eye.mosaic, types)


def _quantum_catch(eye: EyeSpec, image: Array, s: int, types: Precision) -> Array:
    if eye.lattice is not None:
        irradiance = mean_over(eye.lattice, image, types)
    else:
        irradiance = (receptor_average if eye.waveguide is None else at_receptors)(image, s, types)
    return quantum_catch(irradiance, eye.spectral_bands.weights, eye.aperture_throughput, types)


def with_noise(eye: EyeSpec, signal: Array, rng: np.random.Generator) -> Array:
    """Return a signal with Gaussian noise and, given a photon budget, shot noise. Noise carries no derivative."""
    noise = noise_on(plain(signal), eye.receptor_photons, eye.noise_sigma, rng)
    return signal + precision(eye.dtype).Tensor(noise)
