"""The period of a finite transform, chosen long enough to keep light from wrapping around into the window.

A finite transform repeats the field every period. Over a distance z, light of frequency f moves z tan θ sideways, sin θ
= λ|f|. If it lands near the window, the period must be long enough. Light that lands farther away is faded out.

If no light can be faded, the spectrum is truncated at the Nyquist frequency f_N, which causes a blur. Along one axis,
the field is ∫ S(f) e^{2πi (f x + z √(1/λ² - f²))} df up to f_N. The contribution of the integral's end is

    |b(x)| = |S(f_N)| / (2π d),   d = |x - walk(f_N)|,                                                             (1)

where walk(f) = z tan θ is the sideways displacement of light of frequency f, and 2πd is the derivative of the phase.
This is the first term of an integral's expansion about its end (Bleistein & Handelsman, Asymptotic Expansions of
Integrals, §3.2). It decreases slowly with d, so the blur of the next period reaches the window. Consider a source of
width L that emits light of the frequency f_N evenly and incoherently, and the copy of this source in the next period.
Let g be the gap between the place where light of the copy lands and a window of width W. The power that the blur brings
into the window, divided by the power |S|² at f_N, is

    ∫_0^L ds/L ∫_0^W dx / (2π (g + s + x))² = ln(1 + L W / (g (g + L + W))) / (4π² L).                             (2)
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from optics.numerics.accuracy import MOST_SAMPLES, AccuracyError
from optics.numerics.array_sum_cost import lines_seconds, sum_seconds
from optics.numerics.cost import PASSAGE_CALL, TRANSFER_SAMPLE
from optics.numerics.fourier import fast_length
from optics.numerics.grid import Grid
from optics.propagation.transfer_function import (
    EVERYTHING,
    PERIOD_MAX_SINE,
    Band,
    Passage,
    kept_band,
    kept_square,
    walk,
)

__all__ = ["KeptLight", "TransformSampling", "blur_left", "blurred_back", "kept_light", "most_spare", "sampling"]

# Pitches count as equal if positions differ by less than this fraction of a sample over the whole window (rounding).
SAME_PITCH = 1e-9
# Choice: fraction of the spectrum, and number of its lines, from which the power at the Nyquist frequency is
# determined.
NYQUIST_SHARE, NYQUIST_LINES = 1 / 16, 9


@dataclass(frozen=True)
class TransformSampling:
    """Sampling of a transform between two planes.

    period: period of the Fourier transform in samples of the source.
    across: number of frequencies along each axis.
    step: pitch of the window in samples of the source if the pitch is a whole number of samples, else 0.
    reach: sideways distance [m] from an edge of the source to the opposite edge of the window, along x or along y,
        whichever distance is larger.
    """

    passage: Passage
    source: Grid
    window: Grid
    period: int
    across: int
    step: int
    reach: float

    @property
    def method(self) -> str:
        return "fresnel" if self.passage.paraxial else "angular_spectrum"

    @property
    def samples(self) -> tuple[int, int]:
        return self.period, self.period

    @property
    def back_period(self) -> float:
        """Period of the transform, in samples of the window.

        A period that differs from a whole number only by rounding errors is rounded to this number.
        """
        period = self.period * self.source.dx / self.window.dx
        return float(round(period)) if abs(period - round(period)) <= SAME_PITCH else period

    def seconds(self, real: str, planes: int = 1) -> float:
        """Return the predicted time [s] for propagating this number of planes and computing the transfer function.

        real: type of real and imaginary parts, "float32" or "float64".
        """
        period, across = self.period, self.across
        if self.step:
            sums = lines_seconds(self.source.shape[0] + 2 * across + self.window.shape[0], period, real)
        else:
            sums = sum_seconds(self.source.shape, period, (across, across), real)
            sums += sum_seconds((across, across), self.back_period, self.window.shape, real)
        transfer = across * (period if self.step else across) * TRANSFER_SAMPLE
        return PASSAGE_CALL["angular_spectrum"] + planes * sums + transfer

    @property
    def why(self) -> str:
        """Text that gives the reason for the sampling, used in the plan of a result of `propagate`."""
        band = self.passage.band
        kept = f"band {band.kept * self.passage.wavelength:.2g} n/λ" if band.fade else "the whole spectrum of u"
        paraxial = "; paraxial, as requested" if self.passage.paraxial else ""
        return f"period {self.period * self.source.dx:.3g} m, {kept}{paraxial}"


@dataclass(frozen=True)
class KeptLight:
    """The light that can reach a window.

    band: band of frequencies of this light.
    reach: sideways distance [m] from an edge of the source to the opposite edge of the window, along x or along y,
        whichever distance is larger.
    """

    band: Band
    reach: float


def kept_light(passage: Passage, source: Grid, window: Grid) -> KeptLight:
    """Return the light that can reach the window: its band of frequencies and the distance `KeptLight.reach`.

    If `passage.limit` is a band, this band is used instead. The spectrum ends at the Nyquist frequency of the source's
    samples. If the band contains the whole spectrum, no light can be faded out, and the band is replaced by one that
    contains all frequencies.
    """
    wavelength, z, ripple, paraxial = passage.wavelength, abs(passage.z), passage.ripple, passage.paraxial
    # The source is extended by one sample, because the band-limited function extends beyond the outermost samples.
    reach = max(
        (n // 2 + 1) * source.dx + (m // 2) * window.dx + abs(middle)
        for n, m, middle in zip(source.shape, window.shape, window.centre[::-1], strict=True)
    )
    band, nyquist = passage.limit, 0.5 / source.dx
    if band is None:
        corner = source.half_diagonal + source.dx + window.half_diagonal
        bands = (
            kept_square(reach, wavelength, z, ripple, paraxial),
            kept_band(corner, wavelength, z, ripple, paraxial),
        )
        band = min(bands, key=lambda band: band.walk)
    everything = band.end >= (nyquist if band.square else math.sqrt(2) * nyquist)
    return KeptLight(EVERYTHING if everything else band, reach)


@lru_cache(maxsize=64)
def sampling(passage: Passage, source: Grid, window: Grid, spare: float) -> TransformSampling:
    """Return the sampling with the shortest possible period for propagating a field from a source to a window.

    The result's `passage` equals the argument, except that its band of frequencies comes from `kept_light`.

    spare: length [m] by which the period is extended if light of every frequency lands in or near the window, so that
        none can be faded out. The spectrum is then truncated at the Nyquist frequency, which blurs the field, and the
        longer period keeps the blur away from the window.

    Raises:
        AccuracyError: along an axis, the transform needs more frequencies, or the window samples, than MOST_SAMPLES.
    """
    light = kept_light(passage, source, window)
    band, reach = light.band, light.reach
    far = band.walk if band.fade else _farthest(0.5 / source.dx, passage.wavelength, abs(passage.z), passage.paraxial)
    far += 0.0 if band.fade else spare
    # Light that moves `far` from the source's far edge must not wrap around to the window's edge, and the source must
    # fit into the period.
    least = max(reach + far, 2 * (max(source.shape) // 2 + 1) * source.dx)
    samples = fast_length(least / source.dx)
    half = band.end * samples * source.dx  # this is a float, because it may be infinite
    across = 2 * math.ceil(half) + 1 if band.fade and 2 * half + 2 < samples else samples
    if max(across, *window.shape) > MOST_SAMPLES:
        raise AccuracyError(
            f"distance = {passage.z:g} m over a window of {2 * window.half_width:.3g} m needs {across} samples across; "
            f"the limit is {MOST_SAMPLES}: shrink the window, or sample u more coarsely if it allows"
        )
    step = round(window.dx / source.dx)
    exactly = abs(window.dx - step * source.dx) <= SAME_PITCH * source.dx / max(window.shape)
    return TransformSampling(
        replace(passage, band=band), source, window, samples, across, step if exactly else 0, reach
    )


def most_spare(passage: Passage, source: Grid) -> float:
    """Return the largest useful value of `spare` [m], the length by which `sampling` extends a transform's period.

    A Fourier transform repeats the field every period, and the truncation of the spectrum blurs the field. A longer
    period keeps the blurred light of the next repetition away from the window, but an extension beyond the returned
    length has no further effect. The result is an upper bound. Light at the spectrum's corner (√2 times the Nyquist
    frequency) moves farthest. It is assumed to move along x or y instead of along the diagonal.
    """
    nyquist, z, paraxial = 0.5 / source.dx, abs(passage.z), passage.paraxial
    end = math.sqrt(2) * nyquist
    whole = walk(end if paraxial else min(end, PERIOD_MAX_SINE / passage.wavelength), passage.wavelength, z, paraxial)
    return whole - _farthest(nyquist, passage.wavelength, z, paraxial)


def _farthest(nyquist: float, wavelength: float, z: float, paraxial: bool) -> float:
    """Return the largest displacement [m] along x or y of light with |fx| and |fy| up to f_N = `nyquist`.

    Light at the angle θ to the optical axis, with sin θ = λ|f|, moves z tan θ in the direction of (fx, fy), so its
    displacement along x is z tan θ fx/|f|. This is largest for fx = f_N and the largest tan θ, which occurs at the
    corner |f| = √2 f_N, or at sin θ = PERIOD_MAX_SINE if this sine is smaller. In the paraxial case, it is zλ fx for
    every fy.
    """
    if paraxial:
        return walk(nyquist, wavelength, z, paraxial)
    end = min(math.sqrt(2) * nyquist, PERIOD_MAX_SINE / wavelength)
    return walk(end, wavelength, z) * min(nyquist / end, 1)


def blurred_back(spectrum: np.ndarray, how: TransformSampling) -> float:
    """Return the power [units of Σ|u|²] that reaches the window because truncation of the spectrum blurs the field.

    A Fourier transform repeats the field every period. The field is blurred, because its spectrum is truncated at the
    Nyquist frequency, so light of the next repetition reaches the window. It is assumed that light of this frequency
    comes evenly from the whole width of the source.

    spectrum: spectrum of the field at the source. If the window's pitch is a whole multiple of the source's pitch, the
        axes are (fx, fy) in FFT order. Otherwise they are (fy, fx), with frequency 0 in the centre.
    """
    nyquist = 0.5 / how.source.dx
    if how.passage.band.fade or not (how.passage.paraxial or nyquist * how.passage.wavelength < PERIOD_MAX_SINE):
        return 0.0  # a spectrum that is faded or decays is not truncated
    width = max(round(NYQUIST_SHARE * how.period), 1)
    lines = np.unique(np.linspace(-width, width, NYQUIST_LINES).round().astype(int))
    lines = (lines + (how.period // 2 if how.step else 0)) % how.period
    total = 0.0
    for axis in (0, 1):  # axis along which the blur returns (y, x)
        across = axis if how.step else 1 - axis  # axis of the spectrum for the frequency along the other axis
        u = np.take(spectrum, lines, axis=1 - across)
        power = u.real**2 + u.imag**2
        total += float(power.mean(axis=1 - across) @ _blur_weights(how, axis))
    return total


def blur_left(how: TransformSampling, roomier: TransformSampling) -> float:
    """Return the blur's amplitude in the sampling `roomier`, with its longer period, divided by that amplitude in
    `how`.

    The blur is light that reaches the window because the spectrum is truncated (see `blurred_back`). It is assumed that
    the power at the Nyquist frequency along one axis does not depend on the frequency along the other axis.
    """
    power, left = (sum(float(_blur_weights(sampling, axis).sum()) for axis in (0, 1)) for sampling in (how, roomier))
    return math.sqrt(left / power) if power else 1.0


@lru_cache(maxsize=8)
def _blur_weights(how: TransformSampling, axis: int) -> np.ndarray:
    """Return the power that a blur brings into the window, divided by the power |U|² at the Nyquist frequency f_N.

    The spectrum is truncated at f_N along an axis, which blurs the field. A Fourier transform repeats the field every
    period, so the blur b around the next repetition extends into the window. U = Σ u e^{-2πi...} is a sum over the
    source's samples, and the blur's power is a sum of |b|² over samples at the pitch dx. The result is a product. Its
    first factor is ∫|b|² dx / |S|², from equation (2) in the module's docstring, where S = U dx. The factor dx²
    converts |S|² to |U|², and 1/dx converts the integral to a sum along the axis. By Parseval's theorem, the factor
    1/period converts a sum over frequencies along the other axis to a sum over samples. A factor of 2 is for the two
    ends ±f_N. The last factor is the fraction of light that lands within the window's range along the other axis.

    axis: axis of the blur, 0 for y, 1 for x. The result has one value per frequency along the other axis, (frequency,).
    """
    source, window = how.source, how.window
    others = (np.arange(how.period) - how.period // 2) / (how.period * source.dx)
    far, aside = _walks(0.5 / source.dx, np.fft.ifftshift(others) if how.step else others, how)
    lit, seen = (grid.shape[axis] * grid.dx for grid in (source, window))
    lands = _landing_fraction(aside, how, 1 - axis)
    gap = np.maximum(how.period * source.dx - how.reach - np.where(lands > 0, far, 0), source.dx)
    comes_back = np.log1p(lit * seen / (gap * (gap + lit + seen))) / (4 * math.pi**2 * lit)  # (2)
    weights: np.ndarray = 2 * comes_back * lands * source.dx / how.period
    return weights


def _landing_fraction(walks: np.ndarray, how: TransformSampling, axis: int) -> np.ndarray:
    """Return the fraction of a source's light that lands within the window's range along an axis (0 for y, 1 for x).

    When the source's light lands, it covers an interval as wide as the source, displaced by `walks`. The fraction is
    the width of the overlap of this interval and the window, divided by the width of the source.

    walks: displacements [m] of the light along this axis.
    """
    lit, seen = (grid.shape[axis] * grid.dx for grid in (how.source, how.window))
    missed = np.maximum(walks - abs(how.window.centre[1 - axis]), 0)
    fraction: np.ndarray = np.clip((lit + seen) / 2 - missed, 0, min(lit, seen)) / lit
    return fraction


def _walks(fx: float, fy: np.ndarray, how: TransformSampling) -> tuple[np.ndarray, np.ndarray]:
    """Return the displacements [m] along x and y of light with the frequencies (fx, fy).

    They are z λ fx / cos θ and z λ |fy| / cos θ, with the distance z between the planes and the angle θ to the optical
    axis.

    Both are infinite for light that is too near grazing incidence.
    """
    wavelength, z = how.passage.wavelength, abs(how.passage.z)
    sine2 = 0 * fy if how.passage.paraxial else (fx**2 + fy**2) * wavelength**2
    steep = sine2 >= PERIOD_MAX_SINE**2
    per_sine = np.where(steep, math.inf, z * wavelength / np.sqrt(1 - np.where(steep, 0, sine2)))
    return fx * per_sine, np.abs(fy) * per_sine
