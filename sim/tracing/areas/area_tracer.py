"""Worlds of upright walls, a floor and spheres, seen by whole areas instead of rays: in closed form, no noise.

What an area sees is shared out among floor, walls, sky and spheres; each surface's texture is averaged over its patch,
and each light is shut off by the shares that lie in shadow. Colours and components are those of
`sim.tracing.closed_form_tracer`, which follows rays through the same worlds.
"""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from optics.numerics.autodiff import Array
from sim.tracing import lighting
from sim.tracing.areas import sphere_areas
from sim.tracing.areas.branches import only_where
from sim.tracing.areas.columns import RIM, Columns, Piece
from sim.tracing.areas.patch import Area, Patch
from sim.tracing.areas.shadows import WallShadows, lit_past_sphere
from sim.tracing.areas.sphere_areas import SphereTexture
from sim.tracing.areas.stripes import Stripes, Texture
from sim.tracing.closed_form_tracer import Components, components_of, face_rows
from sim.tracing.reflectance_atlas import Atlas, bake
from sim.tracing.static_scene import StaticScene
from sim.tracing.wall_intersection import footprints_of
from sim.tracing.walls import ALIGNED, NoClosedForm, Walls, walls_of
from sim.worlds.world import World

LEAST_DIP = 1e-4  # of directions that meet the floor
BANDS = 2
STRETCHES = 2  # of a wall's texture, each averaged by itself: what is near fills more of an area than what is far


