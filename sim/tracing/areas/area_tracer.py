"""A tracer that averages light over areas of the visual field, in worlds of upright walls, a floor and spheres.

An area is a rectangle of the visual field. The parts of floor, walls, sky and spheres that are visible in an area are
its patches. A surface's texture is averaged over its patch in closed form, so there is no noise. Each light is
multiplied by the fraction of the patch that it reaches. Spectra are sums of a few components. These components and the
surfaces' reflectances are taken from the ray tracer `sim.tracing.closed_form_tracer`.
"""

from __future__ import annotations

from functools import partial

import drjit as dr
import mitsuba as mi
import numpy as np

from optics.numerics.autodiff import Array
from sim.eyes.depth_layers import ONE_PSF, DepthLayers
from sim.scene.device_arrays import floats
from sim.tracing import lighting
from sim.tracing.areas import sphere_areas
from sim.tracing.areas.body_light import BodyLight, LitSphere
from sim.tracing.areas.branches import only_where
from sim.tracing.areas.columns import RIM, Columns, Piece
from sim.tracing.areas.distances import LEAST_DIP, distances_to_floor, distances_to_wall
from sim.tracing.areas.illumination import AreaTables, FrameState, Illumination
from sim.tracing.areas.light_table import LightTable
from sim.tracing.areas.patch import Area, Patch
from sim.tracing.areas.sphere_areas import Slice, SphereTexture, SphereView, Strip
from sim.tracing.areas.stripes import Stripes, Texture
from sim.tracing.closed_form_tracer import ClosedForm
from sim.tracing.spheres import SphereRows, centres_in
from sim.tracing.walls import ALIGNED, NoClosedForm

BANDS = 2  # horizontal bands into which the floor in an area is divided
# Number of equally wide parts of an area in which a wall's texture is averaged separately. It is more than 1, because
# the near part of a wall fills more of the area than a distant part of the same length.
STRETCHES = 2


