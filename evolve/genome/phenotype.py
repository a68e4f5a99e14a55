"""Development of a genome into the simulated animal, its phenotype."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from math import ceil, isqrt
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from evolve.genome.anatomy import fitted, receptor_side, retina_width, sides, vertical_fov
from evolve.genome.eye_config import EyeConfig
from evolve.genome.genes import APERTURE_SHAPES, FACETS, INHERITED, LAMBDA_MAX, RHABDOM, TILT, TIME_CONSTANT, GeneConfig
from evolve.genome.genotype import Genotype
from evolve.genome.phenotype_on_record import checked_fields
from evolve.genome.relief_genes import representatives

if TYPE_CHECKING:
    import optics
    import sim

__all__ = ["FORMER_ENCODER", "Phenotype", "develop", "repaired"]

ANNULUS_INNER = 0.5  # inner radius of an annulus / its outer radius
SLIT_ASPECT = 4.0  # height of an upright slit divided by its width
# The number of neurons of the encoders (the first layers, one per eye) is proportional to that of the brain's layers,
# so that small brains have small encoders. A brain of 64 neurons has encoders of 16. Wider encoders take longer to
# compute, and animals with them did not learn faster (docs/measurements/learning.md).
NEURONS_PER_FEATURE = 4
OMITTED = (TIME_CONSTANT, *FACETS)  # fields that a record contains only if they have a value
FORMER_ENCODER = 16  # width of the encoders of animals whose record does not state it


class Settings(Protocol):
    """Settings of a run that affect the development of its animals."""

    @property
    def genome(self) -> Mapping[str, GeneConfig]: ...
    @property
    def eye(self) -> EyeConfig: ...


@dataclass(frozen=True)
class Phenotype:
    """The eyes and the brain of an animal.

    n_eyes: number of eyes
    placement_range_deg: arc over which the eyes are spread [deg]
    fov_deg: an eye's horizontal field of view [deg]
    resolution: numbers of receptors or ommatidia along the height and along the width of an eye
    relative_aperture: pupil diameter / retina width
    relief: N x N heights as fractions of `eye.relief_height`, in [0, 1], row-major (y, x). For N = 4 they are control
        points of a bicubic B-spline patch; for larger N the relief is divided into N x N cells, and a cubic spline
        interpolates the heights at their centres
    refractive_index: index of the relief's material at 588 nm
    memory_frames: number of frames that the brain sees
    neurons: number of neurons in each hidden layer of actor and critic
    layers: number of hidden layers of actor and critic
    aperture_shape: index of the pupil's shape in APERTURE_SHAPES (circle, annulus, slit ...)
    dispersion: 1 / Abbe number of the relief's material; 0: no dispersion
    lambda_max_nm: wavelengths at which the pigments of the receptor types absorb most [nm]; None: the setting
        `eye.receptors` of the run determines the receptors
    encoder: number of neurons in each layer of an eye's encoder, which processes the eye's signals first
    elevation_deg: elevation of the eyes [deg]; None in built-in tasks, in which eyes look along the floor
    rhabdom_diameter_um: diameter of the rhabdoms [µm]; None: receptors are rectangles that absorb all incident light
    vertical_fov_deg: an eye's vertical field of view [deg]; None: receptors are square, or the eyes are compound eyes
    time_constant_ms: time constant of the receptors [ms]; None: they have no memory
    facet_diameter_um, rhabdom_length_um: width of the facets and length of the rhabdoms of compound eyes [µm]
    f_number: focal length that a facet has in air, divided by the facet's width
    acute_zone: density of ommatidia in the middle of a compound eye / mean density

    If eyes have a perfect lens or are compound eyes, `relative_aperture`, `relief` and `refractive_index` are None. For
    camera eyes, `facet_diameter_um`, `f_number`, `rhabdom_length_um` and `acute_zone` are None.

    Methods raise a ValueError if a field is outside the range that `optics` or `sim` allows.
    """

    n_eyes: int
    placement_range_deg: float
    fov_deg: float
    resolution: tuple[int, int]
    relative_aperture: float | None
    relief: tuple[float, ...] | None
    refractive_index: float | None
    memory_frames: int
    neurons: int
    aperture_shape: int = 0
    dispersion: float = 0.0
    layers: int = 2
    lambda_max_nm: tuple[float, ...] | None = None
    encoder: int = FORMER_ENCODER
    elevation_deg: float | None = None
    rhabdom_diameter_um: float | None = None
    vertical_fov_deg: float | None = None
    time_constant_ms: float | None = None
    facet_diameter_um: float | None = None
    f_number: float | None = None
    rhabdom_length_um: float | None = None
    acute_zone: float | None = None

    def ommatidium(self, eye: EyeConfig) -> optics.Ommatidium | None:
        """Return an ommatidium of compound eyes: a facet lens with a curved front, and a rhabdom; None for camera eyes.

        eye: settings of the eyes of a run; the other methods have the same argument
        """
        import optics

        if self.facet_diameter_um is None or self.f_number is None or self.rhabdom_length_um is None:
            return None
        diameter, n = 1e-6 * self.facet_diameter_um, optics.FacetLens.n
        return optics.Ommatidium(
            optics.FacetLens(diameter, radius_front=(n - 1) * self.f_number * diameter),
            self._guide(1e-6 * (self.rhabdom_diameter_um or 0), eye, 1e-6 * self.rhabdom_length_um),
        )

    @staticmethod
    def _guide(diameter: float, eye: EyeConfig, length: float | None) -> optics.Waveguide:
        import optics

        return optics.Waveguide(
            diameter=diameter,
            n_core=eye.rhabdom_index,
            n_clad=eye.rhabdom_surround,
            length=length,
            absorption=eye.rhabdom_absorption,
        )

    def dynamics(self, eye: EyeConfig) -> optics.ReceptorDynamics | None:
        """Return the temporal properties of the receptors; None for receptors without memory."""
        import optics

        if self.time_constant_ms is None:
            return None
        return optics.ReceptorDynamics(
            time_constant_ms=self.time_constant_ms,
            order=eye.temporal_order,
            latency_ms=eye.latency_ms,
            adaptation=eye.adaptation,
            adaptation_ms=eye.adaptation_ms,
            event_threshold=eye.event_threshold or None,
            motion=eye.motion_detectors,
            motion_ms=eye.motion_ms,
            frames=eye.frames or None,
        )

    def waveguide(self, eye: EyeConfig) -> optics.Waveguide | None:
        """Return the waveguide that the rhabdom of each receptor of a camera eye forms; None if there is none.

        The waveguide is at most as wide as the receptor. Receptors that have no rhabdoms form no waveguides: they are
        rectangles that absorb all incident light. The result is also None for compound eyes; see `ommatidium`.
        """
        if self.rhabdom_diameter_um is None or self.facet_diameter_um is not None:
            return None
        side = receptor_side(self.resolution, self.fov_deg, self.vertical_fov_deg, eye)
        return self._guide(min(1e-6 * self.rhabdom_diameter_um, side), eye, eye.rhabdom_length or None)

    def pupil(self, eye: EyeConfig) -> optics.Pupil | None:
        """Return the pupil of the eyes; None for a perfect lens and for compound eyes."""
        import optics

        if self.relative_aperture is None or self.relief is None or self.refractive_index is None:
            return None
        side = isqrt(len(self.relief))
        heights = eye.relief_height * np.reshape(self.relief, (side, side))
        abbe_number = np.inf if self.dispersion == 0 else 1 / self.dispersion
        return optics.Pupil(
            aperture_radius=0.5 * self.relative_aperture * retina_width(self.resolution[1], eye),
            height=optics.BSplineRelief(heights) if side == 4 else heights,
            n=optics.RefractiveIndex.from_abbe(self.refractive_index, abbe_number),
            aperture=_aperture(APERTURE_SHAPES[self.aperture_shape]),
        )

    def eyes(self, eye: EyeConfig) -> sim.Eyes:
        """Return the eyes for the simulation.

        Raises:
            ValueError: an attribute of this phenotype is outside the range that `sim.Eyes` allows.
        """
        import optics
        import sim

        pupil = self.pupil(eye)
        return sim.Eyes(
            n_eyes=self.n_eyes,
            resolution=self.resolution,
            fov_deg=self.fov_deg,
            placement_range_deg=self.placement_range_deg,
            optics=pupil,
            sensor_width=retina_width(self.resolution[1], eye),
            noise_sigma=eye.noise_sigma,
            photon_budget=optics.PhotonBudget(eye.illuminance, eye.integration_time) if eye.illuminance else None,
            bands=eye.bands,
            receptors=eye.receptors if self.lambda_max_nm is None else self.lambda_max_nm,
            waveguide=self.waveguide(eye),
            pupil_turned=eye.pupil_turned and pupil is not None,
            vertical_fov_deg=self.vertical_fov_deg,
            dynamics=self.dynamics(eye),
            ommatidium=self.ommatidium(eye),
            acute_zone=self.acute_zone or 1.0,
        )

    def eye(self, eye: EyeConfig, medium: str = "air") -> optics.Eye | sim.CompoundEye:
        """Return one eye in the medium of a run's worlds: a camera eye or a compound eye.

        medium: "air", "clear_ocean", "coastal_water" or "fog"; a camera eye is immersed in it; compound eyes ignore it

        Raises:
            ValueError: the medium is unknown, or an attribute is outside the range that `sim.Eyes` allows.
        """
        import optics
        import sim

        found = self.eyes(eye).eye()
        return found if isinstance(found, sim.CompoundEye) else optics.immersed(found, optics.turbid_medium(medium))

    def to_json(self) -> dict[str, Any]:
        """Return the fields by name, as values that JSON can represent, for a run's record.

        `time_constant_ms` and the fields of compound eyes (`facet_diameter_um`, `f_number`, `rhabdom_length_um` and
        `acute_zone`) are omitted if they are None. Other fields are always present.
        """
        found = {name: list(value) if isinstance(value, tuple) else value for name, value in vars(self).items()}
        return {name: value for name, value in found.items() if value is not None or name not in OMITTED}

    @classmethod
    def from_json(cls, record: Mapping[str, Any]) -> Phenotype:
        """Return the phenotype from the return value of `to_json`.

        Raises:
            ValueError: the record is not a mapping, or a field is unknown or invalid; see `checked_fields`.
            TypeError: a field is missing.
        """
        return cls(**checked_fields(record, [f.name for f in fields(cls)]))


def develop(genome: NDArray[np.float64], config: Settings) -> Phenotype:
    """Return the phenotype that develops from a genome in a run with these settings.

    If eyes or receptors would overlap, a repair changes the gene values as little as possible to prevent this. Every
    genome with the right number of finite coordinates therefore has a phenotype.

    genome: coordinate of each gene that the search varies, (gene,); coordinates are clipped to [0, 1]
    config: settings of the run, such as a `RunConfig`

    Raises:
        ValueError: the genome does not contain one finite number for each of these genes, or is in half precision.
    """
    values = fitted(Genotype(config.genome).decode(genome), config.genome, config.eye)
    seen_through = config.eye.optics and not config.eye.compound
    heights = representatives(config.eye.relief_points, config.eye.relief_symmetric) if seen_through else ()
    relief = tuple(values[name] for name in heights)
    peaks = tuple(values[name] for name in LAMBDA_MAX)[: int(values["receptor_types"])]
    return Phenotype(
        n_eyes=int(values["n_eyes"]),
        placement_range_deg=values["placement_range_deg"],
        fov_deg=values["fov_deg"],
        resolution=sides(values),
        relative_aperture=values["relative_aperture"] if seen_through else None,
        relief=relief if seen_through else None,
        refractive_index=values["refractive_index"] if seen_through else None,
        memory_frames=int(values["memory_frames"]),
        neurons=int(values["neurons"]),
        aperture_shape=int(values["aperture_shape"]) if seen_through else 0,
        dispersion=values["dispersion"] if seen_through else 0.0,
        layers=int(values["layers"]),
        lambda_max_nm=peaks if config.eye.receptors == INHERITED else None,
        encoder=ceil(values["neurons"] / NEURONS_PER_FEATURE),
        elevation_deg=values.get(TILT),
        rhabdom_diameter_um=values.get(RHABDOM),
        vertical_fov_deg=vertical_fov(values, config.eye),
        time_constant_ms=values.get(TIME_CONSTANT),
        **{name: values.get(name) for name in FACETS},
    )


def repaired(genome: NDArray[np.float64], config: Settings) -> tuple[str, ...]:
    """Return the names of the genes that `develop` changes because eyes or receptors would overlap; () for none.

    Raises:
        ValueError: the genome is invalid; see `develop`.
    """
    values = Genotype(config.genome).decode(genome)
    fits = fitted(values, config.genome, config.eye)
    return tuple(name for name, value in values.items() if fits[name] != value)


def _aperture(shape: str) -> Any:
    """Return the aperture with this name, such as "circle", scaled to the radius 1."""
    import optics

    if shape == "circle":
        return optics.Circle()
    if shape == "annulus":
        return optics.Annulus(ANNULUS_INNER)
    if shape == "slit":
        width = 2 / np.hypot(1, SLIT_ASPECT)
        return optics.Slit(width, SLIT_ASPECT * width)
    return optics.Polygon.regular(3 + APERTURE_SHAPES.index(shape) - APERTURE_SHAPES.index("triangle"), 90.0)
