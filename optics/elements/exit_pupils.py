"""Exit pupils of a lens for several fields and wavelengths, read from another program."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from optics.elements.converging_wave import UM
from optics.elements.exit_pupil import ExitPupil, read_exit_pupil
from optics.numerics.arguments import positive, shown, whole
from optics.numerics.read_only import ReadOnlyArrays

__all__ = ["ExitPupils", "read_exit_pupils"]

FLAT = 1e-9  # choice [m]: largest distance of images from a common plane


@dataclass(frozen=True, eq=False)
class ExitPupils(ReadOnlyArrays):
    """Exit pupils of a lens for several fields and wavelengths. All images of the lens lie on one plane.

    fields: points of the field, in the order and units of the program that computed the pupils.
    wavelengths: vacuum wavelengths [m], ascending.
    pupils: one row per field, with one exit pupil per wavelength.
    """

    fields: tuple[Any, ...]
    wavelengths: np.ndarray
    pupils: tuple[tuple[ExitPupil, ...], ...]

    def __repr__(self) -> str:
        fields, waves = len(self.fields), len(self.wavelengths)
        return f"<ExitPupils of {fields} field{'s' * (fields > 1)} at {waves} wavelength{'s' * (waves > 1)}>"

    @property
    def positions(self) -> np.ndarray:
        """Positions (x, y) [m] of the images of the field points on the image plane, array (field, wavelength, 2)."""
        return np.array([[pupil.position for pupil in row] for row in self.pupils])

    @property
    def lateral_colour(self) -> np.ndarray:
        """Displacements (x, y) [m] of the images of the field points from their positions at the middle wavelength.

        Array (field, wavelength, 2).
        """
        return self.positions - self.positions[:, [len(self.wavelengths) // 2]]

    def at(self, field: int, shift: float = 0.0) -> tuple[ExitPupil, ...]:
        """Return the exit pupils of a field at all wavelengths, with one origin on the image plane.

        Sums over the PSFs of these pupils include lateral colour. The origin is the image of the field point at the
        middle wavelength. On a moved plane, it is the point that the ray through the pupil's centre hits at this
        wavelength.

        field: number of the field, counted from 0.
        shift: distance [m] by which the image plane is moved, positive in the direction of the light.

        Raises:
            ValueError: there is no such field, or the shift is longer than half the distance to a pupil.
        """
        row = self.pupils[whole("field", field, 0, len(self.fields) - 1)]
        origin = row[len(row) // 2].moved(shift).position
        return tuple(pupil.moved(shift, origin) for pupil in row)


def read_exit_pupils(
    system: Any, medium_n: float = 1.0, order: int = 8, image_normal: tuple[float, float, float] | None = None
) -> ExitPupils:
    """Convert a lens from another program to exit pupils for all its fields and wavelengths.

    system: optiland's Wavefront, or a mapping {(field, wavelength [µm]): object}. `read_exit_pupil` describes the
        objects. They must contain positions of rays.
    medium_n, order, image_normal: see `read_exit_pupil`.

    Raises:
        ValueError: the mapping is incomplete, the tilt of the wavefronts was removed (optiland's `remove_tilt`), an
            object does not contain the position of its image, or the images do not lie on one plane with the normal
            `image_normal`. See also `read_exit_pupil`.
    """
    held = getattr(system, "data", system)
    if not isinstance(held, Mapping) or not held or not all(isinstance(k, tuple) and len(k) == 2 for k in held):
        raise ValueError(
            f"system = {shown(system)}: must be optiland's Wavefront, or {{(field, wavelength [µm]): WavefrontData}}"
        )
    if getattr(system, "remove_tilt", False):
        raise ValueError("remove_tilt = True: the positions of the images are lost; compute the wavefront without it")
    fields, microns = tuple(dict.fromkeys(k[0] for k in held)), sorted({k[1] for k in held})
    for key in ((each, um) for each in fields for um in microns if (each, um) not in held):
        raise ValueError(
            f"system lacks the field {shown(key[0])} at {key[1]:g} µm: must have every field at each wavelength"
        )
    wavelengths = np.array([positive("wavelength", um, "µm") * UM for um in microns])
    rows = tuple(
        tuple(
            read_exit_pupil(held[each, um], at, medium_n, order=order, image_normal=image_normal)
            for um, at in zip(microns, wavelengths, strict=True)
        )
        for each in fields
    )
    heights = [pupil.image_height for row in rows for pupil in row]
    if max(heights) - min(heights) > FLAT:
        raise ValueError(
            f"the images lie {max(heights) - min(heights):.3g} m apart along image_normal: must lie on one plane; use "
            "reference spheres around the image of the chief ray, and specify the normal of a tilted image plane"
        )
    return ExitPupils(fields, wavelengths, rows)
