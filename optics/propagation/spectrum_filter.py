"""Propagation of one plane by a filter: transform, multiply by the transfer function, transform back."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from optics.numerics.accuracy import FLOAT_NOISE
from optics.numerics.fourier import fourier_sum, kept_indices, periodic_spectrum, periodic_sum
from optics.numerics.grid import Grid
from optics.numerics.precision import Precision, precision
from optics.propagation.field_derivatives import LinearMap
from optics.propagation.misalignment import DepthFactors, Depths, sags
from optics.propagation.transfer_function import Passage, TransferFunction, evanescent
from optics.propagation.transform_sampling import TransformSampling, blurred_back

__all__ = ["PropagatedPlane", "ScaledPlane", "evanescent_share", "filtered", "linear_map"]

# Choice: the evanescent part of the missing light is computed if the missing light exceeds the arriving light by this
# factor. Smaller amounts hardly affect the predicted error.
MUCH = 100.0

HELD = (1e-20, 1e30)  # range of the power Σ|u|² for which float32 can represent the terms of the error estimate
NO_DEPTHS = DepthFactors([(1, 1)], [(1, 1)])  # factors of steps between planes that are not tilted
ONE = np.ones(1)  # stands for equal weights in a sum


@dataclass(frozen=True)
class PropagatedPlane:
    """The field in a plane after propagation, with its errors.

    u: field (y, x).
    error: predicted error of the intensity.
    blur: additional error from light at the Nyquist frequency of the samples.
    """

    u: np.ndarray
    error: float
    blur: float


@dataclass(frozen=True)
class ScaledPlane:
    """A plane u (y, x), divided by `brightest` so that float32 can represent its power Σ|u|².

    brightest: modulus of the brightest sample, or 1 if the power needs no division.
    """

    u: np.ndarray
    power: float
    brightest: float

    @classmethod
    def from_plane(cls, given: np.ndarray, types: Precision) -> ScaledPlane:
        with np.errstate(over="ignore"):
            plane = np.ascontiguousarray(given, dtype=types.complex_dtype)
            total = _power(plane)
        if HELD[0] < total < HELD[1]:
            return cls(plane, total, 1.0)
        brightest = float(np.abs(given).max(initial=0.0))
        if brightest == 0:
            return cls(plane, 0.0, 1.0)
        plane = np.ascontiguousarray(given / brightest, dtype=types.complex_dtype)
        return cls(plane, _power(plane), brightest)

    def restored(self, result: np.ndarray) -> np.ndarray:
        """Return the field after propagation, `result`, multiplied by `brightest`, which undoes the division."""
        return result if self.brightest == 1 else result * result.dtype.type(self.brightest)


def filtered(
    given: np.ndarray, how: TransformSampling, types: Precision, depths: Depths | None = None
) -> PropagatedPlane:
    """Return the field in a window after propagation from another plane. If `depths` is not None, planes may be tilted.

    given: field in the other plane, (y, x).
    """
    scaled = ScaledPlane.from_plane(given, types)
    plane, total = scaled.u, scaled.power
    if total == 0:
        return PropagatedPlane(np.zeros(how.window.shape, types.complex_dtype), 0.0, 0.0)
    space = _free_space(how, types.dtype)
    factors = None if depths is None else depths.factors(_sines(how), how.passage.wavelength, types)
    if factors is None:
        spectrum = _spectrum(plane, how)
    else:
        spectrum = sum(factor * _spectrum(plane * weight, how) for weight, factor in factors.leaving)
    grazing = _power(spectrum, space.grazing) / how.period**2
    blurred = blurred_back(spectrum, how)
    spectrum *= space.transfer
    # By Parseval's theorem, missing power was either faded out or is evanescent. If no power is missing, the difference
    # is a rounding error of float32, which is small compared with the remainder of the fade.
    faded = max(total - _power(spectrum) * how.period**2, 0.0) if how.passage.band.fade else 0.0
    if factors is None:
        result = _result(spectrum, how)
    else:
        result = sum(weight * _result(factor * spectrum, how) for weight, factor in factors.arriving)
    arrived = _power(result) * (how.window.dx / how.source.dx) ** 2
    if not arrived:
        return PropagatedPlane(result, math.inf, math.inf)
    if faded > MUCH * arrived:
        faded = max(faded - total * evanescent_share(plane, how.period, how.source.dx, how.passage), 0.0)
    rounding = FLOAT_NOISE[types.dtype] * (1 + math.sqrt(total / arrived))
    # Light at the start of a fade is blurred but hardly weaker. It is assumed to be as bright as the light that
    # arrives.
    blurred_by_fade = 2 * how.passage.ripple * (1 + math.sqrt(faded / arrived)) if how.passage.band.fade else 0.0
    error = 2 * math.sqrt(grazing / arrived) + rounding + blurred_by_fade
    return PropagatedPlane(scaled.restored(result), error, 2 * math.sqrt(blurred / arrived))


def linear_map(
    how: TransformSampling, shape: tuple[int, int], types: Precision, depths: Depths | None = None
) -> LinearMap:
    """Return a linear map that propagates fields (y, x) of this shape as `filtered` does.

    The map depends on the distance z between the planes. Its derivative with respect to z (`LinearMap.rate`) does not
    include the derivative of the carrier exp(ikz).
    """
    how, crop = replace(how, step=0), _middle(shape, how.source.shape)
    transfer = _free_space(how, types.dtype).transfer
    factors = NO_DEPTHS if depths is None else depths.factors(_sines(how), how.passage.wavelength, types)

    def spectrum(u: np.ndarray) -> np.ndarray:
        return transfer * sum(factor * _spectrum(u[crop] * weight, how) for weight, factor in factors.leaving)

    def onto_window(arriving: np.ndarray) -> np.ndarray:
        found: np.ndarray = sum(weight * _result(factor * arriving, how) for weight, factor in factors.arriving)
        return found

    def rate(u: np.ndarray) -> np.ndarray:
        turns = (sags(_sines(how)) * (-2j * np.pi / how.passage.wavelength)).astype(types.complex_dtype)
        return onto_window(turns * spectrum(u))

    def adjoint(grad: np.ndarray) -> np.ndarray:
        size = how.across, how.across
        back = sum(
            np.conj(factor) * fourier_sum(np.conj(weight) * grad, how.back_period, size, -1)
            for weight, factor in factors.arriving
        )
        back = back * transfer.conj()
        found = np.zeros(shape, types.complex_dtype)
        for weight, factor in factors.leaving:
            found[crop] += np.conj(weight) * fourier_sum(np.conj(factor) * back, how.period, how.source.shape, +1)
        return found

    return LinearMap(lambda u: onto_window(spectrum(u)), adjoint, rate)


def _middle(shape: tuple[int, int], part: tuple[int, int]) -> tuple[slice, ...]:
    """Return the index of a part that has the same centre as the whole. The centre of n samples is sample n//2."""
    starts = [n // 2 - m // 2 for n, m in zip(shape, part, strict=True)]
    return tuple(slice(start, start + m) for start, m in zip(starts, part, strict=True))


def _spectrum(plane: np.ndarray, how: TransformSampling) -> np.ndarray:
    """Return the spectrum of the field in a plane (y, x).

    If `how.step` is 0, the axes of the spectrum are (fy, fx), with frequency 0 in the centre. Otherwise they are (fx,
    fy), in the order of a fast Fourier transform.
    """
    if how.step:
        return periodic_spectrum(plane, how.period, how.across)
    return fourier_sum(plane, how.period, (how.across, how.across), -1)


def _result(spectrum: np.ndarray, how: TransformSampling) -> np.ndarray:
    """Return the field (y, x) at the samples of the window, given its spectrum."""
    if how.step:
        return periodic_sum(spectrum, how.period, how.step, how.window.shape)
    return fourier_sum(spectrum, how.back_period, how.window.shape, +1)


def _sines(how: TransformSampling) -> np.ndarray:
    """Return sin θ for each frequency along an axis of a centred spectrum."""
    return Grid.square(how.across, how.passage.wavelength / (how.period * how.source.dx)).x


def evanescent_share(plane: np.ndarray, period: int, dx: float, passage: Passage) -> float:
    """Return the evanescent fraction of a plane's power; 0 in Fresnel's approximation."""
    total = _power(plane)
    highest = math.sqrt(0.5) / dx * passage.wavelength  # sine, at the corner of the spectrum
    if total == 0 or passage.paraxial or highest * (1 + 2 / period) < 1:
        return 0.0
    spectrum = periodic_spectrum(plane, period, period)
    weights = evanescent(period, dx, passage.wavelength)
    lost = float(np.sum(weights * (spectrum.real**2 + spectrum.imag**2), dtype=np.float64)) / period**2
    return min(lost / total, 1.0)


def _power(u: np.ndarray, weight: np.ndarray | None = ONE) -> float:
    """Return Σ w |u|² over all samples of u, or 0 if `weight` is None.

    weight: weights w. An array other than ONE has two equal entries in succession for each sample, one for the real and
        one for the imaginary part.
    """
    if weight is None:
        return 0.0
    if weight is ONE:
        return float(np.vdot(u, u).real)
    parts = u.view(weight.dtype)
    return float(np.dot((parts * parts).ravel(), weight.ravel()))


@lru_cache(maxsize=4)
def _free_space(how: TransformSampling, dtype: str) -> TransferFunction:
    """Return the transfer function for all frequencies of a spectrum, divided by period² to normalise the transforms.

    The Fourier transforms to and from the spectrum are not normalised themselves. The result is cached, because it
    takes more time than the transforms, and the same distance is often used again.
    """
    step = 1 / (how.period * how.source.dx)
    if how.step:  # the axes of the spectrum are (fx, fy)
        fx, fy = (kept_indices(n) * step for n in (how.across, how.period))
        space = replace(how.passage, centre=how.passage.centre[::-1]).over(fy, fx, precision(dtype))
    else:
        fx = fy = Grid.square(how.across, step).x
        space = how.passage.over(fx, fy, precision(dtype))
    space.transfer[:] *= 1 / how.period**2
    return space
