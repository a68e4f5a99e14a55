"""Geoms as triangles with MuJoCo's texture coordinates, in the geom's frame.

In MuJoCo's coordinates u points to the right and v downwards, and (0, 0) is the outer corner of the image's first
texel. These conventions were measured in images of MuJoCo 4.0.0's renderer. The test tests/sim/scene/test_textures.py
compares textured geoms with such images.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import mujoco
import numpy as np

# Chord error of a tessellated unit circle: (π/SLICES)²/2 = 3e-4 of the radius, below the required 1e-3 of depths.
SLICES = 128
STACKS = 64
# Largest number of moves of a point when faces are moved outwards, and the largest fraction of the distance by which a
# face may fall short.
ROUNDS, ENOUGH = 100, 0.1


@dataclass(frozen=True)
class Triangles:
    """Triangles of a geom.

    vertices: (n, 3) [m]
    faces: (m, 3), counter-clockwise as seen from outside
    uv: (n, 2) or None
    normals: (n, 3), unit vectors, or None (flat)
    """

    vertices: np.ndarray
    faces: np.ndarray
    uv: np.ndarray | None = None
    normals: np.ndarray | None = None

    def repeated(self, repeat: np.ndarray) -> Triangles:
        """Return the same triangles with the texture repeated (u, v) times."""
        return self if self.uv is None else replace(self, uv=self.uv * repeat)

    def lifted(self, distance: float) -> Triangles:
        """Return the same triangles, with each face moved outwards by `distance` [m] or more.

        Faces may fall short of `distance` by about a tenth of it. Faces that met before still meet.
        """
        if distance == 0:
            return self
        _, place = np.unique(self.vertices, axis=0, return_inverse=True)
        at = place.reshape(-1)[self.faces]  # indices of distinct points, (m, 3)
        corners = self.vertices[self.faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
        # Each point repeatedly moves along the normal of the face that falls short most (Motzkin and Schoenberg 1954).
        moved = np.zeros((len(self.vertices), 3))
        for _ in range(ROUNDS):
            lacks = (normals**2).sum(axis=1)[:, None] - np.einsum("mki,mi->mk", moved[at], normals)
            most, count, step = np.zeros(len(moved)), np.zeros(len(moved)), np.zeros_like(moved)
            np.maximum.at(most, at, lacks)
            if most.max() < ENOUGH:
                break
            chosen = (lacks > ENOUGH) & (lacks > most[at] - 1e-9)
            np.add.at(count, at[chosen], 1)
            np.add.at(step, at[chosen], (lacks[..., None] * normals[:, None])[chosen])
            moved += step / np.maximum(count, 1)[:, None]
        return replace(self, vertices=self.vertices + distance * moved[place.reshape(-1)])

    def only(self, which: np.ndarray) -> Triangles:
        """Return the same triangles with only some of the faces, selected by a mask (m,)."""
        return replace(self, faces=self.faces[which])


def join(parts: list[Triangles]) -> Triangles:
    """Join several meshes into one.

    Either all or none have texture coordinates, and either all or none have normals.
    """
    offsets = np.cumsum([0] + [len(p.vertices) for p in parts[:-1]])
    uvs = [p.uv for p in parts if p.uv is not None]
    normals = [p.normals for p in parts if p.normals is not None]
    return Triangles(
        vertices=np.concatenate([p.vertices for p in parts]),
        faces=np.concatenate([p.faces + o for p, o in zip(parts, offsets, strict=True)]),
        uv=np.concatenate(uvs) if uvs else None,
        normals=np.concatenate(normals) if normals else None,
    )


_QUAD = np.array([[0, 1, 2], [0, 2, 3]])


def box(half_size: np.ndarray) -> Triangles:
    """Return a box around the origin.

    On the faces ±x, u increases with y and v decreases with z. On the faces ±y, u increases with x and v decreases with
    z. On the faces ±z, u increases with x and v decreases with y. On each face, u and v cover [0, 1]. Opposite faces
    show mirror images of each other.

    half_size: half the lengths [m] along x, y and z, (3,)
    """
    parts = []
    for axis, (u_axis, v_axis) in enumerate(((1, 2), (0, 2), (0, 1))):
        for sign in (1.0, -1.0):
            corners = np.zeros((4, 3))
            corners[:, u_axis] = [-1, 1, 1, -1]
            corners[:, v_axis] = [-1, -1, 1, 1]
            corners[:, axis] = sign
            outward = np.linalg.det(np.stack([corners[1] - corners[0], corners[2] - corners[1], corners[0]])) > 0
            faces = _QUAD if outward else _QUAD[:, ::-1]
            uv = np.column_stack([(corners[:, u_axis] + 1) / 2, (1 - corners[:, v_axis]) / 2])
            parts.append(Triangles(corners * half_size, faces, uv=uv))
    return join(parts)


def strip(half_sides: np.ndarray) -> Triangles:
    """Return a horizontal rectangle, divided into pieces along its longer side.

    The piece in the middle is a square. Each other piece is at most as long as its distance from the middle. The
    texture coordinates of the point (x, y) are u = (x/sx + 1)/2 and v = (y/sy + 1)/2.

    half_sides: half lengths (sx, sy) of the sides [m], (2,)
    """
    short, long = np.sort(half_sides)
    ahead = np.geomspace(short, long, int(np.ceil(np.log2(long / short))) + 1)
    along = np.repeat(np.concatenate([-ahead[::-1], ahead]), 2)
    across = np.tile([-short, short], len(ahead) * 2)
    level = [along, across] if half_sides[0] > half_sides[1] else [-across, along]
    first = np.arange(0, len(along) - 2, 2)
    faces = [np.column_stack([first, first + 2, first + 3]), np.column_stack([first, first + 3, first + 1])]
    uv = (np.column_stack(level) / half_sides + 1) / 2
    return Triangles(np.column_stack([*level, np.zeros(len(along))]), np.concatenate(faces), uv)


def ellipsoid(semi_axes: np.ndarray) -> Triangles:
    """Return an ellipsoid.

    Its texture coordinates are those of the unit sphere before scaling: u = azimuth / 2π, v = polar angle from +z / π.

    semi_axes: lengths of the semi-axes along x, y, z [m], (3,)
    """
    return _revolved(*_arc(0, np.pi), scale=semi_axes, v=np.linspace(0, 1, STACKS + 1))


def cylinder(radius: float, half_length: float) -> Triangles:
    """Return a cylinder.

    Texture coordinates are u = azimuth / 2π and v = (1 - z/h)/2 on the side, ((x/r + 1)/2, (y/r + 1)/2) on the ends.

    radius, half_length: radius r [m], and half of the length along z, h [m]
    """
    side = _revolved(
        np.ones(2), np.array([1.0, -1.0]), scale=np.array([radius, radius, half_length]), v=np.array([0.0, 1.0])
    )
    azimuth = np.linspace(0, 2 * np.pi, SLICES, endpoint=False)
    ring = np.column_stack([np.cos(azimuth), np.sin(azimuth)])
    disk = np.concatenate([np.zeros((1, 2)), ring])
    around = np.arange(SLICES)
    fan = np.column_stack([np.zeros(SLICES, int), 1 + around, 1 + (around + 1) % SLICES])
    ends = []
    for sign in (1.0, -1.0):
        vertices = np.column_stack([radius * disk, np.full(len(disk), sign * half_length)])
        normals = np.broadcast_to([0, 0, sign], vertices.shape)
        ends.append(Triangles(vertices, fan if sign > 0 else fan[:, ::-1], (disk + 1) / 2, normals))
    return join([side, *ends])


def capsule(radius: float, half_length: float) -> Triangles:
    """Return a capsule.

    Its side has the texture coordinates of a cylinder's side. On the upper cap, v increases from 0 at the pole to 1 at
    the side. On the lower cap, v increases from 0 at the side to 1 at the pole.

    radius, half_length: radius [m], and half of the length of the cylindrical side along z [m]
    """
    side = _revolved(
        np.ones(2), np.array([1.0, -1.0]), scale=np.array([radius, radius, half_length]), v=np.array([0.0, 1.0])
    )
    parts = [side]
    for sign, start in ((1.0, 0.0), (-1.0, np.pi / 2)):
        cap = _revolved(*_arc(start, start + np.pi / 2), scale=np.full(3, radius), v=np.linspace(0, 1, STACKS + 1))
        parts.append(replace(cap, vertices=cap.vertices + np.array([0, 0, sign * half_length])))
    return join(parts)


def mesh(model: mujoco.MjModel, mesh_id: int) -> Triangles:
    """Return a mesh asset with one vertex per corner of each face.

    Vertices are not shared, because normals and texture coordinates have separate indices. In a mesh without texture
    coordinates, a corner whose normal differs from that of its face by more than 37° gets the face's normal, as in
    MuJoCo's renderer.
    """
    faces = slice(model.mesh_faceadr[mesh_id], model.mesh_faceadr[mesh_id] + model.mesh_facenum[mesh_id])
    vertices = model.mesh_vert[model.mesh_face[faces].ravel() + model.mesh_vertadr[mesh_id]].astype(float)
    normals = model.mesh_normal[model.mesh_facenormal[faces].ravel() + model.mesh_normaladr[mesh_id]].astype(float)
    uv = None
    if model.mesh_texcoordadr[mesh_id] >= 0:
        uv = model.mesh_texcoord[model.mesh_facetexcoord[faces].ravel() + model.mesh_texcoordadr[mesh_id]].astype(float)
    else:
        corners = vertices.reshape(-1, 3, 3)
        flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        flat = np.repeat(flat / np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-300), 3, axis=0)
        normals = np.where(np.sum(normals * flat, axis=1, keepdims=True) < 0.8, flat, normals)
    return Triangles(vertices, np.arange(len(vertices)).reshape(-1, 3), uv, normals)


def height_field(model: mujoco.MjModel, field: int) -> Triangles:
    """Return a height field asset as the closed solid that MuJoCo draws.

    The diagonals of its facets run from the lower left to the upper right corner of each cell. Walls along the four
    sides and a base close it.
    """
    rows, columns = int(model.hfield_nrow[field]), int(model.hfield_ncol[field])
    sx, sy, top, base = model.hfield_size[field]
    start = model.hfield_adr[field]
    z = top * model.hfield_data[start : start + rows * columns].astype(float)
    y, x = np.meshgrid(np.linspace(-sy, sy, rows), np.linspace(-sx, sx, columns), indexing="ij")
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = (i.ravel() for i in (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]))
    surface = Triangles(
        np.column_stack([x.ravel(), y.ravel(), z]),
        np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])]),
    )
    # Counter-clockwise around the field as seen from above.
    rim = (index[0, :], index[:, -1], index[-1, ::-1], index[::-1, 0])
    return join([surface, *(_wall(surface.vertices[edge], base) for edge in rim), _base(sx, sy, base)])


def _wall(edge: np.ndarray, base: float) -> Triangles:
    """Return the wall from an edge (n, 3) of the surface down to the base, at z = -`base` [m]."""
    n = len(edge)
    foot = np.column_stack([edge[:, :2], np.full(n, -base)])
    i = np.arange(n - 1)
    faces = np.concatenate([np.column_stack([n + i, n + i + 1, i + 1]), np.column_stack([n + i, i + 1, i])])
    return Triangles(np.concatenate([edge, foot]), faces)


def _base(sx: float, sy: float, base: float) -> Triangles:
    return Triangles(np.array([[-sx, -sy, -base], [-sx, sy, -base], [sx, sy, -base], [sx, -sy, -base]]), _QUAD)


def _arc(start: float, stop: float) -> tuple[np.ndarray, np.ndarray]:
    polar = np.linspace(start, stop, STACKS + 1)
    return np.sin(polar), np.cos(polar)


def _revolved(radius: np.ndarray, height: np.ndarray, scale: np.ndarray, v: np.ndarray) -> Triangles:
    """Return the surface of revolution of the profile (radius, height), from top to bottom, scaled afterwards.

    The vertices of the seam are doubled, since the texture coordinate u is 0 on one side of it and 1 on the other.

    radius, height: profile of the unit shape, (n,)
    scale: factors along x, y, z [m], (3,)
    v: texture coordinate of each point of the profile, (n,)
    """
    azimuth = np.linspace(0, 2 * np.pi, SLICES + 1)
    circle = np.column_stack([np.cos(azimuth), np.sin(azimuth)])
    unit = np.concatenate(
        [
            radius[:, None, None] * circle[None],
            np.broadcast_to(height[:, None, None], (len(height), SLICES + 1, 1)),
        ],
        axis=2,
    )
    # Normals of the unit shape: those of a sphere, or of a cylinder if the radius is constant.
    normal = unit * [1, 1, 0 if np.ptp(radius) == 0 else 1] / scale
    normal /= np.linalg.norm(normal, axis=2, keepdims=True)
    uv = np.stack(np.broadcast_arrays(azimuth[None, :] / (2 * np.pi), v[:, None]), axis=2)
    index = np.arange(len(radius) * (SLICES + 1)).reshape(len(radius), SLICES + 1)
    a, b, c, d = (i.ravel() for i in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]))
    faces = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    return Triangles((unit * scale).reshape(-1, 3), faces, uv.reshape(-1, 2), normal.reshape(-1, 3))
