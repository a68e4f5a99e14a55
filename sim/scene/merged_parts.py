"""Merging of shapes that share a material. Every shape of a Mitsuba scene makes kernel launches slower."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from sim.scene import shapes, tessellation
from sim.scene.shapes import Part
from sim.scene.tessellation import Triangles
from sim.scene.variant import Description, MitsubaObject

PlacedPart = tuple[str, Part, np.ndarray, MitsubaObject]  # name, part, pose (4, 4) and BSDF


def merged(parts: Iterable[PlacedPart], prefix: str) -> Description:
    """Return Mitsuba shapes (of the active variant) by name.

    Triangles of one material are merged into a shape with the name "<prefix>_<n>". Meshes with and without normals or
    texture coordinates are merged separately. Shapes that are not meshes keep their names.
    """
    description: Description = {}
    meshes: dict[tuple[int, bool, bool], tuple[MitsubaObject, list[Triangles]]] = {}
    for name, part, pose, bsdf in parts:
        if part.triangles is None:
            description[name] = shapes.build(part, pose, name, bsdf, None)
            continue
        placed = _placed(part.triangles, pose)
        key = id(bsdf), placed.uv is None, placed.normals is None
        meshes.setdefault(key, (bsdf, []))[1].append(placed)
    for i, (bsdf, triangles) in enumerate(meshes.values()):
        whole = Part(triangles=tessellation.join(triangles))
        description[f"{prefix}_{i}"] = shapes.build(whole, np.eye(4), f"{prefix}_{i}", bsdf, None)
    return description


def _placed(triangles: Triangles, pose: np.ndarray) -> Triangles:
    """Return triangles transformed from a geom's frame to the world's; pose: the geom's frame, (4, 4)."""
    normals = None if triangles.normals is None else triangles.normals @ pose[:3, :3].T
    return replace(triangles, vertices=triangles.vertices @ pose[:3, :3].T + pose[:3, 3], normals=normals)
