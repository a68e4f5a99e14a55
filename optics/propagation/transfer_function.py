"""Free space between two planes as a filter: which frequencies may matter, and the transfer function over them.

    H = exp(2πi z √((n/λ)² - fx² - fy²))     (Goodman, §3.10.2)

Light of a frequency walks z tan θ to the side. What walks farther than from one plane's far edge to the other's is
faded out before it can wrap around: a narrow fade blurs far, so that the band must reach as far outside the window; a
wide one lets light walk far before it is gone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from optics.apertures.soft_edge import kaiser_beta
from optics.numerics.autodiff import Array
from optics.numerics.field import Field
from optics.numerics.grid import Grid
from optics.numerics.interpolation import Interpolant
from optics.numerics.precision import Precision, opaque, padded_for_packets

__all__ = ["PERIOD_MAX_SINE", "Band", "TransferFunction", "evanescent", "kept_band", "kept_square", "walk"]

# Steepest light that a period makes room for, as sin θ; z tan θ has no bound beyond.
PERIOD_MAX_SINE = 0.995
# Steepest fade along the axes, one by one: towards grazing they would be ever narrower.
STEEPEST_SQUARE = 0.8
# What a fade blurs lands outside its own walk as well, though less: its last part is dark.
OUTWARDS = 0.6


@dataclass(frozen=True)
class Band:
    """Light kept whole up to `kept` [1/m], gone at kept + fade; kept is infinite where nothing may fade.

    square: along each axis by itself, whatever the frequency along the other; else by the angle to the axis.
    walk: how far [m] to the side the last of it goes, blur included.
    """

    kept: float
    fade: float
    walk: float
    square: bool = False

    @property
    def end(self) -> float:
        return self.kept + self.fade

    def diagonal(self, wavelength: float) -> float:
        """Highest frequency [1/m] of a square band, along its diagonal: fx = fy and fx / √(1 - λ²fy²) = end."""
        return math.sqrt(2) * self.end / math.hypot(1, self.end * wavelength)


EVERYTHING = Band(math.inf, 0.0, math.inf)


def walk(frequency: float, wavelength: float, z: float, paraxial: bool = False) -> float:
    """How far [m] to the side light of a spatial frequency [1/m] travels."""
    sine = frequency * wavelength
    return z * (sine if paraxial else sine / math.sqrt(1 - sine * sine))


def kept_band(corner: float, wavelength: float, z: float, ripple: float, paraxial: bool = False) -> Band:
    """Band kept whole for light that may walk `corner` [m] to the side over z, and the fade beyond it, that need the
    shortest period; `EVERYTHING` where nothing may fade."""
    return _shortest(corner, wavelength, z, ripple, paraxial, square=False)


def kept_square(half: float, wavelength: float, z: float, ripple: float, paraxial: bool = False) -> Band:
    """The same for light that may walk `half` [m] along each axis: a window's side is nearer than its corner.

    Along x it is fx / √(1 - λ²fy²) that tells how far light walks, so that the fade follows that. Its gradient blurs
    farther than a fade in fx alone would.
    """
    return _shortest(half, wavelength, z, ripple, paraxial, square=True)


def _shortest(distance: float, wavelength: float, z: float, ripple: float, paraxial: bool, square: bool) -> Band:
    blur = kaiser_beta(ripple) / math.pi
    steepest = STEEPEST_SQUARE if square else PERIOD_MAX_SINE
    best = EVERYTHING
    for fade in np.geomspace(0.003, 0.6, 33) / wavelength if z else ():
        band = 0.0
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
    """Largest |∇(fx / √(1 - λ²fy²))| where both axes' values stay below `sine`."""
    cosine2 = 1 - sine * sine
    return math.sqrt((1 + sine**4 / cosine2) / cosine2)


@lru_cache(maxsize=4)
def evanescent(samples: int, dx: float, wavelength: float) -> np.ndarray:
    """How much of each frequency of a whole spectrum, (samples, samples) in FFT order, does not propagate. A cell of
    frequencies on the circle f = n/λ counts by how far it reaches outside: an error of its width squared."""
    f = np.fft.fftfreq(samples) * wavelength / dx
    share: np.ndarray = np.clip((np.hypot(f[None, :], f[:, None]) - 1) * samples * dx / wavelength + 0.5, 0, 1)
    return share


@lru_cache(maxsize=8)
def _fade_table(ripple: float) -> Interpolant:
    """1 at 0, 0 at 1: the rest of a Kaiser window's integral. It blurs by β/(π fade) and, beyond, by `ripple`."""
    beta = kaiser_beta(ripple)
    nodes, weights = np.polynomial.legendre.leggauss(math.ceil(beta) + 24)

    def left(t: np.ndarray) -> np.ndarray:
        half = (1 - np.clip(t, 0, 1))[:, None]
        places = 2 * (1 - half + half * (nodes + 1) / 2) - 1
        window = np.i0(beta * np.sqrt(np.maximum(1 - places**2, 0)))
        whole: np.ndarray = half[:, 0] * (window @ weights)
        return whole

    total = left(np.zeros(1))[0]
    return Interpolant.of(lambda t: left(t) / total, (0.0, 1.0), beta / math.pi, 0.1 * ripple)


@dataclass(frozen=True, eq=False)
class TransferFunction:
    """Over a spectrum: the transfer function, with everything that does not depend on the field, and how much of each
    frequency is too near grazing, for real and imaginary parts (fy, 2 fx) (None: nothing is)."""

    transfer: np.ndarray
    grazing: np.ndarray | None


@dataclass(frozen=True)
class Passage:
    """What a transfer function is of. centre: where the window is (x, y) [m]; ripple: what a fade leaves of the light
    beyond it; evanescent waves decay forwards and are dropped backwards (z < 0)."""

    wavelength: float
    z: float
    paraxial: bool
    band: Band
    ripple: float
    centre: tuple[float, float]

    def over(self, fx: np.ndarray, fy: np.ndarray, types: Precision) -> TransferFunction:
        """At frequencies fx (column), fy (row) [1/m]."""
        grazing = None
        if math.isinf(self.band.kept) and self.z != 0 and not self.paraxial:
            sine = np.hypot(fx[None, :], fy[:, None]) * self.wavelength
            grazing = (sine > PERIOD_MAX_SINE) & (sine < 1)
        weight = None if grazing is None or not grazing.any() else np.repeat(grazing, 2, axis=1).astype(types.dtype)
        return TransferFunction(self._transfer(fx, fy, types), weight)

    def _transfer(self, fx: np.ndarray, fy: np.ndarray, types: Precision) -> np.ndarray:
        """H under the fade, with the way to the window's centre; whole waves are dropped in float64."""
        import drjit as dr

        grid = Grid((len(fy), len(fx)), 1.0)
        x, y = (types.Float64(padded_for_packets(a)) for a in np.meshgrid(fx, fy))
        s2 = (x * x + y * y) * opaque(types, self.wavelength**2)
        z = opaque(types, self.z / self.wavelength)
        if self.paraxial:
            waves, decay = z * (1 - s2 / 2), types.Float64(1)
        else:
            waves = z * dr.sqrt(dr.maximum(1 - s2, 0))
            gone = dr.exp(-2 * math.pi * dr.abs(z) * dr.sqrt(dr.maximum(s2 - 1, 0)))
            decay = dr.select(s2 < 1, 1, gone if self.z >= 0 else 0)
        if self.band.fade:
            decay *= self._faded(x, y, types)
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
