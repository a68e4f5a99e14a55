"""The kernel of area sampling, which computes the mean light in areas, rectangles of an eye's visual field.

Areas form rows and columns, whose borders are straight. Results that several areas share are computed once, in
advance: the light on the bodies of a world, and the face of a wall that is visible at each border between columns.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from optics.numerics.autodiff import Array
from sim.eyes.sensor import Facets, Sensor
from sim.render.eye_rays import Counts, Directions, EyeRays, Lane
from sim.render.ray_kernel import Frame, KernelInputs, RayKernel
from sim.scene.device_arrays import counted, floats, whole_numbers
from sim.tracing.areas.area_tracer import AreaTracer
from sim.tracing.areas.borders import Borders
from sim.tracing.areas.illumination import FrameState
from sim.tracing.areas.patch import Area


@dataclass(frozen=True)
class BorderInputs:
    """Borders between columns of areas, with the horizontal directions from the eye to these borders.

    Areas are the rectangles into which an eye's visual field is divided. Areas in the same column share their left and
    right borders.

    lanes: indices of lanes, the parallel computations of a kernel; there is one for each border of each eye in each
        world
    counts: number of borders of an eye, and number of eyes of a world
    along: directions to the borders
    sides: indices of each area's left and right border
    """

    lanes: Array
    counts: Counts
    along: Directions
    sides: Array


@dataclass(frozen=True)
class AreaInputs(KernelInputs):
    """Inputs of an `AreaKernel` that are the same in every call, in addition to `KernelInputs`.

    The kernel computes the mean light in areas, the rectangles of an eye's visual field.

    extent: width and height of areas on the tangent plane
    borders: directions to the borders between columns of areas; None: too few areas share borders for
        computing them in advance to save work
    places: indices of points on the bodies of all worlds; the kernel computes the illumination of each point; None:
        bodies reflect no light onto other surfaces
    """

    extent: Array | None = None
    borders: BorderInputs | None = None
    places: Array | None = None


class AreaKernel(RayKernel):
    """A kernel that computes the mean light in each area, a rectangle of an eye's visual field.

    areas: tracer that computes this mean light
    eyes: upright eyes
    sensor: directions and extent of the areas
    n_envs, n_eyes: numbers of worlds, and of eyes in each world
    """

    def __init__(self, areas: AreaTracer, eyes: EyeRays, sensor: Sensor, n_envs: int, n_eyes: int) -> None:
        super().__init__(areas.rays, eyes, n_envs, n_eyes, sensor.depth)
        assert sensor.extent is not None
        self._areas, self._extent = areas, sensor.extent
        self._borders = Borders.from_middles(sensor.directions[:, 0], sensor.extent[0])

    def inputs(self, ways: np.ndarray, bounces: np.ndarray | None = None, facets: Facets | None = None) -> AreaInputs:
        """Return the inputs of the kernel; see `RayKernel.inputs`.

        ways: centres of the areas on the tangent plane, which is perpendicular to the eye's axis at the distance 1,
            (area, 3)
        bounces, facets: ignored, because they describe rays, which this kernel does not trace
        """
        whole, places = super().inputs(ways), self._areas.places
        return AreaInputs(
            whole.lanes,
            whole.counts,
            whole.total,
            whole.along,
            self._areas.inputs,
            None,
            None,
            floats(np.array(self._extent)),
            self._border_inputs() if self._borders.shared else None,
            counted(self.n_envs * places) if places else None,
        )

    def _border_inputs(self) -> BorderInputs:
        n = len(self._borders.x)
        return BorderInputs(
            counted(self.n_envs * self.n_eyes * n),
            Counts.from_numbers(n, self.n_eyes),
            self.eyes.directions(self._borders.directions),
            whole_numbers(self._borders.sides),
        )

    def layers(self, scenes: Any, frame: Frame, inputs: AreaInputs) -> list[Array]:  # type: ignore[override]
        """Return the spectral components of the mean light in each area, separately for each depth layer.

        An area is a rectangle of an eye's visual field. A depth layer is a distance for which the eye has a PSF. The
        kernel has one lane (parallel computation) for each area of each eye in each world.
        """
        lit = self._lit(frame, inputs)
        lane = Lane.from_index(inputs.lanes, inputs.counts)
        seen = self.eyes.ray(frame.eyes, inputs.along, lane, inputs.counts.samples.number)
        width, height = (dr.gather(mi.Float, inputs.extent, i) for i in range(2))
        area = Area.from_extent(seen.ray, seen.axis.xy, (width, height))
        borders = inputs.borders
        faces = (
            self._areas.border_faces(area, inputs.tables)
            if borders is None
            else self._shared_border_faces(frame, inputs, borders, lane)
        )
        bodies = self._areas.bodies(frame.things, lane.world, seen.body)
        return self._areas.radiance(area, faces, FrameState(bodies, inputs.tables, lane.world, lit), self.depth)

    def _lit(self, frame: Frame, inputs: AreaInputs) -> list[Array]:
        """Return tables of the light that reaches and leaves bodies in all worlds; [] if none are needed.

        Their rows are described in `IlluminatedBodies`.
        """
        if inputs.places is None:
            return []
        world = inputs.places // self._areas.places
        nothing = mi.UInt32(0)
        at = self.eyes.ray(frame.eyes, inputs.along, Lane(world, nothing, nothing, nothing), nothing)
        bodies = self._areas.bodies(frame.things, world, at.body)
        lit = self._areas.body_light(inputs.places - world * self._areas.places, bodies, inputs.tables)
        dr.eval(lit)
        return lit

    def _shared_border_faces(
        self, frame: Frame, inputs: AreaInputs, borders: BorderInputs, lane: Lane
    ) -> tuple[Array, Array]:
        """Return the index of the wall face visible at each area's left border, and the index at its right border.

        An area is a rectangle of an eye's visual field. At each border, the visible face is the first face of a wall
        that a horizontal ray from the eye towards the border hits.

        lane: the area for which each lane (parallel computation) of the kernel is responsible
        """
        faces = self._faces(frame, inputs, borders)
        first = lane.row * borders.counts.samples.number
        sides = dr.gather(mi.Vector2u, borders.sides, lane.sample)
        return dr.gather(mi.UInt32, faces, first + sides.x), dr.gather(mi.UInt32, faces, first + sides.y)

    def _faces(self, frame: Frame, inputs: AreaInputs, borders: BorderInputs) -> Array:
        """Return the index of the wall's face that is visible at each border between columns of areas.

        Areas are the rectangles of an eye's visual field. A face is visible at a border if a horizontal ray from the
        eye towards this border hits it first. The result is a flat array (world, eye, border).
        """
        lane = Lane.from_index(borders.lanes, borders.counts)
        ray = self.eyes.ray(frame.eyes, borders.along, lane, borders.counts.samples.number).ray
        faces = self._areas.first_faces(ray.o, ray.d.xy, inputs.tables)
        dr.eval(faces)
        return faces
