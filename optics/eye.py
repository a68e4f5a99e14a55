"""An eye: a pupil in front of a flat retina of photoreceptors."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from optics.arguments import in_range, positive, radiance_cube, shape_2d
from optics.imaging import blur, receptor_average
from optics.photoreceptor import gaussian_noise, quantum_catch, throughput
from optics.point_spread import PSFResult
from optics.pupil import Pupil
from optics.receptive_field import Retina, perfect_psf, retinal_psf, visual_kernel
from optics.spectrum import SpectralBands

__all__ = ["Eye"]


@dataclass(frozen=True)
class Eye:
    """Pupil, retina and noise. Arrays are in visual-field orientation, row 0 at the top, column 0 on the left.

    pupil: None is the perfect lens: no blur, full throughput.
    resolution: receptors (height, width); square, pitch = sensor_width / width.
    fov_deg: horizontal field of view, in [1, 170]; the retina lies at f = L / (2 tan(fov/2)).
    sensor_width: L [m]. bands: spectral bands. noise_sigma: standard deviation of a receptor's noise, in signal units.
    tolerance: relative L2 error asked of the PSF.

    Raises:
        ValueError: names argument, value and valid range.
    """

    pupil: Pupil | None = None
    resolution: tuple[int, int] = (15, 15)
    fov_deg: float = 45.0
    sensor_width: float = 200e-6
    bands: int = 4
    noise_sigma: float = 0.01
    tolerance: float = 1e-2
    spectral_bands: SpectralBands = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "resolution", shape_2d("resolution", self.resolution))
        in_range("fov_deg", self.fov_deg, 1e-3, 170)
        positive("sensor_width", self.sensor_width)
        in_range("noise_sigma", self.noise_sigma, 0, 1e6)
        in_range("tolerance", self.tolerance, 1e-6, 0.5)
        object.__setattr__(self, "spectral_bands", SpectralBands.uniform(self.bands))
        if self.pupil is not None and self.relative_aperture > 1 + 1e-9:
            raise ValueError(
                f"pupil.aperture_radius = {self.pupil.radius:g}: must be at most sensor_width / 2 = "
                f"{self.sensor_width / 2:g} m"
            )

    @property
    def sensor_distance(self) -> float:
        """f [m], from pupil to retina."""
        return self.sensor_width / (2 * math.tan(math.radians(self.fov_deg) / 2))

    @property
    def receptor_pitch(self) -> float:
        """[m]"""
        return self.sensor_width / self.resolution[1]

    @property
    def relative_aperture(self) -> float:
        """a = 2 R / L; 1 for the perfect lens."""
        return 1.0 if self.pupil is None else 2 * self.pupil.radius / self.sensor_width

    @property
    def throughput(self) -> float:
        """a²"""
        return throughput(min(self.relative_aperture, 1.0))

    def psf(self, z: float = math.inf) -> PSFResult:
        """PSF on the retina (sensor orientation) of a point on the axis at distance z [m], over the kernel's window.

        The perfect lens has one sample that holds all power.

        Raises:
            AccuracyError: see `optics.psf`.
        """
        positive("z", z, infinite=True)
        if self.pupil is None:
            return perfect_psf(self._retina(1), self.sensor_width / 2)
        return retinal_psf(self.pupil, self._retina(4), z)

    def kernel(self, samples_per_receptor: int, z: float = math.inf) -> np.ndarray:
        """Receptive kernel (band, ky, kx) float32: the PSF integrated over square cells of pitch /
        samples_per_receptor, in visual-field orientation (the PSF turned by 180°), ky and kx odd.

        z: the scene's distance [m]. The sum is the fraction of the pupil's power that lands inside; the window is as
        wide as it must be to lose less than the tolerance (limits: see `receptive_field`). The perfect
        lens has the 1 x 1 kernel 1. Signals are a² Σ_b weights[c, b] (kernel_b ⊗ radiance_b).

        Raises:
            AccuracyError: see `optics.psf`.
        """
        positive("z", z, infinite=True)
        retina = self._retina(_whole(samples_per_receptor))
        if self.pupil is None:
            return np.ones((self.bands, 1, 1), dtype=np.float32)
        return visual_kernel(self.pupil, retina, z)

    def _retina(self, samples_per_receptor: int) -> Retina:
        cell = self.receptor_pitch / samples_per_receptor
        return Retina(self.sensor_distance, self.spectral_bands.wavelengths, cell, self.tolerance)

    def see(
        self,
        radiance: np.ndarray,
        samples_per_receptor: int,
        rng: np.random.Generator | None = None,
        z: float = math.inf,
    ) -> np.ndarray:
        """Signals (channel, h, w) float32 of a scene in the tangent plane, by convolution (the reference).

        radiance: (band, Y, X), cells of pitch / samples_per_receptor, centred on the axis, at least h s x w s cells
            and larger by even numbers; dark outside.
        rng: None for signals without noise.

        Raises:
            ValueError: radiance of another shape, or not finite.
        """
        s = _whole(samples_per_receptor)
        h, w = self.resolution
        scene = radiance_cube(radiance, self.bands, (h * s, w * s))
        irradiance = receptor_average(blur(scene, self.kernel(s, z)), self.resolution, s)
        signal = self.throughput * quantum_catch(irradiance, self.spectral_bands.weights)
        if rng is not None:
            signal = gaussian_noise(signal, self.noise_sigma, rng)
        return signal.astype(np.float32)


def _whole(samples_per_receptor: int) -> int:
    if int(samples_per_receptor) != samples_per_receptor or not 1 <= samples_per_receptor <= 64:
        raise ValueError(f"samples_per_receptor = {samples_per_receptor!r}: must be a whole number in [1, 64]")
    return int(samples_per_receptor)