class AreaTracer:
    """Sees by areas.

    name, why: of this way of tracing, for reports
    light: what of it is followed
    basis: (component, band): what each component is worth in each band

    Raises:
        NoClosedForm: worlds that are not made of upright walls of one height on a grid, textures along two axes.
    """

    name = "areas"
    light = lighting.DIRECT
    scene = None

    def __init__(self, world: World, static: StaticScene, wavelengths: np.ndarray) -> None:
        walls = walls_of(world.model, static.geoms)
        if np.ptp(walls.top) > ALIGNED if len(walls) else False:
            raise NoClosedForm("walls of several heights")
        self._walls, self._bodies = walls, static.bodies
        self._lights = lighting.directional_lights(static.scene, wavelengths)
        if any(source.direction[2] <= 0 for source in self._lights):
            raise NoClosedForm("a light shines from below")
        footprints = footprints_of(walls)
        self.why = f"{len(walls)} upright walls, {footprints.how}"
        self._columns = Columns(walls, footprints)
        self._shadows = WallShadows(walls, [source.direction for source in self._lights])
        geoms, place = np.unique(walls.geoms, return_inverse=True)
        bsdfs = [*(static.bsdfs[int(g)] for g in geoms), *static.spheres.bsdfs]
        atlas = bake(world.model, [*geoms, *static.spheres.geoms], bsdfs, wavelengths)
        if not atlas.one_dimensional:
            raise NoClosedForm("a texture that changes along two axes")
        irradiance = np.array([source.irradiance for source in self._lights]).reshape(-1, len(wavelengths))
        self._components: Components = components_of(atlas.texels, irradiance)
        self.basis = self._components.basis
        self._stripes = Stripes(self._components.reflectance, atlas.places[:, :2])
        self._sphere_textures = _sphere_textures(atlas, len(geoms), static)
        floor = face_rows(walls.uv[-1:], atlas, place[-1:])[0]
        self._floor_row = [*floor[:4], *floor[8:10]]
        tables = {
            "faces": _faces(walls, atlas, place),
            **footprints.tables,
            **self._columns.tables,
            **self._shadows.tables,
            **self._stripes.tables,
        }
        self.inputs = {name: mi.Float(np.ascontiguousarray(table, np.float32)) for name, table in tables.items()}

    def radiance(self, area: Area, agent: Array, centres: list[Array], inputs: dict[str, Array]) -> list[Array]:
        """Mean of what comes out of each area, one array per component; agent, centres: of the spheres that move."""
        bodies = [*centres, agent]
        n = len(self.basis)
        nothing = [0.0] * n
        pieces = self._columns.pieces(area, inputs)
        seen = [
            only_where(piece.beside > 0, lambda piece=piece: self._wall(area, piece, bodies, inputs), nothing)
            for piece in pieces
        ]
        below = pieces[0].below + pieces[1].below
        seen.append(only_where(below > 0, lambda: self._floor(area, pieces, bodies, inputs), nothing))
        spheres = [
            only_where(
                sphere_areas.may_see(area, centre, float(radius)),
                lambda k=k: self._sphere(area, k, bodies, inputs),
                [0.0, *nothing],
            )
            for k, (centre, radius) in enumerate(zip(centres, self._bodies.radii, strict=False))
        ]
        distances = [dr.squared_norm(centre - area.origin) for centre in centres]
        visible, behind = sphere_areas.hidden_behind([share for share, *_ in spheres], distances)
        total = [behind * sum(parts[1:], parts[0]) for parts in zip(*seen, strict=True)]
        for share, (_, *light) in zip(visible, spheres, strict=True):
            total = [dr.fma(share, own, rest) for own, rest in zip(light, total, strict=True)]
        return total

    def _wall(self, area: Area, piece: Piece, bodies: list[Array], inputs: dict[str, Array]) -> list[Array]:
        patch = piece.patch(area, self._walls.floor, self._columns.top)
        row = dr.gather(mi.Vector4f, inputs["faces"], 2 * piece.face)
        place = dr.gather(mi.Vector2f, inputs["faces"], 4 * piece.face + 2)
        steps = [piece.start + (piece.end - piece.start) * (i / STRETCHES) for i in range(STRETCHES + 1)]
        ends = []
        for step in steps:
            at = piece.place(area, step)
            ends.append(row.x * at.x + row.y * at.y + row.z * patch.point.z + row.w)
        spread = dr.abs(row.z * patch.across.z)
        reflectance = self._stripes.mean(Texture(place.x, place.y), ends, spread, inputs)
        light = self._irradiance(patch, bodies, inputs)
        return [piece.beside * r * e for r, e in zip(reflectance, light, strict=True)]

    def _floor(
        self, area: Area, pieces: tuple[Piece, Piece], bodies: list[Array], inputs: dict[str, Array]
    ) -> list[Array]:
        """In bands of the same height, which lie the further apart the nearer they are to the horizon."""
        share = pieces[0].below + pieces[1].below
        a = sum(piece.middle * piece.below for piece in pieces) / dr.maximum(share, LEAST_DIP)
        total = [mi.Float(0) for _ in self.basis]
        for band in range(BANDS):
            below = area.height * (0.5 - share * ((band + 0.5) / BANDS))
            dip = dr.maximum(below - area.up, LEAST_DIP)
            patch = self._floor_patch(area, a, dip, area.height * share / BANDS)
            light = zip(self._floor_reflectance(patch, inputs), self._irradiance(patch, bodies, inputs), strict=True)
            total = [dr.fma(r, e, sum_) for (r, e), sum_ in zip(light, total, strict=True)]
        return [sum_ * share / BANDS for sum_ in total]

    def _floor_patch(self, area: Area, a: Array, dip: Array, height: Array) -> Patch:
        """The floor in a band of the visual field of this height, its middle at column a and so far down."""
        t = (area.origin.z - self._walls.floor) / dip
        level, across = area.level(a), area.level(a) * (t / dip * height)
        point = area.origin + mi.Vector3f(level.x, level.y, -dip) * t
        along = mi.Vector3f(area.right.x, area.right.y, 0) * t
        return Patch(point, mi.Normal3f(0, 0, 1), along, mi.Vector3f(across.x, across.y, 0))

    def _floor_reflectance(self, patch: Patch, inputs: dict[str, Array]) -> list[Array]:
        per_x, per_y, _, at, *texture = map(float, self._floor_row)
        column = per_x * patch.point.x + per_y * patch.point.y + at
        along, across = (per_x * side.x + per_y * side.y for side in (patch.along, patch.across))
        return self._stripes.mean_over(Texture(*texture), column, (along, across), inputs)

    def _sphere(self, area: Area, k: int, bodies: list[Array], inputs: dict[str, Array]) -> list[Array]:
        """Its share of the area, and the light that comes from there per component."""
        texture, radius = self._sphere_textures[k], float(self._bodies.radii[k])
        view = sphere_areas.SphereView(area, bodies[k], radius)

        def add(index: Array, share: Array, total: list[Array]) -> tuple[Array, Array, list[Array]]:
            part = view.part(index)
            column, sides = sphere_areas.columns_of(texture, part.patch, radius)
            reflectance = self._stripes.mean_over(texture.texture, column, sides, inputs)
            light = zip(reflectance, self._irradiance(part.patch, bodies, inputs, k), strict=True)
            total = [dr.fma(part.share, r * e, sum_) for (r, e), sum_ in zip(light, total, strict=True)]
            return index + 1, share + part.share, total

        start = mi.UInt32(0), mi.Float(0), [mi.Float(0) for _ in self.basis]
        _, share, total = dr.while_loop(start, lambda index, share, total: index < view.count, add, label="parts")
        return [share, *(sum_ / dr.maximum(share, LEAST_DIP) for sum_ in total)]

    def _irradiance(self, patch: Patch, bodies: list[Array], inputs: dict[str, Array], itself: int = -1) -> list[Array]:
        """Per component: sum over the lights of level · cos θ · share that is lit."""
        levels = self._components.levels
        directions = [list(map(float, source.direction)) for source in self._lights]
        lit = self._shadows.lit(patch, directions, inputs)
        total = [mi.Float(0) for _ in range(levels.shape[1])]
        for k, (centre, radius) in enumerate(zip(bodies, self._bodies.radii, strict=True)):
            if k != itself:
                past = lit_past_sphere(patch, directions, centre, float(radius))
                lit = [share * other for share, other in zip(lit, past, strict=True)]
        for direction, level, share in zip(directions, levels, lit, strict=True):
            share *= dr.maximum(dr.dot(patch.normal, mi.Vector3f(*direction)), 0)
            total = [dr.fma(share, float(factor), sum_) for factor, sum_ in zip(level, total, strict=True)]
        return total


def _faces(walls: Walls, atlas: Atlas, place: np.ndarray) -> np.ndarray:
    """Per face, in eights: column of the texel as an affine function of (x, y, z), first texel and columns of the
    texture; the floor's rim has any texture, since none of it is seen."""
    rows = face_rows(walls.uv, atlas, place)
    found = np.zeros((len(rows) - 1 + RIM, 8))
    found[: len(rows) - 1, :4], found[: len(rows) - 1, 4:6] = rows[:-1, :4], rows[:-1, 8:10]
    found[len(rows) - 1 :, 5] = 1
    return found.ravel()


def _sphere_textures(atlas: Atlas, first: int, static: StaticScene) -> list[SphereTexture]:
    return [
        SphereTexture(
            Texture(*map(float, atlas.places[first + k, :2])), atlas.to_texels[first + k][0], static.spheres.frames[k]
        )
        for k in range(len(static.spheres))
    ]
