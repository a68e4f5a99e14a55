"""Worlds of upright walls, a floor and spheres, seen by whole areas instead of rays: in closed form, no noise.

What an area sees is shared out among floor, walls, sky and spheres; each surface's texture is averaged over its patch,
and each light is shut off by the shares that lie in shadow. Colours and components are those of
`sim.tracing.closed_form_tracer`, which follows rays through the same worlds.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import drjit as dr
import mitsuba as mi
import numpy as np

from optics.numerics.autodiff import Array
from sim.eyes.depth_layers import ONE_PSF, DepthLayers
from sim.scene.device_arrays import floats
from sim.tracing import lighting
from sim.tracing.areas import sphere_areas
from sim.tracing.areas.body_light import BodyLight
from sim.tracing.areas.branches import only_where
from sim.tracing.areas.columns import RIM, Columns, Piece
from sim.tracing.areas.illumination import AreaTables, Illumination, Moment
from sim.tracing.areas.light_table import LightTable
from sim.tracing.areas.patch import Area, Patch
from sim.tracing.areas.sphere_areas import Slice, SphereTexture, SphereView, Strip
from sim.tracing.areas.stripes import Stripes, Texture
from sim.tracing.closed_form_tracer import ClosedForm
from sim.tracing.spheres import SphereRows, centres_in
from sim.tracing.walls import ALIGNED, NoClosedForm

LEAST_DIP = 1e-4  # of directions that meet the floor
BANDS = 2
STRETCHES = 2  # of a wall's texture, each averaged by itself: what is near fills more of an area than what is far


@dataclass(frozen=True)
class _LitSphere:
    """A sphere as an area sees it. number: of the body · light: on it · depth: layers that its light is shared among"""

    number: int
    view: SphereView
    light: BodyLight
    now: Moment
    depth: DepthLayers


class AreaTracer:
    """Sees by areas.

    rays: the tracer of rays through the same world, for the same light

    name, why: of this way of tracing, for reports
    light: what of it is followed
    basis: (component, band): what each component is worth in each band

    Raises:
        NoClosedForm: walls of several heights or on no grid, and textures along two axes.
    """

    name = "areas"
    scene = None

    def __init__(self, rays: ClosedForm) -> None:
        world, self.rays = rays.world, rays
        walls, bodies, n_seen = rays.walls, world.bodies, len(world.spheres)
        self._radii = list(map(float, bodies.radii))
        if len(walls) and np.ptp(walls.top) > ALIGNED:
            raise NoClosedForm("walls of several heights")
        if not rays.one_dimensional:
            raise NoClosedForm("a texture that changes along two axes")
        self.why, self.light, self.basis = rays.why, rays.light, rays.basis
        self._walls = walls
        self._columns = Columns(walls, rays.footprints)
        self._illumination = Illumination(rays, bodies.radii)
        seen = slice(n_seen)
        self._reflected = None
        if rays.light != lighting.DIRECT:
            self._reflected = LightTable(rays, bodies.radii[seen], world.heights[seen])
        rows = np.concatenate([rays.faces[:, :4], rays.faces[:, 8:10]], axis=1)
        spheres = [place[:2] for _, place in rays.sphere_textures]
        places = np.unique(np.concatenate([rows[:, 4:], np.reshape(spheres, (-1, 2))]), axis=0)
        self._stripes = Stripes(rays.components.reflectance, places)
        self._sphere_textures = [
            SphereTexture(Texture(*map(mi.Float, place[:2].astype(float))), to_texels[0], frame)
            for (to_texels, place), frame in zip(rays.sphere_textures[:n_seen], bodies.frames, strict=False)
        ]
        *self._floor_column, first, columns = map(float, rows[-1])
        self._floor_texture = Texture(mi.Float(first), mi.Float(columns))
        self.inputs = AreaTables(
            floats(_in_eights(rows[:-1])),
            self._columns.face_ends,
            rays.footprints.tables,
            self._illumination.around,
            self._stripes.tables,
            self._reflected.tables if self._reflected else None,
        )

    def radiance(
        self,
        area: Area,
        met: tuple[Array, Array],
        now: Moment,
        depth: DepthLayers = ONE_PSF,
    ) -> list[Array]:
        """Mean of what comes out of each area, one array per component, for each depth layer.

        met: faces at the area's left and right border, see `met` and `met_by`
        """
        nothing = [0.0] * (depth.count * len(self.basis))
        pieces = self._columns.pieces(area, met, now.inputs.face_ends)
        seen = [only_where(piece.beside > 0, partial(self._wall, area, piece, now, depth), nothing) for piece in pieces]
        floor = partial(self._floor, area, pieces, now, depth)
        seen.append(only_where(pieces[0].below + pieces[1].below > 0, floor, nothing))
        spheres = []
        for k, centre in enumerate(self._seen_bodies(now)):
            in_view = sphere_areas.may_see(area, centre, self._radii[k])
            sphere = partial(self._sphere, area, k, pieces, now, depth)
            spheres.append(only_where(in_view, sphere, [0.0] * 3 + nothing))
        parts = pieces[0].beside, pieces[1].beside, pieces[0].below + pieces[1].below
        total = [mi.Float(0) for _ in nothing]
        for part, light, *hidden in zip(parts, seen, *(sphere[:3] for sphere in spheres), strict=True):
            left = dr.clip(1 - sum(hidden, mi.Float(0)) / dr.maximum(part, LEAST_DIP), 0, 1)
            total = [dr.fma(left, own, sum_) for own, sum_ in zip(light, total, strict=True)]
        return [sum(own, rest) for rest, *own in zip(total, *(sphere[3:] for sphere in spheres), strict=True)]

    def met(self, origin: Array, level: Array, inputs: AreaTables) -> Array:
        """Number of the wall's face that is met in a level direction (Vector2f)."""
        return self._columns.met(origin, level, inputs.cells)

    def met_by(self, area: Area, inputs: AreaTables) -> tuple[Array, Array]:
        """Of the faces at an area's left and right border."""
        left, right = (self.met(area.origin, area.level(mi.Float(a)), inputs) for a in (-0.5, 0.5))
        return left, right

    def buffers(self, n_envs: int) -> SphereRows:
        """For so many worlds."""
        return self.rays.buffers(n_envs)

    def bodies(self, rows: Array, world: Array, stand: Array) -> list[Array]:
        """Centres of the bodies in a lane's world; stand: where the eyes' own is."""
        return self.rays.all_bodies(centres_in(rows, len(self.rays.world.spheres), world), stand)

    @property
    def places(self) -> int:
        """Rows of a world's table of lit bodies; none where light that they reflect is not followed."""
        return self._illumination.bodies.places if self._reflected else 0

    def lit(self, place: Array, bodies: list[Array], inputs: AreaTables) -> list[Array]:
        """Rows of that table, at places of the worlds in which the bodies stand."""
        return self._illumination.bodies.table(place, bodies, inputs.around)

    def _wall(self, area: Area, piece: Piece, now: Moment, depth: DepthLayers) -> list[Array]:
        patch = piece.patch(area, self._walls.floor, self._columns.top)
        row = dr.gather(mi.Vector4f, now.inputs.faces, 2 * piece.face.index)
        place = dr.gather(mi.Vector2f, now.inputs.faces, 4 * piece.face.index + 2)
        steps = [piece.start + (piece.end - piece.start) * (i / STRETCHES) for i in range(STRETCHES + 1)]
        ends = []
        for step in steps:
            at = piece.place(area, step)
            ends.append(row.x * at.x + row.y * at.y + row.z * patch.point.z + row.w)
        spread = dr.abs(row.z * patch.across.z)
        reflectance = self._stripes.mean(Texture(place.x, place.y), ends, spread, now.inputs.stripes)
        light = self._illumination.irradiance(patch, now)
        if self._reflected and now.inputs.reflected:
            arriving = self._reflected.on_wall(patch, now.inputs.reflected)
            light = _sum(light, self._illumination.past_bodies(patch, arriving, now))
        sent_on = [piece.beside * r * e for r, e in zip(reflectance, light, strict=True)]
        return _in_layers(depth, piece.nearness_at(piece.middle), sent_on)

    def _floor(self, area: Area, pieces: tuple[Piece, Piece], now: Moment, depth: DepthLayers) -> list[Array]:
        """In bands of the same height, which lie the further apart the nearer they are to the horizon."""
        share = pieces[0].below + pieces[1].below
        a = sum(piece.middle * piece.below for piece in pieces) / dr.maximum(share, LEAST_DIP)

        def add(index: Array, total: list[Array]) -> tuple[Array, list[Array]]:
            below = area.height * (0.5 - share * ((mi.Float(index) + 0.5) / BANDS))
            dip = dr.maximum(below - area.up, LEAST_DIP)
            patch = self._floor_patch(area, a, dip, area.height * share / BANDS)
            light = self._illumination.irradiance(patch, now)
            if self._reflected and now.inputs.reflected:
                arriving = self._reflected.on_floor(patch, now.inputs.reflected)
                light = _sum(light, self._illumination.past_bodies(patch, arriving, now))
            reflectance = self._floor_reflectance(patch, now)
            layers = _in_layers(depth, dip / (area.origin.z - self._walls.floor), light)
            sent_on = zip(reflectance * depth.count, layers, strict=True)
            return index + 1, [dr.fma(r, e, sum_) for (r, e), sum_ in zip(sent_on, total, strict=True)]

        start = mi.UInt32(0), [mi.Float(0) for _ in range(depth.count * len(self.basis))]
        _, total = dr.while_loop(start, lambda index, total: index < BANDS, add, label="bands")
        return [sum_ * share / BANDS for sum_ in total]

    def _floor_patch(self, area: Area, a: Array, dip: Array, height: Array) -> Patch:
        """The floor in a band of the visual field of this height, its middle at column a and so far down."""
        t = (area.origin.z - self._walls.floor) / dip
        level, across = area.level(a), area.level(a) * (t / dip * height)
        point = area.origin + mi.Vector3f(level.x, level.y, -dip) * t
        along = mi.Vector3f(area.right.x, area.right.y, 0) * t
        return Patch(point, mi.Normal3f(0, 0, 1), along, mi.Vector3f(across.x, across.y, 0))

    def _floor_reflectance(self, patch: Patch, now: Moment) -> list[Array]:
        per_x, per_y, _, at = self._floor_column
        column = per_x * patch.point.x + per_y * patch.point.y + at
        along, across = (per_x * side.x + per_y * side.y for side in (patch.along, patch.across))
        return self._stripes.mean_over(self._floor_texture, column, (along, across), now.inputs.stripes)

    def _sphere(self, area: Area, k: int, pieces: tuple[Piece, Piece], now: Moment, depth: DepthLayers) -> list[Array]:
        """Shares of the area in which it hides either wall and the floor, and light that comes from it, per component,
        times its share; without what is hidden by nearer spheres."""
        view = SphereView(area, now.bodies[k], self._radii[k])
        light = BodyLight.of(self._illumination, self._reflected, k, view.whole().patch, now)
        sphere = _LitSphere(k, view, light, now, depth)

        def add(number: Array, hidden: list[Array], total: list[Array]) -> tuple[Array, ...]:
            strip = view.strip(number)
            behind = [self._columns.behind(area, piece, strip.part) for piece in pieces]
            found = behind[0].beside, behind[1].beside, behind[0].below + behind[1].below
            bare, *sent_on = self._strip(area, sphere, strip)
            hidden = [dr.fma(own, bare, sum_) for own, sum_ in zip(found, hidden, strict=True)]
            return number + 1, hidden, _sum(sent_on, total)

        start = mi.UInt32(0), [mi.Float(0)] * 3, [mi.Float(0) for _ in range(depth.count * len(self.basis))]
        _, hidden, total = dr.while_loop(start, lambda number, *_: number < view.sides, add, label="strips")
        return [*hidden, *total]

    def _strip(self, area: Area, sphere: _LitSphere, strip: Strip) -> list[Array]:
        """Share of a strip of a sphere before which no other stands, and light that comes from it, per component, times
        its share of the area."""
        k, view, now, depth = sphere.number, sphere.view, sphere.now, sphere.depth
        texture = self._sphere_textures[k]

        def add(number: Array, total: list[Array]) -> tuple[Array, list[Array]]:
            slice_ = view.slice(strip, number)
            bare = self._not_hidden(area, k, slice_, now)
            column, sides = sphere_areas.columns_of(texture, slice_.patch, self._radii[k])
            reflectance = self._stripes.mean_over(texture.texture, column, sides, now.inputs.stripes)
            layers = _in_layers(depth, slice_.vergence(area), sphere.light.on(slice_.patch.normal))
            sent_on = [bare / mi.Float(view.sides)]
            sent_on += [slice_.share * bare * r * e for r, e in zip(reflectance * depth.count, layers, strict=True)]
            return number + 1, _sum(sent_on, total)

        start = mi.UInt32(0), [mi.Float(0)] * (1 + depth.count * len(self.basis))
        _, total = dr.while_loop(start, lambda number, _: number < view.sides, add, label="slices")
        return total

    def _not_hidden(self, area: Area, k: int, slice_: Slice, now: Moment) -> Array:
        """Share of a slice before which no other sphere stands; as if others hid it at random, where several do."""
        way = now.bodies[k] - area.origin
        bare = mi.Float(1)
        for j, other in enumerate(self._seen_bodies(now)):
            if j != k:
                towards = other - area.origin
                nearer = dr.squared_norm(towards) < dr.squared_norm(way)
                bare *= 1 - dr.select(nearer, sphere_areas.hidden_by(towards, self._radii[j], slice_), 0)
        return bare

    def _seen_bodies(self, now: Moment) -> list[Array]:
        return now.bodies[: len(self._sphere_textures)]


def _in_layers(depth: DepthLayers, vergence: Array, light: list[Array]) -> list[Array]:
    """Light from the distance 1 / vergence along the eye's axis, shared out among depth layers."""
    if depth.count == 1:
        return light
    return [share * component for share in depth.shares(vergence) for component in light]


def _in_eights(rows: np.ndarray) -> np.ndarray:
    """Per face, in eights: column of the texel as an affine function of (x, y, z), first texel and columns of the
    texture; the floor's rim has any texture, since none of it is seen."""
    found = np.zeros((len(rows) + RIM, 8))
    found[: len(rows), :6] = rows
    found[len(rows) :, 5] = 1
    return found.ravel()


def _sum(one: list[Array], other: list[Array]) -> list[Array]:
    return [a + b for a, b in zip(one, other, strict=True)]
