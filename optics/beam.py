"""Light of one wavelength from a source through a pupil."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from optics.aperture import SoftDisk
from optics.field import Field
from optics.grid import Grid
from optics.precision import Precision, opaque
from optics.pupil import Pupil
from optics.source import PointSource

__all__ = ["Beam"]


@dataclass(frozen=True)
class Beam:
    """Light of one vacuum wavelength [m] from a source through a pupil."""

    pupil: Pupil
    source: PointSource
    wavelength: float

    def waves(self, x: Any, y: Any, types: Precision) -> Any:
        """Optical path in wavelengths at the pupil's points, float64."""
        return self.pupil.path(x, y, self.wavelength, self.source, types) * opaque(types, 1 / self.wavelength)

    def behind(self, disk: SoftDisk, grid: Grid, types: Precision) -> Field:
        """Field just behind the pupil, aperture softened."""
        x, y = grid.coordinates(types)
        return Field.from_waves(disk.transmittance(x, y, types), self.waves(x, y, types), grid, types)
