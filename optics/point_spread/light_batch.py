"""Light through several pupils, for several distances of the source and the sensor."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from optics.elements.pupil import Pupil
from optics.elements.source import PointSource
from optics.methods.window_stack import WindowStack
from optics.numerics.arguments import is_sized, items, pair
from optics.numerics.autodiff import Array, Scalar, entries, number
from optics.numerics.grid import Grid
from optics.point_spread.coarse_stack import coarse_stack
from optics.point_spread.psf import psf
from optics.point_spread.request import sensor_place

__all__ = ["LightBatch", "is_row"]


@dataclass(frozen=True)
class LightBatch:
    """Light through several pupils, for several distances. All numbers may carry derivatives.

    pupils: the pupils.
    distances: pairs of the sensor's and the source's distance [m]. The distance of the sensor may be None, see
        `optics.psf`.
    angle: direction (x, y) [rad] in which the light travels.
    """

    pupils: tuple[Pupil, ...]
    distances: tuple[tuple[Scalar | None, Scalar], ...]
    angle: tuple[Scalar, Scalar]

    @classmethod
    def from_arguments(cls, pupil: Any, sensor_distance: Any, source_distance: Any, source_angle: Any) -> LightBatch:
        """Return the light for a pupil or a sequence of pupils, and for distances that are numbers or sequences.

        Raises:
            ValueError: something else is given, a sequence is empty, or the sequences of distances differ in length.
        """
        several = items("pupil", pupil, Pupil, "Pupil(25e-6)") if is_row(pupil) else (pupil,)
        items("pupil", several, Pupil, "Pupil(25e-6)")
        rows = {"sensor_distance": sensor_distance, "source_distance": source_distance}
        counts = {name: len(row) for name, row in rows.items() if is_row(row)}
        for name, count in {"pupil": len(several), **counts}.items():
            if count == 0:
                raise ValueError(f"{name} is empty: must hold at least one")
        if len(set(counts.values())) > 1:
            raise ValueError(
                f"sensor_distance has {counts['sensor_distance']} entries and source_distance "
                f"{counts['source_distance']}: must be of equal length, because they are used pairwise"
            )
        count = next(iter(counts.values()), 1)
        sensors, sources = (tuple(entries(row)) if name in counts else (row,) * count for name, row in rows.items())
        angle = pair("source_angle", entries(source_angle), "angles (x, y) [rad]")
        for source in sources:
            PointSource(source, angle)
        return cls(several, tuple(zip(sensors, sources, strict=True)), angle)

    @property
    def members(self) -> list[tuple[Pupil, Scalar | None, Scalar]]:
        """The pupil, the sensor's distance [m] and the source's distance [m] of each PSF.

        The list contains all pairs of distances for the first pupil, then all pairs for the next.
        """
        return [(pupil, sensor, source) for pupil in self.pupils for sensor, source in self.distances]

    def images(self, places: Sequence[int], wavelengths: np.ndarray, view: Mapping[str, Any]) -> Array:
        """Return some of the PSFs as a Dr.Jit tensor (PSF, wavelength, y, x) with derivatives, see `optics.psf`.

        places: indices of these PSFs in `members`.
        view: arguments of `optics.psf` for the window, the tolerance and the method.
        """
        import drjit as dr

        found = []
        for pupil, sensor, source in map(self.members.__getitem__, places):
            found.append(psf(pupil, wavelengths, sensor, source, self.angle, **view).tensor)
        flat: Array = dr.concat([tensor.array for tensor in found])
        return type(found[0])(flat, (len(found), *found[0].shape))

    def coarse_images(
        self,
        fixed: LightBatch,
        wavelengths: np.ndarray,
        view: Mapping[str, Any],
        convert: Callable[[np.ndarray], Array],
    ) -> dict[int, Array]:
        """Compute the PSFs of several sources together, and return those PSFs that meet the tolerance.

        The result maps the index of a PSF in `members` to the PSF at all wavelengths, (wavelength, y, x). PSFs of
        several sources that have the same pupil and the same distance of the sensor form a stack. The samples of the
        pupil are planned once for the whole stack. PSFs that miss the tolerance at any wavelength are left out.

        fixed: the same light without derivatives.
        wavelengths: vacuum wavelengths [m], (wavelength,).
        view: arguments of `optics.psf` for the window, the tolerance and the method.
        convert: see `stacks`.
        """
        found: dict[int, Array] = {}
        asked = wavelengths, Grid(view["shape"], view["dx"], view["centre"]), view["dtype"]
        both = zip(self.stacks(*asked, convert), fixed.stacks(*asked, np.asarray), strict=True)
        for (places, own), (_, without) in both:
            part = coarse_stack(own, without, view["tolerance"], view["method"])
            if part is not None:
                images, met = part[0], np.all(part[1], axis=1)
                found |= {place: image for place, image, right in zip(places, images, met, strict=True) if right}
        return found

    def stacks(
        self, wavelengths: np.ndarray, window: Grid, dtype: str, convert: Callable[[np.ndarray], Array]
    ) -> list[tuple[list[int], WindowStack]]:
        """Return stacks of PSFs that have the same pupil and the same distance of the sensor.

        Each stack is paired with the indices of its PSFs in `members`.

        convert: function that converts a NumPy array to the library of the computation, NumPy or PyTorch.
        """
        groups: dict[tuple[int, float], list[int]] = {}
        for place, (pupil, sensor, source) in enumerate(self.members):
            own = place // len(self.distances), number(sensor_place(pupil, sensor, source))
            groups.setdefault(own, []).append(place)
        found, waves = [], tuple(map(float, wavelengths))
        for places in groups.values():
            pupil, sensor, source = self.members[places[0]]
            at = sensor_place(pupil, sensor, source)
            sources = tuple(PointSource(self.members[place][2], self.angle) for place in places)
            found.append((places, WindowStack(pupil, sources, waves, at, window, dtype, convert)))
        return found

    def cutoff(self, wavelengths: np.ndarray) -> float:
        """Return an upper bound on the frequencies [1/m] of all intensities; see `PSFResult.cutoff`."""
        slopes = [
            1 / math.hypot(1, number(sensor_place(pupil, sensor, source)) / pupil.radius)
            for pupil, sensor, source in self.members
        ]
        waves = [pupil.index_behind(float(at)) / float(at) for pupil in self.pupils for at in wavelengths]
        return 2 * max(slopes) * max(waves)


def is_row(value: Any) -> bool:
    """Return whether `value` is a sequence or an array with at least one axis, as opposed to a number."""
    return is_sized(value) and not isinstance(value, str)
