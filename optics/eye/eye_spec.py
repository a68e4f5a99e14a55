"""Parameters of an eye, from which kernels and signals are computed."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from optics.elements.pupil import Pupil
from optics.eye.geometry import (
    behind_pupil,
    check_pupil,
    check_vertical,
    direction,
    etendue,
    focal_length,
    receptor_size,
)
from optics.eye.guided_field import check_guide
from optics.eye.photoreceptor import throughput
from optics.eye.polarization import check_rays, microvilli_of
from optics.numerics.arguments import flag, in_range, of_kind, positive, shape_2d
from optics.numerics.autodiff import Scalar, number
from optics.ommatidia.waveguide import Waveguide
from optics.spectra.bands import SpectralBands
from optics.spectra.photon_budget import PhotonBudget
from optics.spectra.receptor_dynamics import ReceptorDynamics
from optics.spectra.receptors import receptors_of

__all__ = ["EyeSpec"]


@dataclass(frozen=True)
class EyeSpec:
    """Parameters of an eye, with the lengths and throughputs that follow from them without a PSF.

    `optics.Eye` documents the fields and adds PSFs, kernels and signals.

    Raises:
        ValueError: an argument is outside its valid range, which the message states.
        AccuracyError: microvilli behind a pupil whose rays are too steep for the tolerance.
    """

    pupil: Pupil | None = None
    resolution: tuple[int, int] = (15, 15)
    fov_deg: Scalar = 45.0
    sensor_width: float = 200e-6
    bands: Any = 4
    noise_sigma: float = 0.01
    tolerance: float = 1e-2
    dtype: str = "float32"
    photon_budget: PhotonBudget | None = None
    receptors: Any = "rgb"
    full_aperture: float | None = None
    eccentricity_deg: tuple[float, float] = (0.0, 0.0)
    waveguide: Waveguide | None = None
    microvilli: Any = None
    pupil_turned: bool = False
    vertical_fov_deg: float | None = None
    most_seconds: float = 3.0
    dynamics: ReceptorDynamics | None = None
    spectral_bands: SpectralBands = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "resolution", shape_2d("resolution", self.resolution))
        in_range("fov_deg", self.fov_deg, 1e-3, 170, carried=True)
        positive("sensor_width", self.sensor_width)
        check_vertical(self.vertical_fov_deg, self.fov_deg)
        object.__setattr__(self, "eccentricity_deg", direction("eccentricity_deg", self.eccentricity_deg))
        in_range("noise_sigma", self.noise_sigma, 0, 1e6)
        in_range("tolerance", self.tolerance, 1e-6, 0.5)
        if self.dtype not in ("float32", "float64"):
            raise ValueError(f"dtype = {self.dtype!r}: must be 'float32' or 'float64'")
        positive("most_seconds", self.most_seconds, "s")
        check_pupil(self.pupil, self.sensor_width, self.full_aperture)
        if flag("pupil_turned", self.pupil_turned) and self.pupil is None:
            raise ValueError("pupil_turned = True and pupil = None: must be False, or a Pupil that can be turned")
        check_guide(self.waveguide, self.pupil, self.receptor_size)
        object.__setattr__(self, "microvilli", microvilli_of(self.microvilli))
        if self.microvilli is not None:
            check_rays(self.pupil, number(self.retina_distance), self.tolerance)
        if self.photon_budget is not None:
            of_kind("photon_budget", self.photon_budget, PhotonBudget, "PhotonBudget(), or None")
        if self.dynamics is not None:
            of_kind("dynamics", self.dynamics, ReceptorDynamics, "ReceptorDynamics(time_constant_ms=20)")
        object.__setattr__(self, "receptors", receptors_of(self.receptors))
        auto = str(self.bands) == "auto"
        spectral = self.chosen_bands() if auto else SpectralBands.uniform(self.bands, self.receptors)
        object.__setattr__(self, "spectral_bands", spectral)
        object.__setattr__(self, "bands", len(spectral.wavelengths))

    @property
    def sensor_distance(self) -> Scalar:
        """Focal length f [m] that relates a distance x on the retina to the angle x/f.

        It equals the distance from pupil to retina if the same medium is in front of and behind the pupil.
        """
        return focal_length(self.sensor_width, self.fov_deg)

    @property
    def retina_distance(self) -> Scalar:
        """Distance [m] from pupil to retina: f n/n₀ at 550 nm, with the indices n behind the pupil and n₀ in front."""
        return behind_pupil(self.pupil, self.sensor_distance)

    @property
    def widest_pupil(self) -> float:
        """Diameter [m] of a pupil with a throughput of 1."""
        return self.sensor_width if self.full_aperture is None else self.full_aperture

    @property
    def receptor_pitch(self) -> float:
        """Distance [m] between the centres of horizontally neighbouring receptors."""
        return self.sensor_width / self.resolution[1]

    @property
    def receptor_size(self) -> tuple[float, float]:
        """Height and width [m] of a receptor. They are equal unless `vertical_fov_deg` is given."""
        return receptor_size(self.resolution, self.sensor_width, self.fov_deg, self.vertical_fov_deg)

    @property
    def fovy_deg(self) -> float:
        """Vertical field of view [degrees]: `vertical_fov_deg`, or that of square receptors."""
        height, _ = self.receptor_size
        return math.degrees(2 * math.atan(self.resolution[0] * height / (2 * number(self.sensor_distance))))

    @property
    def relative_aperture(self) -> Scalar:
        """Relative aperture a = 2 R / L, or 2 R / `full_aperture`; 1 for the perfect lens."""
        return 1.0 if self.pupil is None else 2 * self.pupil.aperture_radius / self.widest_pupil

    @property
    def throughput(self) -> Scalar:
        """Throughput: a², times the open fraction of the aperture's disk, times the mask's transmission."""
        return self.aperture_throughput * (1.0 if self.pupil is None else self.pupil.transmission)

    @property
    def aperture_throughput(self) -> Scalar:
        """Throughput without the mask, by which signals from kernels are multiplied.

        Kernels contain the mask's transmission.
        """
        return throughput(self.relative_aperture, 1.0 if self.pupil is None else self.pupil.aperture.area / math.pi)

    @property
    def channels(self) -> int:
        """Number of signals at each position of the retina: one per receptor type, or one in a mosaic."""
        return self.receptors.channels

    @property
    def mosaic(self) -> np.ndarray | None:
        """Type of every receptor, (h, w) int; None if every receptor has all types."""
        return self.receptors.layout(self.resolution)

    @property
    def photons(self) -> np.ndarray | None:
        """Absorbed photons for a signal of 1, per receptor type (type,); None without a photon budget."""
        if self.photon_budget is None:
            return None
        light = etendue(self.widest_pupil, math.prod(self.receptor_size), number(self.sensor_distance))
        return self.photon_budget.photons(self.spectral_bands, light)

    def chosen_bands(self) -> SpectralBands:
        """Return the spectral bands for `bands="auto"`. The choice needs kernels, so only `Eye` implements it."""
        raise ValueError("bands = 'auto': must be a number of bands, except in an Eye")
