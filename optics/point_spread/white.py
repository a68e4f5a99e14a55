"""White light: PSF and MTF as each type of receptor weighs the wavelengths of a lamp."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from optics.elements.pupil import Pupil
from optics.numerics.accuracy import AccuracyError
from optics.numerics.arguments import shown, whole
from optics.numerics.autodiff import Array
from optics.numerics.interpolation import linear_weights
from optics.numerics.precision import precision
from optics.point_spread.contrast import MTF, combined_mtf, flat
from optics.point_spread.psf import psf
from optics.point_spread.psf_result import PSFResult
from optics.spectra.receptors import receptors_of
from optics.spectra.spectrum import Spectrum, illuminant

__all__ = ["WhitePSF", "white_psf"]

MOST_WAVES = 401


@dataclass(frozen=True, eq=False)
class WhitePSF:
    """PSF of each type of receptor, Σ_λ w(λ) PSF_λ with weights that sum to 1.

    waves: the PSFs (wavelength, y, x) it is made of. weights: (type, wavelength).
    spectral_error: (type,) predicted relative L2 error of so few wavelengths, half the difference from every second
        one: linear between wavelengths, a third of it is left.
    """

    waves: PSFResult
    weights: np.ndarray
    spectral_error: np.ndarray

    def __repr__(self) -> str:
        errors = ", ".join(f"{error:.1e}" for error in self.predicted_error)
        return f"<WhitePSF of {len(self.weights)} types from {self.waves!r}, predicted errors {errors}>"

    @cached_property
    def tensor(self) -> Array:
        """(type, y, x) in Dr.Jit, with derivatives."""
        return _combined(self.waves, self.weights)

    @cached_property
    def psf(self) -> np.ndarray:
        """(type, y, x) [1/m²]."""
        return np.asarray(self.tensor.numpy())

    @property
    def predicted_error(self) -> np.ndarray:
        """(type,) relative L2 error over the window, of spectrum and pictures."""
        found: np.ndarray = self.spectral_error + self.waves.plan.predicted_error
        return found

    def mtf(self, tolerance: float = 0.02) -> MTF:
        """|Σ_λ w(λ) OTF_λ| of each type, (type, fy, fx): shifts between colours blur, too. See `optics.mtf`.

        Raises:
            AccuracyError: see `optics.mtf`.
        """
        return combined_mtf(self.waves, self.weights, _combined, tolerance)


def white_psf(
    pupil: Pupil,
    light: str | Spectrum | Callable[[np.ndarray], np.ndarray] = "D65",
    receptors: Any = "lms",
    waves: int = 31,
    tolerance: float = 1e-2,
    **asked: Any,
) -> WhitePSF:
    """PSF in white light, as types of receptors see it: w(λ) ∝ light(λ) λ sensitivity(λ), since they count photons.

    light: name of an illuminant, a Spectrum, or spectral power as a function of wavelengths [m].
    receptors: see `optics.receptors_of`; their types, in order. waves: an odd number of wavelengths over the
        receptors' range; between them PSFs are linear. tolerance: of each picture as in `optics.psf`, and of the
        spectrum, which fewer wavelengths carry less well. asked: all else that `optics.psf` takes.

    Raises:
        ValueError: a bad argument, or light that no receptor of a type sees.
        AccuracyError: too few wavelengths, with how many would do; or see `optics.psf`.
    """
    if whole("waves", waves, 5, MOST_WAVES) % 2 == 0:
        raise ValueError(f"waves = {waves}: must be odd, so that every second wavelength reaches as far")
    if "wavelengths" in asked:
        raise ValueError("wavelengths: those of white light are the receptors' range, in `waves` steps")
    kinds = receptors_of(receptors)
    nodes = np.linspace(*kinds.limits_nm, waves)
    weights, coarse = (_weights(light, kinds, each) for each in (nodes, nodes[::2]))
    result = psf(pupil, nodes * 1e-9, tolerance=tolerance, **asked)
    flat_psf = result.psf.reshape(waves, -1).astype(np.float64)
    fine, rough = weights @ flat_psf, coarse @ flat_psf[::2]
    error = np.linalg.norm(rough - fine, axis=1) / np.linalg.norm(fine, axis=1)
    # Linear between wavelengths: half the step, a quarter of the error; a third of the difference is left.
    if (worst := float(error.max()) / 3) > tolerance:
        more = 2 * math.ceil(waves * math.sqrt(1.2 * worst / tolerance) / 2) + 1
        raise AccuracyError(
            f"tolerance = {tolerance:g}: {waves} wavelengths carry the spectrum to {worst:.2g}; ask for waves={more}"
        )
    return WhitePSF(result, weights, error / 2)


def _weights(light: Any, kinds: Any, nodes: np.ndarray) -> np.ndarray:
    """(type, wavelength): integrals to 1 nm of what each type catches, times hats around the nodes [nm]."""
    source = illuminant(light) if isinstance(light, str) else light
    if not isinstance(source, Spectrum) and not callable(source):
        raise ValueError(f"light = {shown(light)}: must be an illuminant's name, a Spectrum, or a function of [m]")
    nm = np.arange(nodes[0], nodes[-1] + 0.5)
    power = source.at(nm * 1e-9) if isinstance(source, Spectrum) else np.broadcast_to(source(nm * 1e-9), nm.shape)
    if not (np.isfinite(power).all() and (power >= 0).all()):
        raise ValueError("light: must be finite and not negative over the receptors' range")
    caught = np.stack([kind.at(nm * 1e-9) * nm * power for kind in kinds.types])
    caught[:, [0, -1]] /= 2  # trapezoid rule
    total = caught.sum(axis=1, keepdims=True)
    if not (total > 0).all():
        raise ValueError(f"light: receptors of type {int(np.argmin(total))} see nothing of it")
    found: np.ndarray = caught @ linear_weights(nm, nodes).T / total
    return found


def _combined(result: PSFResult, weights: np.ndarray) -> Array:
    """Σ_λ weights[type, λ] PSF_λ, (type, y, x)."""
    import drjit as dr

    types = precision("float64")
    count, height, width = result.tensor.shape
    values, size = types.Float(flat(result.tensor)), height * width
    planes = [dr.gather(types.Float, values, dr.arange(types.Index, size) + index * size) for index in range(count)]
    sums = [sum(float(w) * plane for w, plane in zip(row, planes, strict=True)) for row in weights]
    return types.Tensor(sums[0] if len(sums) == 1 else dr.concat(sums), (len(sums), height, width))