class AreaTracer:
    """A tracer that averages light over areas, rectangles into which the visual field is divided.

    rays: tracer of single rays, which defines the world and the light
    name, why: name of the tracer, and the reason for its choice, for reports
    light: level of light, one of `lighting.LEVELS`
    basis: (component, band): contribution of each component of the light's spectrum to each band

    Raises:
        NoClosedForm: the walls have several heights, overlap or lie on no grid, a texture changes along two axes, or a
            shadow is longer than a cell of the grid. If light is reflected more than once, there are two more reasons:
            there are no walls, or there are too many cells between the walls.
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
        self.why, self.light, self.basis, self._medium = rays.why, rays.light, rays.basis, rays.medium
        self._walls = walls
        self._columns = Columns(walls, rays.footprints)
        self._illumination = Illumination(rays, bodies.radii)
        self._reflected = None
        if rays.light != lighting.DIRECT:
            self._reflected = LightTable(rays, bodies.radii, world.heights)
        rows = np.concatenate([rays.faces[:, :4], rays.faces[:, 8:10]], axis=1)
        spheres = [place[:2] for _, place in rays.sphere_textures]
        places = np.unique(np.concatenate([rows[:, 4:], np.reshape(spheres, (-1, 2))]), axis=0)
        self._stripes = Stripes(rays.components.reflectance, places)
        self._sphere_textures = [
            SphereTexture(self._stripes.texture(*place[:2]), to_texels[0], frame)
            for (to_texels, place), frame in zip(rays.sphere_textures[:n_seen], bodies.frames, strict=False)
        ]
        *self._floor_column, first, columns = map(float, rows[-1])
        self._floor_texture = self._stripes.texture(first, columns)
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
        faces: tuple[Array, Array],
        now: FrameState,
        depth: DepthLayers = ONE_PSF,
    ) -> list[Array]:
        """Return the mean radiance in each area, one array per component, for each depth layer.

        faces: indices of the walls' faces at the area's left and right border, see `border_faces`
        """
        nothing = [0.0] * (depth.count * len(self.basis))
        pieces = self._columns.pieces(area, faces, now.inputs.face_ends)
        seen = [
            only_where(piece.wall_share > 0, partial(self._wall, area, piece, now, depth), nothing) for piece in pieces
        ]
        floor = partial(self._floor, area, pieces, now, depth)
        seen.append(only_where(pieces[0].floor_share + pieces[1].floor_share > 0, floor, nothing))
        spheres = []
        for k, centre in enumerate(self._visible_bodies(now)):
            in_view = sphere_areas.may_see(area, centre, self._radii[k])
            sphere = partial(self._sphere, area, k, pieces, now, depth)
            spheres.append(only_where(in_view, sphere, [0.0] * 3 + nothing))
        parts = pieces[0].wall_share, pieces[1].wall_share, pieces[0].floor_share + pieces[1].floor_share
        total = [mi.Float(0) for _ in nothing]
        for part, light, *hidden in zip(parts, seen, *(sphere[:3] for sphere in spheres), strict=True):
            left = dr.clip(1 - sum(hidden, mi.Float(0)) / dr.maximum(part, LEAST_DIP), 0, 1)
            total = [dr.fma(left, own, sum_) for own, sum_ in zip(light, total, strict=True)]
        found = [sum(own, rest) for rest, *own in zip(total, *(sphere[3:] for sphere in spheres), strict=True)]
        if self._medium is None:
            return found
        # Surfaces contributed their contrast with the veiling light, which is now added to the first depth layer.
        return [own + veil for own, veil in zip(found, self._medium.veil, strict=False)] + found[len(self.basis) :]

    def first_faces(self, origin: Array, level: Array, inputs: AreaTables) -> Array:
        """Return the index of the first wall face that a ray hits; level: the ray's horizontal direction (Vector2f)."""
        return self._columns.first_faces(origin, level, inputs.cells)

    def border_faces(self, area: Area, inputs: AreaTables) -> tuple[Array, Array]:
        """Return the indices of the wall faces visible at the left and right border of an area of the visual field."""
        left, right = (self.first_faces(area.origin, area.level(mi.Float(a)), inputs) for a in (-0.5, 0.5))
        return left, right

    def buffers(self, n_envs: int) -> SphereRows:
        """Return a buffer for the centres of the spheres in `n_envs` worlds."""
        return self.rays.buffers(n_envs)

    def bodies(self, rows: Array, world: Array, stand: Array) -> list[Array]:
        """Return all bodies' centres in the worlds with these indices; stand: position of the body with the eyes."""
        return self.rays.all_bodies(centres_in(rows, len(self.rays.world.spheres), world), stand)

    @property
    def places(self) -> int:
        """Number of rows for one world in the table of the light on bodies; 0 if only direct light is traced."""
        return self._illumination.bodies.nodes_per_body_set if self._reflected else 0

    def body_light(self, place: Array, bodies: list[Array], inputs: AreaTables) -> list[Array]:
        """Return the light at places on the bodies; place, bodies, result: see `IlluminatedBodies.table`."""
        assert self._reflected
        assert inputs.reflected
        reflected = partial(self._reflected.on_body, tables=inputs.reflected)
        return self._illumination.bodies.table(place, bodies, inputs.around, reflected)

    def _wall(self, area: Area, piece: Piece, now: FrameState, depth: DepthLayers) -> list[Array]:
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
        sent_on = [piece.wall_share * r * e for r, e in zip(reflectance, light, strict=True)]
        if self._medium is not None:
            sent_on = self._medium.contrasts(sent_on, distances_to_wall(area, piece, patch), piece.wall_share)
        return _in_layers(depth, piece.inverse_distance_at(piece.middle), sent_on)

    def _floor(self, area: Area, pieces: tuple[Piece, Piece], now: FrameState, depth: DepthLayers) -> list[Array]:
        """Return the floor's light in a rectangle of the visual field, summed over horizontal bands of equal height."""
        share = pieces[0].floor_share + pieces[1].floor_share
        a = sum(piece.middle * piece.floor_share for piece in pieces) / dr.maximum(share, LEAST_DIP)

        def add(index: Array, total: list[Array]) -> tuple[Array, list[Array]]:
            below = area.height * (0.5 - share * ((mi.Float(index) + 0.5) / BANDS))
            dip = dr.maximum(below - area.up, LEAST_DIP)
            patch = self._floor_patch(area, a, dip, area.height * share / BANDS)
            light = self._illumination.irradiance(patch, now)
            if self._reflected and now.inputs.reflected:
                arriving = self._reflected.on_floor(patch, now.inputs.reflected)
                light = _sum(light, self._illumination.past_bodies(patch, arriving, now))
            reflectance, above = self._floor_reflectance(patch, now), area.origin.z - self._walls.floor
            if self._medium is not None:
                distances = distances_to_floor(area, a, dip, area.height * share / BANDS, above)
                light, reflectance = self._medium.reflected_contrasts(reflectance, light, distances)
            layers = _in_layers(depth, dip / above, light)
            sent_on = zip(reflectance * depth.count, layers, strict=True)
            return index + 1, [dr.fma(r, e, sum_) for (r, e), sum_ in zip(sent_on, total, strict=True)]

        start = mi.UInt32(0), [mi.Float(0) for _ in range(depth.count * len(self.basis))]
        _, total = dr.while_loop(start, lambda index, total: index < BANDS, add, label="bands")
        return [sum_ * share / BANDS for sum_ in total]

    def _floor_patch(self, area: Area, a: Array, dip: Array, height: Array) -> Patch:
        """Return the part of the floor seen in a horizontal band; a, dip, height: see `distances_to_floor`."""
        t = (area.origin.z - self._walls.floor) / dip
        level, across = area.level(a), area.level(a) * (t / dip * height)
        point = area.origin + mi.Vector3f(level.x, level.y, -dip) * t
        along = mi.Vector3f(area.right.x, area.right.y, 0) * t
        return Patch(point, mi.Normal3f(0, 0, 1), along, mi.Vector3f(across.x, across.y, 0))

    def _floor_reflectance(self, patch: Patch, now: FrameState) -> list[Array]:
        per_x, per_y, _, at = self._floor_column
        column = per_x * patch.point.x + per_y * patch.point.y + at
        along, across = (per_x * side.x + per_y * side.y for side in (patch.along, patch.across))
        return self._stripes.mean_over(self._floor_texture, column, (along, across), now.inputs.stripes)

    def _sphere(
        self, area: Area, k: int, pieces: tuple[Piece, Piece], now: FrameState, depth: DepthLayers
    ) -> list[Array]:
        """Return the fractions of the area in which a sphere hides left wall, right wall and floor, then its light.

        The light, one array per depth layer and component of its spectrum, is multiplied by the fraction of the area
        that the sphere fills. Parts of the sphere that nearer spheres hide are omitted.
        """
        view = SphereView(area, now.bodies[k], self._radii[k])
        light = BodyLight.on_patch(self._illumination, k, view.whole().patch, now)
        sphere = LitSphere(k, view, light, now, depth)

        def add(number: Array, hidden: list[Array], total: list[Array]) -> tuple[Array, ...]:
            strip = view.strip(number)
            behind = [self._columns.behind(area, piece, strip.part) for piece in pieces]
            found = behind[0].wall_share, behind[1].wall_share, behind[0].floor_share + behind[1].floor_share
            bare, *sent_on = self._strip(area, sphere, strip)
            hidden = [dr.fma(own, bare, sum_) for own, sum_ in zip(found, hidden, strict=True)]
            return number + 1, hidden, _sum(sent_on, total)

        start = mi.UInt32(0), [mi.Float(0)] * 3, [mi.Float(0) for _ in range(depth.count * len(self.basis))]
        _, hidden, total = dr.while_loop(start, lambda number, *_: number < view.sides, add, label="strips")
        return [*hidden, *total]

    def _strip(self, area: Area, sphere: LitSphere, strip: Strip) -> list[Array]:
        """Return the fraction of a strip of a sphere that nearer spheres do not hide, and the visible part's light.

        The light, one array per depth layer and component, is multiplied by the visible part's share of the area.
        """
        k, view, now, depth = sphere.number, sphere.view, sphere.now, sphere.depth
        texture = self._sphere_textures[k]

        def add(number: Array, total: list[Array]) -> tuple[Array, list[Array]]:
            slice_ = view.slice(strip, number)
            bare = self._not_hidden(area, k, slice_, now)
            column, sides = sphere_areas.columns_of(texture, slice_.patch, self._radii[k])
            reflectance = self._stripes.mean_over(texture.texture, column, sides, now.inputs.stripes)
            light = sphere.light.on(slice_.patch.normal)
            if self._medium is not None:
                light, reflectance = self._medium.reflected_contrasts(
                    reflectance, light, [dr.norm(slice_.patch.point - area.origin)]
                )
            layers = _in_layers(depth, slice_.inverse_distance(area), light)
            sent_on = [bare / mi.Float(view.sides)]
            sent_on += [slice_.share * bare * r * e for r, e in zip(reflectance * depth.count, layers, strict=True)]
            return number + 1, _sum(sent_on, total)

        start = mi.UInt32(0), [mi.Float(0)] * (1 + depth.count * len(self.basis))
        _, total = dr.while_loop(start, lambda number, _: number < view.sides, add, label="slices")
        return total

    def _not_hidden(self, area: Area, k: int, slice_: Slice, now: FrameState) -> Array:
        """Return the visible fraction of a slice of sphere k, if nearer spheres hide independent parts of the slice."""
        way = now.bodies[k] - area.origin
        bare = mi.Float(1)
        for j, other in enumerate(self._visible_bodies(now)):
            if j != k:
                towards = other - area.origin
                nearer = dr.squared_norm(towards) < dr.squared_norm(way)
                bare *= 1 - dr.select(nearer, sphere_areas.hidden_by(towards, self._radii[j], slice_), 0)
        return bare

    def _visible_bodies(self, now: FrameState) -> list[Array]:
        return now.bodies[: len(self._sphere_textures)]


def _in_layers(depth: DepthLayers, inverse_distance: Array, light: list[Array]) -> list[Array]:
    """Return light divided among depth layers; 1 / inverse_distance: the source's distance along the eye's axis."""
    if depth.count == 1:
        return light
    return [share * component for share in depth.shares(inverse_distance) for component in light]


def _in_eights(rows: np.ndarray) -> np.ndarray:
    """Return eight numbers per face, in a flat array, from which the kernel finds the texture at a point (x, y, z).

    If the first four are p, q, r and s, the column of the texture at this point is p x + q y + r z + s. The others are
    the index of the texture's first texel, its number of columns, and two zeros.
    """
    found = np.zeros((len(rows) + RIM, 8))
    found[: len(rows), :6] = rows
    found[len(rows) :, 5] = 1  # the floor's rim is invisible, so its texture is arbitrary
    return found.ravel()


def _sum(one: list[Array], other: list[Array]) -> list[Array]:
    return [a + b for a, b in zip(one, other, strict=True)]
