"""All moving meshes in one Mitsuba scene, in which a kernel finds the hits of rays with each mesh separately.

Every mesh is scaled to a ball of radius 1 in a separate cell. A ray is traced only inside a ball of radius 1.1, so it
cannot hit another mesh. A kernel therefore needs one scene and one loop for any number of meshes, and moving a mesh
does not change the scene. With one scene per mesh, kernels for 128 meshes would take minutes to compile.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from optics.numerics.autodiff import Array
from sim.scene.merged_parts import PlacedPart, merged
from sim.scene.shapes import Part
from sim.scene.variant import MitsubaObject

# Distance between centres of cells, and radius of the ball in which a ray is traced. The ball is larger than a mesh, so
# that rounding moves no mesh out of its ball, and smaller than the distance to other meshes.
PITCH, BALL = 2.5, 1.1


@dataclass(frozen=True)
class MeshAtlas:
    """Moving meshes in one scene, each in a separate cube of space, its cell.

    Each mesh is scaled so that it just fits into a ball of radius 1 in its cell.

    cells: centre of each mesh's cell, (mesh, 3)
    scene: Mitsuba's scene of all meshes; None without meshes
    """

    cells: np.ndarray
    scene: MitsubaObject | None

    @staticmethod
    def from_parts(parts: Sequence[Sequence[Part]], reach: np.ndarray, bsdf: MitsubaObject) -> MeshAtlas:
        """Return the atlas of meshes with these parts.

        parts: parts of each mesh
        reach: largest distance of each mesh's surface from its origin [m], (mesh,)
        bsdf: BSDF of the shapes in the atlas. It has no effect, because the atlas only finds hits. Light is
            computed with the BSDFs of the moving bodies themselves
        """
        if not len(parts):
            return MeshAtlas(np.zeros((0, 3)), None)
        side = int(np.ceil(np.cbrt(len(parts))))
        steps = np.stack(np.unravel_index(np.arange(len(parts)), (side,) * 3), axis=1)
        cells = PITCH * (steps - (side - 1) / 2)
        placed: list[PlacedPart] = []
        for m, (cell, radius) in enumerate(zip(cells, reach, strict=True)):
            pose = np.diag([1 / radius, 1 / radius, 1 / radius, 1.0])
            pose[:3, 3] = cell
            placed += [(f"mesh_{m}_{k}", part, pose, bsdf) for k, part in enumerate(parts[m])]
        return MeshAtlas(cells, mi.load_dict({"type": "scene", **merged(placed, "meshes")}, optimize=False))

    def hit(self, o: Array, d: Array, cell: Array, reach: Array) -> Array:
        """Return the distance [m] from the point o to a mesh in the direction d; infinite for a miss.

        o, d: origin [m] and direction (a unit vector) of the ray, in the mesh's frame
        cell: centre of the mesh's cell, a cube that contains only this mesh in the scene of all meshes, see `cells`
        reach: largest distance of the mesh's surface from its origin [m]
        """
        ray, start = _within(o, d, cell, reach)
        assert self.scene is not None
        found = self.scene.ray_intersect_preliminary(ray)
        return dr.select(found.is_valid(), (start + found.t) * reach, dr.inf)

    def surface(self, o: Array, d: Array, cell: Array, reach: Array, active: Array) -> tuple[Array, Array]:
        """Return the normal in the mesh's frame, and the texture coordinates, at the points where rays hit the mesh.

        o, d, cell, reach: see `hit`
        active: True for rays that hit a mesh
        """
        ray, _ = _within(o, d, cell, reach)
        assert self.scene is not None
        si = self.scene.ray_intersect(ray, mi.RayFlags.All, True, active)
        return mi.Vector3f(si.sh_frame.n), si.uv


def _within(o: Array, d: Array, cell: Array, reach: Array) -> tuple[Array, Array]:
    """Return the part of a ray that lies inside the ball around one mesh, and the distance to the start of this part.

    The returned ray is in the coordinates of the scene of all meshes (`MeshAtlas`). In this scene, the mesh is scaled
    to the radius 1, and the ball has the radius 1.1. The distance is in radii of the mesh.

    o, d, cell, reach: see `MeshAtlas.hit`
    """
    centre = o / reach
    nearest = -dr.dot(centre, d)
    aside = dr.fma(d, nearest, centre)
    half = dr.sqrt(dr.maximum(BALL * BALL - dr.squared_norm(aside), 0))
    start = dr.maximum(nearest - half, 0)
    ray = mi.Ray3f(mi.Point3f(dr.fma(d, start - nearest, aside) + cell), d)
    ray.maxt = nearest + half - start
    return ray, start
