"""What a PSF is worth: contrast over spatial frequency, peak, concentration, and one number for an eye.

Where the PSF carries derivatives, so do these numbers, but for encircled energy: they are Dr.Jit arrays then, NumPy
arrays otherwise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from optics.numerics.arguments import in_range, point_2d, positive, reals, shown
from optics.numerics.autodiff import Array, Scalar, number, to_user
from optics.numerics.field import Field
from optics.numerics.fourier import dft2
from optics.numerics.grid import Grid
from optics.numerics.precision import opaque, padded_for_packets, precision
from optics.point_spread.psf import PSFResult

__all__ = ["MTF", "encircled_energy", "image_quality", "mtf", "strehl_ratio"]

ORIENTATIONS = 64
HELD_TOO_MUCH = 1e-2  # above all that arrives, by which sums over coarse samples may err


@dataclass(frozen=True, eq=False)
class MTF:
    """Modulation transfer function on a square grid of spatial frequencies, zero frequency at n//2.

    tensor: (wavelength, fy, fx) in Dr.Jit, 1 at zero frequency; mtf: the same as a NumPy array.
    fx, fy: cycles per metre on the sensor, 1 / (widest side of the window) apart.
    cutoff: (wavelength,) frequency [1/m] beyond which a pupil of this size passes nothing, 2 sin θ / λ.
    """

    tensor: Array
    fx: np.ndarray
    fy: np.ndarray
    cutoff: np.ndarray

    @cached_property
    def mtf(self) -> np.ndarray:
        return np.asarray(self.tensor.numpy())

    def profile(self, frequencies: np.ndarray) -> np.ndarray | Array:
        """Mean over all orientations at radial `frequencies` [1/m], (wavelength, frequency); 0 beyond the grid.

        Interpolated linearly between the grid's frequencies.

        Raises:
            ValueError: the MTF of a single sample.
        """
        import drjit as dr

        if self.fx.size < 2:
            raise ValueError("a PSF of one sample has no frequencies but 0: must be at least 2 x 2")
        types = precision("float64")
        f = np.atleast_1d(np.asarray(frequencies, dtype=np.float64))
        angle = 2 * np.pi * (np.arange(ORIENTATIONS) + 0.5) / ORIENTATIONS
        side, waves = self.fx.size, self.tensor.shape[0]
        places = [
            np.outer(f, wheel) / (self.fx[1] - self.fx[0]) + side // 2 for wheel in (np.sin(angle), np.cos(angle))
        ]
        y, x = (np.tile(place.ravel(), waves) for place in places)
        inside = (y >= 0) & (y <= side - 1) & (x >= 0) & (x <= side - 1)
        row, column = (np.clip(np.floor(place), 0, side - 2).astype(np.int64) for place in (y, x))
        plane = np.repeat(np.arange(waves), f.size * ORIENTATIONS) * side * side
        total = types.Float(0)
        for i, down in enumerate((1 - (y - row), y - row)):
            for j, across in enumerate((1 - (x - column), x - column)):
                at = types.Index((plane + (row + i) * side + column + j).astype(np.uint32))
                total += dr.gather(types.Float, self.tensor.array, at) * types.Float(down * across * inside)
        mean = dr.block_reduce(dr.ReduceOp.Add, total, ORIENTATIONS) / ORIENTATIONS
        return to_user(types.Tensor(mean, (waves, f.size)))


def mtf(result: PSFResult, arriving: Any = None) -> MTF:
    """|F{PSF}| over its value at zero frequency (Goodman, Introduction to Fourier Optics, §6.3.2).

    arriving: what of the pupil's power arrives on the unbounded plane, a number or (wavelength,), in (0, 1]; 1 unless
        the relief sends light into evanescent waves. None: no more than the window holds (`PSFResult.power`). A window
        that loses a share of the light then shows contrasts too high by that share; measured by all that arrives, they
        are right from the first frequency above 0 on.

    Raises:
        ValueError: arriving has another shape, or less arrives than is in the window (but for a hundredth, by which
            sums over coarse samples may err).
    """
    import drjit as dr

    types = precision("float64")
    waves, height, width = result.tensor.shape
    side = max(height, width)
    pitch, middle = 1 / (side * result.dx), (side // 2) * side + side // 2
    flat, planes, known = types.Float(_flat(result.tensor)), [], _arriving(result, arriving)
    for index in range(waves):
        plane = dr.gather(types.Float, flat, dr.arange(types.Index, height * width) + index * height * width)
        field = Field(plane, dr.zeros(types.Float, height * width), Grid((height, width), result.dx), types)
        otf = dft2(field, side, (side, side), -1, pitch)
        size = dr.sqrt(dr.maximum(otf.intensity, 1e-300))
        zero = dr.gather(types.Float, size, types.Index(middle))
        if known is None or known[index] <= result.power[index]:
            planes.append(size / zero)
            continue
        at_zero = dr.arange(types.Index, side * side) == middle
        planes.append(dr.select(at_zero, 1, size * (result.dx**2 / float(known[index]))))
    tensor = types.Tensor(planes[0] if waves == 1 else dr.concat(planes), (waves, side, side))
    f = Grid.square(side, pitch).x
    radius, distance = result.pupil.radius, number(result.sensor_distance)
    cutoff = 2 * radius / np.hypot(radius, distance) * result.pupil.medium_n / result.wavelengths
    return MTF(tensor, f, f, cutoff)


def _arriving(result: PSFResult, arriving: Any) -> np.ndarray | None:
    """Share of the pupil's power that arrives anywhere, (wavelength,)."""
    if arriving is None:
        return None
    held, known = result.power, reals("arriving", arriving)
    if known.shape not in ((), held.shape):
        raise ValueError(f"arriving has shape {known.shape}: must be a number, or one per wavelength {held.shape}")
    if not ((known > 0) & (known <= 1) & (known > held - HELD_TOO_MUCH)).all():
        raise ValueError(f"arriving = {shown(arriving)}: must be in (0, 1], not less than the window's {shown(held)}")
    return np.broadcast_to(known, held.shape)


