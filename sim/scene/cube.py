"""Cube textures: six square images around a geom, mapped to its triangles.

MuJoCo looks up a cube texture by the direction from the geom's centre to a point of the geom. On primitives (geoms that
are not meshes, SDFs or height fields), the point's coordinates are first divided by the geom's half sizes, unless the
texture is uniform. The caps of capsules are an exception, see `directions`. Mitsuba has no such texture. Triangles are
therefore cut along the seams between faces of the cube. Their texture coordinates refer to one image in which the six
faces are stacked vertically, in MuJoCo's order R L U D F B: R/L = +x/-x, U/D = +y/-y, F/B = +z/-z. The columns and rows
of each face are oriented as in OpenGL (table 3.19 of its 2.1 specification).
"""

from __future__ import annotations

import mujoco
import numpy as np

from sim.scene.tessellation import Triangles

BORDER = 1  # texels around each face that repeat its edge, so that bilinear lookups do not bleed into its neighbours
# For each face: its axis and sign, and the axes of the image's columns and rows with their signs.
_MAJOR, _MAJOR_SIGN = np.array([0, 0, 1, 1, 2, 2]), np.array([1, -1, 1, -1, 1, -1])
_COLUMN, _COLUMN_SIGN = np.array([2, 2, 0, 0, 0, 0]), np.array([-1, 1, 1, 1, 1, -1])
_ROW, _ROW_SIGN = np.array([1, 1, 2, 2, 1, 1]), np.array([-1, -1, 1, -1, -1, -1])
_SEAMS = ((0, 1, 1), (0, 1, -1), (1, 2, 1), (1, 2, -1), (0, 2, 1), (0, 2, -1))  # planes d_a = ± d_b between faces
# Texture coordinates are a ratio of two functions that are linear on a triangle. Treating the ratio as linear causes an
# error of about one eighth of its range times the relative variation of the divisor. Triangles are halved until the
# error is below this fraction of a face.
TOLERANCE = 2e-3
_HALVINGS = 12


def padded(pixels: np.ndarray) -> np.ndarray:
    """Return the image of a cube texture with a border around each of its n faces, (n (w + 2), w + 2, 3).

    pixels: the n square faces of width w, stacked vertically, (n w, w, 3)
    """
    width = pixels.shape[1]
    faces = pixels.reshape(-1, width, width, 3)
    margin = (BORDER, BORDER)
    return np.pad(faces, ((0, 0), margin, margin, (0, 0)), mode="edge").reshape(-1, width + 2 * BORDER, 3)


def directions(vertices: np.ndarray, kind: mujoco.mjtGeom, size: np.ndarray, uniform: bool) -> np.ndarray:
    """Return the directions in which MuJoCo looks up a cube texture for points of a geom, (point, 3).

    A direction is the point divided by the geom's half sizes. On a capsule's caps, the direction's z is ±(1 + d/radius)
    instead, where d [m] is the distance along z beyond the end of the cylindrical side. For meshes, SDFs and height
    fields, the direction is the point itself. If `uniform` is True, x, y and z of all these directions are then
    multiplied by the half sizes.

    vertices: points in the geom's frame [m], (point, 3)
    kind: type of the geom
    size: half sizes (3,) along x, y, z [m]; for a capsule, those of its cylindrical side
    uniform: True if the material has `texuniform`
    """
    if kind in (mujoco.mjtGeom.mjGEOM_MESH, mujoco.mjtGeom.mjGEOM_SDF, mujoco.mjtGeom.mjGEOM_HFIELD):
        found = vertices.copy()
    else:
        found = vertices / size
    if kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        beyond = np.abs(vertices[:, 2]) - size[2]
        cap = beyond > 0
        found[cap, 2] = np.sign(vertices[cap, 2]) * (1 + beyond[cap] / size[0])
    return found * size if uniform else found


