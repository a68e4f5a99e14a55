"""Development: from gene values to the animal that is simulated."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from evolve.config import EyeConfig, RunConfig
from evolve.genotype import DOE_SHAPE, Genotype

if TYPE_CHECKING:
    import optics
    import sim

__all__ = ["Phenotype", "develop"]


@dataclass(frozen=True)
class Phenotype:
    """An animal: its eyes and its brain.

    `relative_aperture`, `relief` and `refractive_index` are None together: optics off, a perfect lens.
    `relief` holds the 4 x 4 control points in [0, 1], row-major (y, x).
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

    def pupil(self, eye: EyeConfig) -> optics.Pupil | None:
        """Pupil of each of the eyes; None for the perfect lens."""
        import optics

        if self.relative_aperture is None or self.relief is None or self.refractive_index is None:
            return None
        control_points = eye.relief_height * np.reshape(self.relief, DOE_SHAPE)
        return optics.Pupil(
            aperture_radius=0.5 * self.relative_aperture * eye.sensor_width,
            height=optics.BSplineRelief(control_points),
            n=self.refractive_index,
        )

    def eyes(self, eye: EyeConfig) -> sim.Eyes:
        """The eyes as the simulation wants them."""
        import sim

        return sim.Eyes(
            n_eyes=self.n_eyes,
            resolution=self.resolution,
            fov_deg=self.fov_deg,
            placement_range_deg=self.placement_range_deg,
            optics=self.pupil(eye),
            sensor_width=eye.sensor_width,
            noise_sigma=eye.noise_sigma,
            bands=eye.bands,
        )

    def to_json(self) -> dict[str, Any]:
        """Plain values for a run file."""
        return {name: list(value) if isinstance(value, tuple) else value for name, value in vars(self).items()}

    @classmethod
    def from_json(cls, record: Mapping[str, Any]) -> Phenotype:
        """Inverse of `to_json`; raises TypeError where a field is missing or unknown."""
        values: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in record.items()}
        return cls(**values)


def develop(genome: NDArray[np.float64], config: RunConfig) -> Phenotype:
    """Phenotype of a genome under a run's config; every genome of the right length has one."""
    values = Genotype(config.genome).decode(genome)
    rows, columns = DOE_SHAPE
    relief = tuple(values[f"doe_{i}{j}"] for i in range(rows) for j in range(columns))
    seen_through = config.eye.optics
    return Phenotype(
        n_eyes=int(values["n_eyes"]),
        placement_range_deg=values["placement_range_deg"],
        fov_deg=values["fov_deg"],
        resolution=(int(values["resolution_height"]), int(values["resolution_width"])),
        relative_aperture=values["relative_aperture"] if seen_through else None,
        relief=relief if seen_through else None,
        refractive_index=values["refractive_index"] if seen_through else None,
        memory_frames=int(values["memory_frames"]),
        neurons=int(values["neurons"]),
    )