def strehl_ratio(result: PSFResult) -> np.ndarray | Array:
    """Peak of the PSF over the peak that the same aperture makes without aberration, (wavelength,).

    Unaberrated is the spherical wave that converges on the sensor's axis; with L = √(z² + r²) its field there is

        U = ∫ z/(2πL²) (1/L - ik) dξ

    (first Rayleigh-Sommerfeld integral of exp(-ikL(r)); for a circle |1 - z/L - ikz ln(L/z)|). The peak is the largest
    sample: a window that misses it, or samples it coarsely, shows less.
    """
    import drjit as dr

    types = precision("float64")
    waves, pixels = result.tensor.shape[0], math.prod(result.tensor.shape[1:])
    highest = result.psf.reshape(waves, pixels).argmax(axis=1) + pixels * np.arange(waves)
    peak = dr.gather(types.Float, types.Float(_flat(result.tensor)), types.Index(highest.astype(np.uint32)))
    nodes = result.pupil.aperture.nodes(0.5, 10.0)
    radius, z = opaque(types, result.pupil.aperture_radius), opaque(types, result.sensor_distance)
    weight = types.Float(nodes.weight)
    slant = dr.sqrt(z * z + radius * radius * types.Float(nodes.x**2 + nodes.y**2))
    size = weight * z / (2 * np.pi * slant * slant)
    wavenumber = types.Float(2 * np.pi * result.pupil.medium_n / result.wavelengths)
    near, far = dr.sum(size / slant), dr.sum(size) * wavenumber
    ideal = (near * near + far * far) * radius * radius / result.pupil.aperture.area
    return to_user(types.Tensor(peak / ideal, (waves,)))


def encircled_energy(
    result: PSFResult, radii: np.ndarray | float, centre: tuple[float, float] | None = None
) -> np.ndarray:
    """Fraction of the pupil's power within `radii` [m] of `centre` (x, y) [m] on the sensor, (wavelength, radius).

    centre: None for the middle of the PSF's window. Carries no derivative.
    A sample on the circle counts by how far it reaches inside, which makes the error fall with dx².

    Raises:
        ValueError: a radius that is negative or leaves the window.
    """
    wanted = np.atleast_1d(reals("radii", radii))
    if wanted.ndim > 1:
        raise ValueError(f"radii has shape {wanted.shape}: must be a number or a row of them [m]")
    middle = result.centre if centre is None else point_2d("centre", centre)
    x, y = result.x[None, :] - middle[0], result.y[:, None] - middle[1]
    edge = min(-x[0, 0], x[0, -1], -y[0, 0], y[-1, 0])
    if edge < 0:
        raise ValueError(f"centre = {shown(centre)}: must lie within the PSF's window, around {shown(result.centre)}")
    if not ((wanted >= 0) & (wanted <= edge * (1 + 1e-9))).all():
        raise ValueError(f"radii = {shown(radii)}: must be in [0, {edge:g}] m, inside the PSF's window")
    distance = np.hypot(x, y)
    inside = np.clip((wanted[:, None, None] - distance) / result.dx + 0.5, 0, 1)
    return np.einsum("ryx,wyx->wr", inside, np.asarray(result.psf, dtype=np.float64)) * result.dx**2


def image_quality(
    result: PSFResult, nyquist: float, throughput: Scalar = 1.0, noise_sigma: float = 0.0
) -> np.ndarray | Array:
    """Throughput times the area of the MTF above the noise floor, up to the retina's Nyquist frequency, (wavelength,).

        IQ = T / f_N ∫_0^f_N max(MTF(f) - σ / T, 0) df,   in [0, 1]

    The contrast that noise drowns, σ / T, rises as the pupil closes. After Tiwary, Young et al. (2025).

    nyquist: f_N = 1 / (2 receptor pitch) [1/m]. throughput: T = a². noise_sigma: σ in units of the signal.

    Raises:
        ValueError: names argument, value and valid range.
    """
    import drjit as dr

    positive("nyquist", nyquist)
    in_range("throughput", throughput, 0, 1)
    in_range("noise_sigma", noise_sigma, 0, 1e6)
    waves = result.tensor.shape[0]
    if number(throughput) == 0:
        return np.zeros(waves)
    types = precision("float64")
    f = np.linspace(0, nyquist, 257)
    weight = np.full(f.size, 1 / (f.size - 1))
    weight[[0, -1]] /= 2
    light = opaque(types, throughput)
    contrast = types.Float(_flat(mtf(result).profile(f)))
    above = dr.maximum(contrast - noise_sigma / light, 0) * types.Float(np.tile(weight, waves))
    return to_user(types.Tensor(light * dr.block_reduce(dr.ReduceOp.Add, above, f.size), (waves,)))


def _flat(tensor: np.ndarray | Array) -> Array:
    """Row by row, Dr.Jit or NumPy."""
    import drjit as dr

    return padded_for_packets(tensor) if isinstance(tensor, np.ndarray) else dr.ravel(tensor)
