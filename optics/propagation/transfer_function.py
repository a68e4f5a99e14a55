"""Free space between two planes as a filter.

The module computes the filter's transfer function, and the band of frequencies that can reach the window.

    H = exp(2πi z √((n/λ)² - fx² - fy²))     (Goodman, §3.10.2)

With sin θ = λf/n, the exponent is ikz - ikz (1 - cos θ). The first part is the same for all frequencies, so whole waves
can be subtracted from it exactly. Only the second part has a rounding error. This error does not grow with the
distance, because the samples resolve the second part.

Light at an angle θ to the axis moves z tan θ to the side. If this exceeds the distance from the far edge of one plane
to the far edge of the other, the light cannot reach the window. It is faded out, because it would otherwise wrap
around.

To fade light out, the spectrum is multiplied by factors that fall from 1 to 0. This blurs the field over a distance
that is inversely proportional to the width of the fade in frequency. Faded light must not be blurred into the window.
It must therefore land outside the window by at least the blur distance. A narrow fade has a large blur distance. A wide
fade, however, ends at a high frequency, whose light moves far to the side. The width is a compromise between the two.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from optics.apertures.soft_edge import kaiser_beta
from optics.methods.angular_spectrum import versine
from optics.numerics.autodiff import Array
from optics.numerics.field import Field
from optics.numerics.grid import Grid
from optics.numerics.interpolation import Interpolant
from optics.numerics.precision import Precision, opaque, padded_for_packets

__all__ = [
    "PERIOD_MAX_SINE",
    "Band",
    "TransferFunction",
    "evanescent",
    "kept_band",
    "kept_square",
    "limited_band",
    "walk",
]

# Choice: the period is long enough for light up to this sin θ. z tan θ has no bound at grazing incidence.
PERIOD_MAX_SINE = 0.995
# Choice: largest sine at which a fade along each axis may end. Towards grazing incidence, fades would become ever
# narrower.
STEEPEST_SQUARE = 0.8
# Choice: blur of the outermost light, relative to the blur of the whole fade. It is smaller, because the outer end of a
# fade is dark.
OUTWARDS = 0.6
# Choice: widths of the fade to try, in units of the sine.
FADE_SINES = np.geomspace(0.003, 0.6, 33)


@dataclass(frozen=True)
class Band:
    """A band of frequencies: light is unchanged up to `kept` [1/m] and faded out between `kept` and `kept` + `fade`.

    kept: infinite if no light is faded out. The band then contains all frequencies.
    square: False for one fade of the radial frequency √(fx² + fy²). True for the product of two fades, one along x and
        one along y. In the paraxial case, these are functions of fx and of fy. Otherwise the fade along x is a function
        of fx / √(1 - λ²fy²), and the fade along y is a function of fy / √(1 - λ²fx²).
    walk: largest sideways displacement [m] of the band's light at the next plane. It is the displacement of light at
        the frequency `kept` + `fade`, plus the distance over which this light is blurred by the fade.
    """

    kept: float
    fade: float
    walk: float
    square: bool = False

    @property
    def end(self) -> float:
        return self.kept + self.fade

    def diagonal(self, wavelength: float) -> float:
        """Return the highest radial frequency √(fx² + fy²) [1/m] of a square band (`Band.square`).

        There, fx = fy. Light is faded out completely where fx / √(1 - λ²fy²) reaches `kept` + `fade`. λ is the
        wavelength [m] in the medium.
        """
        return math.sqrt(2) * self.end / math.hypot(1, self.end * wavelength)


EVERYTHING = Band(math.inf, 0.0, math.inf)


def walk(frequency: float, wavelength: float, z: float, paraxial: bool = False) -> float:
    """Return the distance [m] that light of a spatial frequency [1/m] moves sideways over the distance z [m]."""
    sine = frequency * wavelength
    return z * (sine if paraxial else sine / math.sqrt(1 - sine * sine))


def kept_band(corner: float, wavelength: float, z: float, ripple: float, paraxial: bool = False) -> Band:
    """Return the band of the light whose sideways displacement over the distance z is at most `corner` [m].

    Light of higher frequencies is faded out. The fade has the width with which the period of the Fourier transforms can
    be shortest. The result is `EVERYTHING`, without a fade, if z is 0 or if a fade of any width would include light too
    near grazing incidence.

    ripple: fraction of the amplitude of faded light that may land at displacements of at most `corner`. Some of it
        lands there, because the fade blurs the field.
    """
    return _shortest(corner, wavelength, z, ripple, paraxial, square=False)


def kept_square(half: float, wavelength: float, z: float, ripple: float, paraxial: bool = False) -> Band:
    """Return the band of the light whose displacements along x and along y over the distance z are at most `half` [m].

    Light that moves farther along x or y is faded out. In a square window, displacements as far as a corner occur only
    along the diagonals. The round band of `kept_band` includes displacements of this length in every direction, so the
    square band can be smaller. Unless paraxial=True, the displacement along x depends on fx / √(1 - λ²fy²) instead of
    fx alone, so the fade along x is a function of this expression. This fade blurs the field over a larger distance
    than a fade in fx. The ratio of the two distances is the largest gradient of the expression. The result is
    `EVERYTHING`, without a fade, if z is 0 or if a fade of any width would end at too large an angle.

    ripple: largest fraction of the faded light's amplitude that may be blurred to displacements of at most `half`.
    """
    return _shortest(half, wavelength, z, ripple, paraxial, square=True)


def limited_band(kept: float, fade: float, wavelength: float, z: float, ripple: float) -> Band:
    """Return the band of light that is unchanged up to `kept` [1/m] and faded out up to `kept` + `fade`.

    This band is for a caller that sets the limits itself, unlike `kept_band` and `kept_square`. The result is
    `EVERYTHING` if light at the frequency kept + fade is too near grazing incidence.

    ripple: largest fraction of the faded light's amplitude that may land beyond `Band.walk`, because the fade blurs the
        field. The smaller the fraction, the larger is `Band.walk`.
    """
    if (kept + fade) * wavelength >= PERIOD_MAX_SINE:
        return EVERYTHING
    blur = kaiser_beta(ripple) / math.pi / fade
    return Band(kept, fade, walk(kept + fade, wavelength, z) + OUTWARDS * blur)


@lru_cache(maxsize=256)
def _shortest(distance: float, wavelength: float, z: float, ripple: float, paraxial: bool, square: bool) -> Band:
    blur = kaiser_beta(ripple) / math.pi
    steepest = STEEPEST_SQUARE if square else PERIOD_MAX_SINE
    best = EVERYTHING
    for fade in FADE_SINES / wavelength if z else ():
        band = 0.0
        # The band and the gradient of its fade depend on each other, hence the iteration.
        for _ in range(3 if square and not paraxial else 1):
            sine = (band + fade) * wavelength
            if not paraxial and sine >= steepest:
                break
            reach = distance + blur / fade * (_gradient(sine) if square and not paraxial else 1.0)
            band = reach / (z if paraxial else math.hypot(reach, z)) / wavelength
        if paraxial or (band + fade) * wavelength < steepest:
            far = walk(band + fade, wavelength, z, paraxial) + OUTWARDS * blur / fade
            best = min(best, Band(band, float(fade), far, square), key=_walk)
    return best


def _walk(band: Band) -> float:
    return band.walk


def _gradient(sine: float) -> float:
    """Return the largest gradient |∇F| of F(fx, fy) = fx / √(1 - λ²fy²).

    Over a distance z, light moves zλF / √(1 - λ²F²) along x. In a band with `Band.square`, the fade along x is a
    function of F.

    sine: largest value of λ|F| and of λ|fy|, where λ is the wavelength, and fx and fy are spatial frequencies.
    """
    cosine2 = 1 - sine * sine
    return math.sqrt((1 + sine**4 / cosine2) / cosine2)


@lru_cache(maxsize=4)
def evanescent(samples: int, dx: float, wavelength: float) -> np.ndarray:
    """Return the evanescent fraction of each cell of a spectrum, (samples, samples) in FFT order.

    Waves outside the circle f = 1/wavelength, with the wavelength in the medium, do not propagate. Within a cell, the
    circle is approximated by a straight edge. The error is of the order of the cell's width squared.
    """
    f = np.fft.fftfreq(samples) * wavelength / dx
    fraction: np.ndarray = np.clip((np.hypot(f[None, :], f[:, None]) - 1) * samples * dx / wavelength + 0.5, 0, 1)
    return fraction


@lru_cache(maxsize=8)
def _fade_table(ripple: float) -> Interpolant:
    """Return a function that decreases from f(0) = 1 to f(1) = 0: the complement of the integral of a Kaiser window.

    A fade of this shape over a band of width Δf blurs a field over the distance β/(π Δf), where β is the window's
    parameter. A fraction `ripple` of the amplitude of the faded light lands beyond this distance.
    """
    beta = kaiser_beta(ripple)
    nodes, weights = np.polynomial.legendre.leggauss(math.ceil(beta) + 24)

    def left(t: np.ndarray) -> np.ndarray:
        half = (1 - np.clip(t, 0, 1))[:, None]
        places = 2 * (1 - half + half * (nodes + 1) / 2) - 1
        window = np.i0(beta * np.sqrt(np.maximum(1 - places**2, 0)))
        whole: np.ndarray = half[:, 0] * (window @ weights)
        return whole

    total = left(np.zeros(1))[0]
    return Interpolant.from_function(lambda t: left(t) / total, (0.0, 1.0), beta / math.pi, 0.1 * ripple)


@dataclass(frozen=True, eq=False)
class TransferFunction:
    """Factors for each frequency of a spectrum.

    transfer: the transfer function, with all factors that do not depend on the field, complex (fy, fx).
    grazing: 1 for frequencies whose light is too near grazing incidence, else 0, (fy, 2 fx). Each value occurs twice in
        succession, for the real and the imaginary part of the spectrum. `grazing` is None if all values would be 0.
    """

    transfer: np.ndarray
    grazing: np.ndarray | None


@dataclass(frozen=True)
class Passage:
    """The passage of light from one plane to a window in another plane: parameters of its transfer function.

    wavelength: wavelength [m] in the medium.
    z: distance [m] between the planes, negative for backward propagation.
    paraxial: True for Fresnel's approximation.
    band: band of the light that can reach the window.
    centre: position (x, y) [m] of the window.
    ripple: light outside the band is faded out, which blurs the field, so some of this light reaches the window.
        `ripple` is the largest fraction of its amplitude that may do so.
    limit: band beyond which light is removed although it could reach the window; None if there is no limit.
    by_transforms: True if Fourier transforms must not be replaced by matrix products.

    Evanescent waves decay in forward propagation and are omitted in backward propagation (z < 0).
    """

    wavelength: float
    z: float
    paraxial: bool
    band: Band
    ripple: float
    centre: tuple[float, float]
    limit: Band | None = None
    by_transforms: bool = False

    def over(self, fx: np.ndarray, fy: np.ndarray, types: Precision) -> TransferFunction:
        """Return the transfer function at the frequencies fx of the columns and fy of the rows [1/m]."""
        grazing = None
        if math.isinf(self.band.kept) and self.z != 0 and not self.paraxial:
            sine = np.hypot(fx[None, :], fy[:, None]) * self.wavelength
            grazing = (sine > PERIOD_MAX_SINE) & (sine < 1)
        weight = None if grazing is None or not grazing.any() else np.repeat(grazing, 2, axis=1).astype(types.dtype)
        return TransferFunction(self._transfer(fx, fy, types), weight)

    def _transfer(self, fx: np.ndarray, fy: np.ndarray, types: Precision) -> np.ndarray:
        """Return the transfer function H of free space, multiplied by the factors that fade out light outside `band`.

        The result also contains the phase that displaces the field to the window's centre. It is an array (fy, fx).
        Whole waves are subtracted from the phases in float64.
        """
        import drjit as dr

        grid = Grid((len(fy), len(fx)), 1.0)
        x, y = (types.Float64(padded_for_packets(a)) for a in np.meshgrid(fx, fy))
        s2 = (x * x + y * y) * opaque(types, self.wavelength**2)
        z = opaque(types, self.z / self.wavelength)
        if self.paraxial:
            sag, decay = s2 / 2, types.Float64(1)
        else:
            sag = versine(dr.minimum(s2, 1))
            gone = dr.exp(-2 * math.pi * dr.abs(z) * dr.sqrt(dr.maximum(s2 - 1, 0)))
            decay = dr.select(s2 < 1, 1, gone if self.z >= 0 else 0)
        if self.band.fade:
            decay *= self._faded(x, y, types)
        waves = opaque(types, math.fmod(self.z, self.wavelength) / self.wavelength) - z * sag
        waves += x * opaque(types, self.centre[0]) + y * opaque(types, self.centre[1])
        return Field.from_waves(decay, waves, grid, types).numpy()

    def _faded(self, x: Array, y: Array, types: Precision) -> Array:
        import drjit as dr

        table, kept, fade = _fade_table(self.ripple), self.band.kept, self.band.fade

        def left(frequency: Array) -> Array:
            return table.at((dr.abs(frequency) - opaque(types, kept)) * opaque(types, 1 / fade), types)

        if not self.band.square:
            return left(dr.sqrt(x * x + y * y))
        if self.paraxial:
            return left(x) * left(y)
        wavelength2 = opaque(types, self.wavelength**2)
        along_x, along_y = (dr.sqrt(dr.maximum(1 - wavelength2 * f * f, 1e-12)) for f in (y, x))
        return left(x / along_x) * left(y / along_y)