def look_up(towards: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return where rays from the centre of a texture's cube meet the cube: the faces, and the positions on them.

    Faces are numbered from 0 to 5 in MuJoCo's order R L U D F B. A position is a column and a row, both in [0, 1]. Row
    0 is at the top. The arrays have the shapes (direction,) and (direction, 2).

    towards: directions of the rays, (direction, 3)
    """
    axis = np.argmax(np.abs(towards), axis=1)
    face = 2 * axis + (np.take_along_axis(towards, axis[:, None], 1)[:, 0] < 0)
    return face, _on_face(towards, face)


def laid(triangles: Triangles, towards: np.ndarray, width: int, n_faces: int) -> Triangles:
    """Return the triangles with texture coordinates in the image that `padded` returns.

    Triangles are cut along the seams between faces of the texture's cube, so that each lies on one face.

    towards: directions of the vertices, (n, 3)
    width: width of a face in texels
    n_faces: 6, or 1 if all sides share a face
    """
    corners = np.concatenate([triangles.vertices, towards], axis=1)
    if triangles.normals is not None:
        corners = np.concatenate([corners, triangles.normals], axis=1)
    pieces = corners[triangles.faces]  # (triangle, corner, position | direction | normal)
    for a, b, sign in _SEAMS:
        pieces = _cut(pieces, pieces[..., 3 + a] - sign * pieces[..., 3 + b])
    pieces = _halved(pieces)
    flat = pieces.reshape(-1, pieces.shape[2])
    face = np.repeat(_face_of(pieces), 3)
    at = _on_face(flat[:, 3:6], face)
    pitch = width + 2 * BORDER
    row = (face if n_faces > 1 else 0) * pitch + BORDER + at[:, 1] * width
    uv = np.column_stack([(BORDER + at[:, 0] * width) / pitch, row / (n_faces * pitch)])
    normals = None
    if triangles.normals is not None:
        normals = flat[:, 6:] / np.maximum(np.linalg.norm(flat[:, 6:], axis=1, keepdims=True), 1e-300)
    return Triangles(flat[:, :3], np.arange(len(flat)).reshape(-1, 3), uv, normals)


def _on_face(towards: np.ndarray, face: np.ndarray) -> np.ndarray:
    lane = np.arange(len(towards))
    major = np.maximum(towards[lane, _MAJOR[face]] * _MAJOR_SIGN[face], 1e-12)
    column = towards[lane, _COLUMN[face]] * _COLUMN_SIGN[face] / major
    row = towards[lane, _ROW[face]] * _ROW_SIGN[face] / major
    return np.clip((np.column_stack([column, row]) + 1) / 2, 0, 1)


def _face_of(pieces: np.ndarray) -> np.ndarray:
    return look_up(pieces[:, :, 3:6].mean(axis=1))[0]


def _cut(pieces: np.ndarray, side: np.ndarray) -> np.ndarray:
    """Return the triangles, each cut into two or three if a seam crosses it.

    A seam is the border between two faces of the texture's cube, extended to a plane through the cube's centre.

    pieces: values at the corners of each triangle, (triangle, corner, value), interpolated where a triangle is cut
    side: for each corner, the value of a linear function of position that is positive on one side of the seam, negative
        on the other and 0 on the seam, (triangle, corner)
    """
    side = np.where(np.abs(side) < 1e-9 * np.abs(side).max(initial=0), 0, side)
    crossed = (side.max(axis=1) > 0) & (side.min(axis=1) < 0)
    whole, cut, side = pieces[~crossed], pieces[crossed], side[crossed]
    # Rotate each triangle until only its first corner is on its side of the seam. Corners on the seam belong to the
    # other side.
    positive = (side > 0).sum(axis=1)
    lone = np.where(positive == 1, np.argmax(side, axis=1), np.argmin(side, axis=1))
    turn = (lone[:, None] + np.arange(3)) % 3
    cut, side = np.take_along_axis(cut, turn[..., None], 1), np.take_along_axis(side, turn, 1)
    # Intersections of the edges to the other two corners with the seam; a corner on the seam is unchanged.
    along = (side[:, :1] / (side[:, :1] - side[:, 1:]))[..., None]
    seam = cut[:, :1] + along * (cut[:, 1:] - cut[:, :1])
    tip = np.stack([cut[:, 0], seam[:, 0], seam[:, 1]], axis=1)
    near = np.stack([seam[:, 0], cut[:, 1], cut[:, 2]], axis=1)
    far = np.stack([seam[:, 0], cut[:, 2], seam[:, 1]], axis=1)
    return np.concatenate([whole, tip, near[side[:, 1] != 0], far[side[:, 2] != 0]])


def _halved(pieces: np.ndarray) -> np.ndarray:
    """Return the triangles, divided until linear interpolation of texture coordinates within each is accurate enough.

    If the interpolation error in a triangle is too large, the triangle is bisected at the midpoint of its longest edge.
    This is repeated at most _HALVINGS times.
    """
    done = []
    for _ in range(_HALVINGS):
        bent = _bend(pieces) > TOLERANCE
        done.append(pieces[~bent])
        pieces = pieces[bent]
        if not len(pieces):
            break
        edges = np.linalg.norm(np.roll(pieces, -1, axis=1)[..., 3:6] - pieces[..., 3:6], axis=2)
        turn = (np.argmax(edges, axis=1)[:, None] + np.arange(3)) % 3
        a, b, c = np.moveaxis(np.take_along_axis(pieces, turn[..., None], 1), 1, 0)
        middle = (a + b) / 2
        pieces = np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])
    return np.concatenate([*done, pieces])


def _bend(pieces: np.ndarray) -> np.ndarray:
    """Return the approximate error of interpolating the texture coordinates linearly in each triangle, (triangle,).

    The coordinates are the position on a face of the cube that surrounds the object. The position is found by dividing
    a direction by its component towards the face, so it is not a linear function of the point on the triangle. The
    error is in units of the width of a face.
    """
    face = _face_of(pieces)
    major = np.take_along_axis(pieces[..., 3:6], _MAJOR[face][:, None, None], 2)[..., 0] * _MAJOR_SIGN[face][:, None]
    at = _on_face(pieces[..., 3:6].reshape(-1, 3), np.repeat(face, 3)).reshape(-1, 3, 2)
    ratio = major.max(axis=1) / np.maximum(major.min(axis=1), 1e-9)
    return np.ptp(at, axis=1).max(axis=1) * (ratio - 1) / 8
