"""PSFs in white light, and measures of these PSFs such as the Strehl ratio.

The weight of each wavelength follows from the spectrum of the light source and the absorption of each receptor type.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from optics.elements.pupil import Pupil
from optics.numerics.accuracy import AccuracyError, rounded_up
from optics.numerics.arguments import flag, in_range, reals, shown, whole
from optics.numerics.autodiff import Array, plain, to_user
from optics.numerics.grid import Grid, OnWindow
from optics.numerics.precision import padded_for_packets, precision
from optics.numerics.read_only import ReadOnlyArrays, read_only
from optics.point_spread.concentration import encircled_energy
from optics.point_spread.contrast import combined_mtf
from optics.point_spread.mixture import mixed
from optics.point_spread.modulation_transfer import MTF
from optics.point_spread.psf import psf
from optics.point_spread.psf_result import PSFResult
from optics.point_spread.strehl import strehl_ratio
from optics.spectra.receptors import receptors_of
from optics.spectra.spectrum import Spectrum, illuminant

__all__ = ["WhitePSF", "white_psf"]

FIRST, MOST_WAVES = 9, 513  # choice: initial and largest number of wavelengths
# Choice: predicted error, relative to the difference from a sum over every second wavelength. In theory it is a
# fifteenth, because splines converge with the fourth power of the step; see tests/optics/point_spread/test_white.py.
LEFT = 0.25
OF_PICTURES = 0.5  # choice: part of the tolerance that the PSFs may use; the rest is for the spectrum


@dataclass(frozen=True, eq=False)
class WhitePSF(ReadOnlyArrays, OnWindow):
    """PSFs in white light, one for each type of receptor: Σ_λ w(λ) PSF_λ with weights that sum to 1.

    waves: the monochromatic PSFs (wavelength, y, x) of the sum.
    weights: w, (type, wavelength). Cubic splines interpolate PSFs between wavelengths, so a weight may be slightly
        negative.
    coarse: weights, (type, wavelength), of a sum over every second wavelength; the weights of the others are 0.
    spectral_error: predicted relative L2 error that is due to the number of wavelengths, (type,). The prediction is a
        quarter of the difference between the PSFs with `weights` and with `coarse`. The error falls with the fourth
        power of the number of wavelengths.
    """

    waves: PSFResult
    weights: np.ndarray
    coarse: np.ndarray
    spectral_error: np.ndarray

    def __repr__(self) -> str:
        errors = ", ".join(f"{error:.1e}" for error in self.predicted_error)
        return f"<WhitePSF of {len(self.weights)} types from {self.waves!r}, predicted errors {errors}>"

    @property
    def window(self) -> Grid:
        """Positions of the samples on the sensor [m]."""
        return self.waves.window

    @property
    def dx(self) -> float:
        """Pitch [m]."""
        return self.waves.dx

    @cached_property
    def tensor(self) -> Array:
        """PSFs [1/m²] as a Dr.Jit tensor (type, y, x) that carries derivatives."""
        return mixed(self.waves.tensor, self.weights)

    @cached_property
    def psf(self) -> np.ndarray:
        """PSFs [1/m²], (type, y, x)."""
        return read_only(np.asarray(self.tensor.numpy()))

    @property
    def predicted_error(self) -> np.ndarray:
        """Relative L2 error over the window, due to the number of wavelengths and to errors of their PSFs, (type,)."""
        found: np.ndarray = self.spectral_error + self.waves.plan.predicted_error * np.abs(self.weights).sum(axis=1)
        return found

    def mtf(self, tolerance: float = 0.02) -> MTF:
        """Return the contrast |Σ_λ w(λ) OTF_λ| that each type of receptor sees, (type, fy, fx).

        The sum is over the optical transfer functions of all wavelengths λ, with w from `weights`. Shifts between the
        images of different colours therefore add to the blur. See `optics.mtf`.

        tolerance: largest error of the contrasts over all types and frequencies.

        Raises:
            ValueError: see `optics.mtf`.
            AccuracyError: see `optics.mtf`.
        """
        found, count = combined_mtf(self.waves, np.vstack([self.weights, self.coarse]), tolerance), len(self.weights)
        fine, rough = found.mtf[:count], found.mtf[count:]
        spectral = LEFT * np.abs(fine - rough).max(axis=(1, 2))
        kept = found.first(count)
        causes = kept.causes and replace(kept.causes, rest=kept.causes.rest + spectral)
        return replace(kept, predicted_error=kept.predicted_error + spectral, causes=causes)

    def strehl_ratio(self, with_error: bool = False) -> np.ndarray | Array:
        """Return the Strehl ratio in white light for each type of receptor, (type,).

        It is the maximum of the white PSF, divided by the maximum of the PSF of the same pupil in the same light
        without aberration.

        See `optics.strehl_ratio`.

        Raises:
            ValueError: `with_error` is not a bool.
            AccuracyError: see `optics.strehl_ratio`.
        """
        import drjit as dr

        flag("with_error", with_error)
        each = [strehl_ratio(self.waves.mean(row), with_error=True) for row in self.weights]
        ratios, errors = ([row[part] for row in each] for part in (0, 1))
        around = np.linalg.norm(self.psf, axis=(1, 2)) / self.psf.max(axis=(1, 2))
        error = np.concatenate(errors) + self.spectral_error * around * np.concatenate([plain(r) for r in ratios])
        if isinstance(ratios[0], np.ndarray):
            value: np.ndarray | Array = np.concatenate(ratios)
        else:
            joined = ratios[0].array if len(ratios) == 1 else dr.concat([ratio.array for ratio in ratios])
            value = type(ratios[0])(joined, (len(ratios),))
        return (value, error) if with_error else value

    def encircled_energy(
        self,
        radii: np.ndarray | float,
        centre: tuple[float, float] | None = None,
        with_error: bool = False,
    ) -> np.ndarray | Array:
        """Return the fraction of the white light within circles, (receptor type, radius).

        The fraction is the sum of the encircled energies of all wavelengths, each times its weight in `weights`. See
        `optics.encircled_energy`.

        radii: radii [m] of the circles.
        centre: centre (x, y) [m] of the circles; None for the position of sample n//2, with n samples along each axis.
        with_error: True to return (value, predicted error).

        Raises:
            ValueError: see `optics.encircled_energy`.
            AccuracyError: see `optics.encircled_energy`.
        """
        flag("with_error", with_error)
        each, errors = encircled_energy(self.waves, radii, centre, with_error=True)
        known = plain(each)
        change = np.abs((self.weights - self.coarse) @ known)
        error = np.abs(self.weights) @ errors + LEFT * change
        if isinstance(each, np.ndarray):
            value: np.ndarray | Array = self.weights @ known
        else:
            value = to_user(mixed(each, self.weights))
        return (value, error) if with_error else value


def white_psf(
    pupil: Pupil,
    light: str | Spectrum | Callable[[np.ndarray], np.ndarray] = "D65",
    receptors: Any = "lms",
    waves: int | str = "auto",
    tolerance: float = 1e-2,
    **asked: Any,
) -> WhitePSF:
    """Return the PSF in white light for each type of receptor.

    Receptors count photons, so the weight of a wavelength λ is proportional to light(λ) λ sensitivity(λ).

    light: name of an illuminant, a Spectrum, or spectral power as a function of wavelengths [m].
    receptors: receptor types, see `optics.receptors_of`. Results are in the order of the types.
    waves: number of wavelengths over the receptors' range: odd, 5 to 513, or "auto" for the first of 9, 17, 33, ...,
        513 that meets the tolerance. Cubic splines interpolate PSFs between the wavelengths.
    tolerance: largest relative L2 error of the white PSFs over the window. Half of it is for the errors of the
        monochromatic PSFs, and half for the number of wavelengths.
    asked: further arguments of `optics.psf`, apart from wavelengths.

    Raises:
        ValueError: an argument is invalid, or a type of receptor does not absorb the light.
        AccuracyError: there are too few wavelengths (the message states a sufficient number or tolerance). See also
            `optics.psf`.
        BackendError: see `optics.psf`.
    """
    by_itself = isinstance(waves, str) and waves == "auto"
    count = FIRST if by_itself else whole("waves", waves, 5, MOST_WAVES)
    if count % 2 == 0:
        raise ValueError(f"waves = {waves}: must be odd, so that every second wavelength covers the same range")
    if "wavelengths" in asked:
        raise ValueError("wavelengths: must not be given; white light covers the receptors' range in `waves` steps")
    within = in_range("tolerance", tolerance, 1e-12, 0.5) * OF_PICTURES
    kinds = receptors_of(receptors)
    catches, ends = _quantum_catch(light, kinds), kinds.limits_nm
    result = psf(pupil, np.linspace(*ends, count) * 1e-9, tolerance=within, **asked)
    while True:
        found = _weighed(result, catches, ends)
        worst = float(found.spectral_error.max())
        if worst <= tolerance - within:
            return found
        if not by_itself or 2 * count - 1 > MOST_WAVES:
            raise AccuracyError(
                f"tolerance = {tolerance:g}: {count} wavelengths resolve the spectrum to {worst:.2g}; use "
                f"{_remedy(count, worst, tolerance - within, tolerance)}"
            )
        count = 2 * count - 1
        result = _with_middles(result, psf(pupil, np.linspace(*ends, count)[1::2] * 1e-9, tolerance=within, **asked))


def _remedy(count: int, worst: float, allowed: float, tolerance: float) -> str:
    """Return advice if `count` wavelengths are too few: a sufficient number of wavelengths.

    If that number would exceed MOST_WAVES, the advice is a larger tolerance, for which `count` wavelengths suffice. If
    that tolerance would exceed 0.5, the advice is a light or receptors with a smoother spectrum.

    worst, allowed: error of the sum over wavelengths, and the largest error that is allowed.
    """
    more = 2 * math.ceil(count * (1.2 * worst / allowed) ** 0.25 / 2) + 1
    if more <= MOST_WAVES:
        return f"waves={more} or 'auto'"
    enough = rounded_up(tolerance * worst / allowed)
    return f"tolerance={enough:.3g}" if enough <= 0.5 else "a light or receptors with a smoother spectrum"


def _weighed(result: PSFResult, catches: np.ndarray, ends: tuple[float, float]) -> WhitePSF:
    nodes = np.linspace(*ends, len(result.wavelengths))
    weights, coarse = catches @ _splines(nodes, ends), np.zeros((len(catches), len(nodes)))
    coarse[:, ::2] = catches @ _splines(nodes[::2], ends)
    flat = result.psf.reshape(len(nodes), -1).astype(np.float64)
    fine = weights @ flat
    error = LEFT * np.linalg.norm(coarse @ flat - fine, axis=1) / np.linalg.norm(fine, axis=1)
    return WhitePSF(result, weights, coarse, error)


def _quantum_catch(light: Any, kinds: Any) -> np.ndarray:
    """Return the quantum catch of each type of receptor (`kinds`) at steps of 1 nm, (type, nm). Each row sums to 1.

    Raises:
        ValueError: the light is invalid, or a type does not absorb it.
    """
    source = illuminant(light) if isinstance(light, str) else light
    if not isinstance(source, Spectrum) and not callable(source):
        raise ValueError(f"light = {shown(light)}: must be an illuminant's name, a Spectrum or a function of λ [m]")
    nm = _nanometres(kinds.limits_nm)
    given = source.at(nm * 1e-9) if isinstance(source, Spectrum) else reals("light", source(nm * 1e-9))
    power = np.broadcast_to(given, nm.shape)
    if not (np.isfinite(power).all() and (power >= 0).all()):
        raise ValueError("light: must be finite and not negative over the receptors' range")
    catches = np.stack([kind.at(nm * 1e-9) * nm * power for kind in kinds.types])
    catches[:, [0, -1]] /= 2  # trapezoid rule
    total = catches.sum(axis=1, keepdims=True)
    if not (total > 0).all():
        raise ValueError(f"light: receptors of type {int(np.argmin(total))} absorb none of it")
    found: np.ndarray = catches / total
    return found


def _nanometres(ends: tuple[float, float]) -> np.ndarray:
    return np.arange(ends[0], ends[1] + 0.5)


def _splines(nodes: np.ndarray, ends: tuple[float, float]) -> np.ndarray:
    """Return cubic splines at steps of 1 nm, (nm, node). Each is 1 at one of the nodes [nm] and 0 at all others."""
    from scipy.interpolate import CubicSpline

    found: np.ndarray = CubicSpline(nodes, np.eye(len(nodes)))(_nanometres(ends))
    return found


def _with_middles(result: PSFResult, between: PSFResult) -> PSFResult:
    """Return both results as one, by ascending wavelength. Wavelengths of `between` lie between those of `result`."""
    import drjit as dr

    def braided(first: Any, second: Any) -> list[Any]:
        return [(first, second)[index % 2][index // 2] for index in range(len(first) + len(second))]

    types = precision(result.requests[0].problem.dtype)
    count, height, width = result.tensor.shape
    size, parts = height * width, [types.Float(dr.ravel(each.tensor)) for each in (result, between)]
    both = dr.concat(parts)
    plane = np.array(braided(range(count), range(count, 2 * count - 1)))
    at = types.Index(padded_for_packets(np.repeat(plane * size, size).astype(np.uint32))) + types.Index(
        padded_for_packets(np.tile(np.arange(size), 2 * count - 1).astype(np.uint32))
    )
    return replace(
        result,
        tensor=types.Tensor(dr.gather(types.Float, both, at), (2 * count - 1, height, width)),
        wavelengths=np.array(braided(result.wavelengths, between.wavelengths)),
        plans=tuple(braided(result.plans, between.plans)),
        requests=tuple(braided(result.requests, between.requests)),
        field_parts=None,
        for_window=result.for_window or between.for_window,
    )
