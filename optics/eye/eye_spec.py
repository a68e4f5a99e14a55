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
    tangents,
)
from optics.eye.guided_field import check_guide
from optics.eye.photoreceptor import throughput
from optics.eye.polarization import check_rays, microvilli_of
from optics.eye.receptor_density import density_of
from optics.eye.receptor_lattice import ReceptorLattice, even_lattice, receptor_lattice
from optics.numerics.arguments import flag, in_range, of_kind, positive, shape_2d
from optics.numerics.autodiff import Scalar, is_differentiable, number
from optics.ommatidia.waveguide import Waveguide
from optics.spectra.bands import SpectralBands
from optics.spectra.photon_budget import PhotonBudget
from optics.spectra.receptor_dynamics import ReceptorDynamics
from optics.spectra.receptors import receptors_of

__all__ = ["EyeSpec"]


@dataclass(frozen=True)
class EyeSpec:
    """Parameters of an eye, and quantities that follow from them, such as its focal length and its throughput.

    The quantities do not require a PSF. `optics.Eye` documents the fields and adds PSFs, kernels and signals.

    Raises:
        ValueError: an argument is outside its valid range, which the message states.
        AccuracyError: the rays behind the pupil are so steep that signals of microvilli do not meet the tolerance. An
            `Eye` with bands="auto" also computes PSFs, and raises an AccuracyError if `optics.psf` would raise one.
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
    density: Any = None
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
        if not isinstance(self.density, ReceptorLattice):
            object.__setattr__(self, "density", density_of(self.density))
        self._check_density()
        auto = str(self.bands) == "auto"
        spectral = self.chosen_bands() if auto else SpectralBands.uniform(self.bands, self.receptors)
        object.__setattr__(self, "spectral_bands", spectral)
        object.__setattr__(self, "bands", len(spectral.wavelengths))

    def _check_density(self) -> None:
        if self.density is None:
            return
        if is_differentiable(self.fov_deg):
            raise ValueError(
                "density is given and fov_deg is a Dr.Jit array: must be None, or fov_deg a number, since receptors "
                "move on the retina if the focal length changes"
            )
        if self.waveguide is not None:
            raise ValueError(
                "density and waveguide are given: one of them must be None, since the field of a waveguide depends on "
                "its diameter, which varies with the density; sim.CompoundEye has an Ommatidium for each direction"
            )
        if (lattice := self.lattice) is not None and lattice.areas.shape != self.resolution:
            raise ValueError(f"density is a lattice of {lattice.areas.shape} receptors: must be of {self.resolution}")

    @property
    def sensor_distance(self) -> Scalar:
        """Focal length f [m]: the distance x on the retina from the axis corresponds to an angle with the tangent x/f.

        It equals the distance from pupil to retina if the same medium is in front of and behind the pupil.
        """
        return focal_length(self.sensor_width, self.fov_deg)

    @property
    def retina_distance(self) -> Scalar:
        """Distance [m] from pupil to retina: `sensor_distance` n/n₀, with the indices n behind and n₀ before the pupil.

        The indices are those at 550 nm.
        """
        return behind_pupil(self.pupil, self.sensor_distance)

    @property
    def widest_pupil(self) -> float:
        """Diameter [m] of the widest pupil, whose throughput is 1 by definition: `full_aperture` or `sensor_width`."""
        return self.sensor_width if self.full_aperture is None else self.full_aperture

    @property
    def receptor_pitch(self) -> float:
        """Distance [m] between the centres of horizontally neighbouring receptors.

        If receptors have a `density`, it is the average distance.
        """
        return self.sensor_width / self.resolution[1]

    @property
    def receptor_size(self) -> tuple[float, float]:
        """Height and width [m] of a receptor, or their averages over the eye if receptors have a `density`.

        They are equal unless `vertical_fov_deg` is given.
        """
        return receptor_size(self.resolution, self.sensor_width, self.fov_deg, self.vertical_fov_deg)

    @property
    def lattice(self) -> ReceptorLattice | None:
        """Rectangle that each receptor occupies, in units of `receptor_size`; None if `density` is None."""
        if self.density is None or isinstance(self.density, ReceptorLattice):
            return self.density
        (width, height), middle = self._on_tangent_plane
        halves = self.resolution[0] * height / 2, self.resolution[1] * width / 2
        return receptor_lattice(self.density, self.resolution, halves, middle)

    @property
    def receptor_angles_deg(self) -> np.ndarray:
        """Angles [degrees] that each receptor subtends vertically and horizontally, (2, h, w).

        For one of these angles, `optics.sampling_acuity(angle, "square")` is the finest grating [cycles/degree] that
        neighbouring receptors with this angle resolve.
        """
        return self._every_receptor.angles_deg(*self._on_tangent_plane)

    @property
    def receptor_directions_deg(self) -> np.ndarray:
        """Angles (right, up) [degrees] of each receptor's middle from the eye's axis, (2, h, w)."""
        return self._every_receptor.directions_deg(*self._on_tangent_plane)

    @property
    def _every_receptor(self) -> ReceptorLattice:
        return even_lattice(self.resolution) if self.lattice is None else self.lattice

    @property
    def _on_tangent_plane(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Size (width, height) of an average receptor, and position (right, down) of the field's middle.

        Both are measured on the plane at distance 1 in front of the eye, perpendicular to its axis. A position on this
        plane consists of the tangents of the angles from the axis.
        """
        (height, width), distance = self.receptor_size, number(self.sensor_distance)
        return (width / distance, height / distance), tangents(self.eccentricity_deg)

    @property
    def smallest_receptor(self) -> tuple[float, float]:
        """Smallest height and smallest width [m] of a receptor."""
        height, width = self.receptor_size
        if self.lattice is None:
            return height, width
        low, narrow = self.lattice.smallest
        return height * low, width * narrow

    @property
    def smallest_share(self) -> float:
        """Smallest ratio of a receptor's height to the average height, or of its width to the average width."""
        return 1.0 if self.lattice is None else min(self.lattice.smallest)

    @property
    def fovy_deg(self) -> float:
        """Vertical field of view [degrees].

        It is `vertical_fov_deg` or, if that is None, the angle that results if receptors are square.
        """
        height, _ = self.receptor_size
        return math.degrees(2 * math.atan(self.resolution[0] * height / (2 * number(self.sensor_distance))))

    @property
    def relative_aperture(self) -> Scalar:
        """Diameter of the pupil, divided by `widest_pupil`; 1 for the perfect lens.

        It is 2 `pupil.aperture_radius` divided by `full_aperture`, or by `sensor_width` if `full_aperture` is None.
        """
        return 1.0 if self.pupil is None else 2 * self.pupil.aperture_radius / self.widest_pupil

    @property
    def throughput(self) -> Scalar:
        """Squared `relative_aperture`, times the open fraction of the pupil's disk, times the mask's transmission."""
        return self.aperture_throughput * (1.0 if self.pupil is None else self.pupil.transmission)

    @property
    def aperture_throughput(self) -> Scalar:
        """Throughput of the pupil without its mask.

        A signal is this throughput times the radiance weighted by a kernel. The kernel contains the mask's
        transmission.
        """
        return throughput(self.relative_aperture, 1.0 if self.pupil is None else self.pupil.aperture.area / math.pi)

    @property
    def parallax(self) -> float:
        """Shift of a near point relative to a far one between views from opposite edges of the pupil.

        The shift is in units of the shorter side of an average receptor. It is divided by the difference of the two
        points' 1/distance [1/m]. For the perfect lens, it is 0.
        """
        if self.pupil is None:
            return 0.0
        return 2 * number(self.pupil.aperture_radius) * number(self.sensor_distance) / min(self.receptor_size)

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
        """Number of photons that a receptor of each type absorbs for a signal of 1; None without a photon budget.

        If receptors have a `density`, the number is that for a receptor of average area. The shape is (type,).
        """
        if self.photon_budget is None:
            return None
        light = etendue(self.widest_pupil, math.prod(self.receptor_size), number(self.sensor_distance))
        return self.photon_budget.photons(self.spectral_bands, light)

    @property
    def receptor_photons(self) -> np.ndarray | None:
        """Number of photons that each receptor absorbs for a signal of 1; None without a photon budget.

        The shape is (channel, h, w), or (channel, 1, 1) if all receptors are alike. Large receptors absorb more
        photons.
        """
        if self.photons is None:
            return None
        each = self.photons[:, None, None] if self.mosaic is None else self.photons[self.mosaic][None]
        return each if self.lattice is None else each * self.lattice.areas

    def in_bands(self, radiance: Any) -> np.ndarray:
        """Convert a spectral radiance to one value for each band of this eye, (band,), as `see` requires.

        Every receptor type then has the correct quantum catch, if there are at least as many bands as types. The value
        of a band may be negative; see `SpectralBands.band_values`.

        radiance: a Spectrum, or a function of wavelengths [m].

        Raises:
            ValueError: the radiance is something else, or is not finite.
        """
        return self.spectral_bands.band_values(radiance, self.receptors)

    def chosen_bands(self) -> SpectralBands:
        """Raise a ValueError: only the subclass `Eye` can choose the spectral bands for `bands="auto"`."""
        raise ValueError("bands = 'auto': must be a number of bands, except in an Eye")
