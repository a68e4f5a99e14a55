"""Reflectances of all materials in one table, baked from Mitsuba's own BSDFs.

Mitsuba evaluates every texel at the bands' wavelengths. As in Mitsuba's `bitmap`, reflectances between texels are
interpolated bilinearly, and a texture repeats beyond its edges. A texture that is constant along an axis has a single
texel along it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import mujoco
import numpy as np

from sim.scene import shapes, surfaces
from sim.scene.variant import MitsubaObject
from sim.tracing import lighting


@dataclass(frozen=True)
class Atlas:
    """Reflectances of several textures in one table.

    texels: reflectance, (texel, band), of all textures in sequence, row by row
    places: for each texture, the index of its first texel, and its numbers of columns and rows, (texture, 3)
    to_texels: for each texture, the map from texture coordinates to texels, (column, row) = to_texels @ (u, v, 1),
        (texture, 2, 3); texel centres are at whole numbers
    """

    texels: np.ndarray
    places: np.ndarray
    to_texels: np.ndarray

    @property
    def one_dimensional(self) -> bool:
        """True if no texture has more than one row."""
        return bool((self.places[:, 2] == 1).all())


def bake(model: mujoco.MjModel, geoms: Sequence[int], bsdfs: Sequence[MitsubaObject], wavelengths: np.ndarray) -> Atlas:
    """Return the atlas of these geoms' BSDFs at wavelengths [m], with one texture per geom.

    Geoms with the same BSDF share texels.
    """
    texels: list[np.ndarray] = []
    places: dict[int, tuple[tuple[int, int, int], np.ndarray]] = {}
    for geom, bsdf in zip(geoms, bsdfs, strict=True):
        if id(bsdf) in places:
            continue
        table, to_texels = _bake_one(model, int(geom), bsdf, wavelengths)
        first = sum(len(t) for t in texels)
        places[id(bsdf)] = (first, table.shape[1], table.shape[0]), to_texels
        texels.append(table.reshape(-1, table.shape[2]))
    found = [places[id(bsdf)] for bsdf in bsdfs]
    return Atlas(np.concatenate(texels), np.array([p for p, _ in found]), np.array([t for _, t in found]))


def _bake_one(
    model: mujoco.MjModel, geom: int, bsdf: MitsubaObject, wavelengths: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the reflectance (row, column, band), and the map from Mitsuba's (u, v) of the geom to texels, (2, 3).

    wavelengths: centres of the bands [m], (band,)
    """
    width, height = 1, 1
    if shapes.is_textured(model, geom):
        height, width = surfaces.image(model, surfaces.texture_id(model, geom)).shape[:2]
    to_uv = shapes.uv_transform(model, geom)
    to_uv = np.eye(3) if to_uv is None else to_uv
    column, row = np.meshgrid(np.arange(width), np.arange(height))
    centres = np.stack([(column.ravel() + 0.5) / width, (row.ravel() + 0.5) / height, np.ones(column.size)])
    table = _reflectance(bsdf, np.linalg.solve(to_uv, centres)[:2], wavelengths).reshape(height, width, -1)
    to_texels = np.array([[width, 0, -0.5], [0, height, -0.5]]) @ to_uv
    if _constant(table, axis=0):
        return table[:1], to_texels * [[1], [0]]
    if _constant(table, axis=1):
        return table[:, :1].transpose(1, 0, 2), to_texels[::-1] * [[1], [0]]
    return table, to_texels


def _constant(table: np.ndarray, axis: int) -> bool:
    return bool(np.allclose(table, table.take([0], axis), rtol=1e-6, atol=0))


def _reflectance(bsdf: MitsubaObject, uv: np.ndarray, wavelengths: np.ndarray) -> np.ndarray:
    """Return Mitsuba's reflectance (point, band) at texture coordinates (2, point) and wavelengths [m]."""
    si = dr.zeros(mi.SurfaceInteraction3f, uv.shape[1])
    si.uv = mi.Point2f(*(mi.Float(np.ascontiguousarray(c, np.float32)) for c in uv))
    si.wi = mi.Vector3f(0, 0, 1)
    values = []
    for spectrum in lighting.spectra(wavelengths):
        si.wavelengths = spectrum
        value = np.array(bsdf.eval_diffuse_reflectance(si, True))
        values.append(np.broadcast_to(value, (lighting.LANES, uv.shape[1])))
    return np.concatenate(values)[: len(wavelengths)].T.astype(np.float64)
