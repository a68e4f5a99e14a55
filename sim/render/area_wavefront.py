"""The kernels that see by areas: what areas of one world or of one column share is found first, once."""

from __future__ import annotations

from collections.abc import Callable

import drjit as dr
import mitsuba as mi
import numpy as np

from optics.numerics.autodiff import Array
from sim.eyes.sensor import Sensor
from sim.render.wavefront import PoseBuffer, Wavefront
from sim.scene.device_arrays import counted, floats, in_fours, whole_numbers
from sim.scene.variant import MitsubaObject
from sim.tracing.areas.area_tracer import AreaTracer
from sim.tracing.areas.borders import Borders
from sim.tracing.areas.illumination import Moment
from sim.tracing.areas.patch import Area


class AreaWavefront(Wavefront):
    """Sees areas.

    in_agent_frame: turns every eye's directions, (direction, 3), into the agent's frame, (eye, direction, 3)
    """

    def __init__(
        self,
        n_envs: int,
        n_eyes: int,
        sensor: Sensor,
        tracer: AreaTracer,
        poses: PoseBuffer,
        in_agent_frame: Callable[[np.ndarray], np.ndarray],
    ) -> None:
        super().__init__(n_envs, n_eyes, sensor, poses)
        assert sensor.extent is not None
        self._by_areas, self._extent = tracer, sensor.extent
        self._borders = Borders.of(sensor.directions[:, 0], sensor.extent[0])
        self._at_borders = in_agent_frame(self._borders.directions)

    @property
    def inputs(self) -> dict[str, Array]:
        """See Wavefront."""
        found = {"extent": floats(np.array(self._extent))}
        if self._borders.shared:
            n = len(self._borders.x)
            found |= {
                "border_sizes": whole_numbers([n, self.n_eyes]),
                "border_lanes": counted(self.n_envs * self.n_eyes * n),
                "border_directions": floats(in_fours(self._at_borders, 0.0)),
                "border_sides": whole_numbers(self._borders.sides),
            }
        if self._by_areas.places:
            found["place_lanes"] = counted(self.n_envs * self._by_areas.places)
        return super().inputs | found

    def _components(
        self, scene: MitsubaObject, poses: Array, inputs: dict[str, Array], place: tuple[Array, Array, Array]
    ) -> list[Array]:
        """Of the mean light in the area there."""
        lit = self._lit(poses, inputs)
        ray, _, agent, centres = self._ray(poses, inputs, *place)
        width, height = (dr.gather(mi.Float, inputs["extent"], i) for i in range(2))
        area = Area.of(ray, agent, (width, height))
        met = self._met_at(poses, inputs, place) if self._borders.shared else self._by_areas.met_by(area, inputs)
        return self._by_areas.radiance(area, met, Moment([*centres, agent], inputs, place[0], lit), self.depth)

    def _lit(self, poses: Array, inputs: dict[str, Array]) -> list[Array]:
        """What share of each light reaches which place of each world's bodies, flat (world, place)."""
        places = self._by_areas.places
        if not places:
            return []
        world = inputs["place_lanes"] // places
        agent, centres, _ = self._pose(poses, world)
        lit = self._by_areas.lit(inputs["place_lanes"] - world * places, [*centres, agent], inputs)
        dr.eval(lit)
        return lit

    def _met_at(self, poses: Array, inputs: dict[str, Array], place: tuple[Array, Array, Array]) -> tuple[Array, Array]:
        """Faces at the left and right border of the area there."""
        (world, eye, sample), faces = place, self._faces(poses, inputs)
        n, n_eyes = (dr.gather(mi.UInt32, inputs["border_sizes"], i) for i in range(2))
        first, sides = (world * n_eyes + eye) * n, dr.gather(mi.Vector2u, inputs["border_sides"], sample)
        return dr.gather(mi.UInt32, faces, first + sides.x), dr.gather(mi.UInt32, faces, first + sides.y)

    def _faces(self, poses: Array, inputs: dict[str, Array]) -> Array:
        """Which face is met at each border of each eye, flat (world, eye, border)."""
        # Lanes that only fill up a packet read 0, and to divide by that ends the process.
        n, n_eyes = (dr.maximum(dr.gather(mi.UInt32, inputs["border_sizes"], i), 1) for i in range(2))
        view = inputs["border_lanes"] // n
        world = view // n_eyes
        eye = view - world * n_eyes
        agent, _, turned = self._pose(poses, world)
        origin = agent + turned(dr.gather(mi.Vector4f, inputs["origins"], eye))
        row = eye * n + (inputs["border_lanes"] - view * n)
        level = turned(dr.gather(mi.Vector4f, inputs["border_directions"], row))
        faces = self._by_areas.met(origin, level.xy, inputs)
        dr.eval(faces)
        return faces
