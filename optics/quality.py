"""What a PSF is worth: contrast over spatial frequency, peak, concentration, and one number for an eye."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from optics.arguments import in_range, positive
from optics.point_spread import PSFResult

__all__ = ["MTF", "encircled_energy", "image_quality", "mtf", "strehl_ratio"]


@dataclass(frozen=True, eq=False)
class MTF:
    """Modulation transfer function on a grid of spatial frequencies, zero frequency at n//2.

    mtf: (wavelength, fy, fx), 1 at zero frequency; fx, fy: cycles per metre on the sensor.
    cutoff: (wavelength,) frequency [1/m] beyond which a pupil of this size passes nothing, 2 sin θ / λ.
    """

    mtf: np.ndarray
    fx: np.ndarray
    fy: np.ndarray
    cutoff: np.ndarray

    def profile(self, frequencies: np.ndarray) -> np.ndarray:
        """Mean over all orientations at radial `frequencies` [1/m], (wavelength, frequency); 0 beyond the grid.

        Interpolated linearly between the grid's frequencies, which are 1 / (window width) apart.
        """
        from scipy.interpolate import RegularGridInterpolator

        f = np.atleast_1d(np.asarray(frequencies, dtype=np.float64))
        angle = 2 * np.pi * (np.arange(64) + 0.5) / 64
        points = np.stack([np.outer(f, np.sin(angle)), np.outer(f, np.cos(angle))], axis=-1)
        planes = [
            RegularGridInterpolator((self.fy, self.fx), plane, bounds_error=False, fill_value=0.0)(points)
            for plane in self.mtf
        ]
        return np.mean(planes, axis=-1)


def mtf(result: PSFResult) -> MTF:
    """|F{PSF}| over its value at zero frequency (Goodman, Introduction to Fourier Optics, §6.3.2).

    Light that falls outside the PSF's window is missing from it: a window that holds little of the power shows too
    much contrast at low frequencies (see `PSFResult.power`).
    """
    otf = np.fft.fft2(np.asarray(result.psf, dtype=np.float64))
    contrast = np.abs(otf) / np.abs(otf[:, :1, :1])
    height, width = result.psf.shape[1:]
    fy, fx = (np.fft.fftshift(np.fft.fftfreq(n, result.dx)) for n in (height, width))
    radius, distance = result.pupil.radius, result.sensor_distance
    cutoff = 2 * radius / np.hypot(radius, distance) * result.pupil.medium_n / result.wavelengths
    return MTF(np.fft.fftshift(contrast, axes=(1, 2)), fx, fy, cutoff)


def strehl_ratio(result: PSFResult) -> np.ndarray:
    """Peak of the PSF over the peak that the same aperture makes without aberration, (wavelength,).

    Unaberrated is the spherical wave that converges on the sensor's axis. With L = √(z² + R²) its field there is

        |U| = |1 - z/L - ikz ln(L/z)|

    (first Rayleigh-Sommerfeld integral of exp(-ikL(r)), in closed form). The peak is the largest sample: a window
    that misses it, or samples it coarsely, shows less.
    """
    radius, z = result.pupil.radius, result.sensor_distance
    slant = np.hypot(z, radius)
    wavenumber = 2 * np.pi * result.pupil.medium_n / result.wavelengths
    peak = ((1 - z / slant) ** 2 + (wavenumber * z * np.log(slant / z)) ** 2) / result.pupil.area
    return result.psf.max(axis=(1, 2)) / peak


def encircled_energy(
    result: PSFResult, radii: np.ndarray | float, centre: tuple[float, float] = (0.0, 0.0)
) -> np.ndarray:
    """Fraction of the pupil's power within `radii` [m] of `centre` (x, y) [m] on the sensor, (wavelength, radius).

    A sample on the circle counts by how far it reaches inside, which makes the error fall with dx².

    Raises:
        ValueError: a radius that is negative or leaves the window.
    """
    wanted = np.atleast_1d(np.asarray(radii, dtype=np.float64))
    x, y = result.x[None, :] - centre[0], result.y[:, None] - centre[1]
    edge = min(-x[0, 0], x[0, -1], -y[0, 0], y[-1, 0])
    if not ((wanted >= 0) & (wanted <= edge)).all():
        raise ValueError(f"radii = {radii!r}: must be in [0, {edge:g}] m, inside the PSF's window")
    distance = np.hypot(x, y)
    inside = np.clip((wanted[:, None, None] - distance) / result.dx + 0.5, 0, 1)
    return np.einsum("ryx,wyx->wr", inside, np.asarray(result.psf, dtype=np.float64)) * result.dx**2


def image_quality(result: PSFResult, nyquist: float, throughput: float = 1.0, noise_sigma: float = 0.0) -> np.ndarray:
    """Throughput times the area of the MTF above the noise floor, up to the retina's Nyquist frequency, (wavelength,).

        IQ = T / f_N ∫_0^f_N max(MTF(f) - σ / T, 0) df,   in [0, 1]

    The contrast that noise drowns, σ / T, rises as the pupil closes. After Tiwary, Young et al. (2025).

    nyquist: f_N = 1 / (2 receptor pitch) [1/m]. throughput: T = a². noise_sigma: σ in units of the signal.

    Raises:
        ValueError: names argument, value and valid range.
    """
    positive("nyquist", nyquist)
    in_range("throughput", throughput, 0, 1)
    in_range("noise_sigma", noise_sigma, 0, 1e6)
    if throughput == 0:
        return np.zeros(len(result.wavelengths))
    f = np.linspace(0, nyquist, 257)
    above = np.maximum(mtf(result).profile(f) - noise_sigma / throughput, 0)
    return throughput * np.trapezoid(above, f, axis=1) / nyquist
