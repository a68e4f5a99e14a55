"""A ray tracer in closed form for worlds of upright walls, a floor and spheres.

If there are only a few walls, they are intersected one by one. Otherwise, a ray walks through a grid in which each wall
fills whole cells (Amanatides and Woo 1987). Reflectances are computed by Mitsuba (`sim.tracing.reflectance_atlas`).
Light is traced in components. For a compound eye, and in a medium for any eye, each component is one spectral band.
Otherwise, there are fewer components if all lights share one spectrum and the materials' spectra are linear
combinations of a few spectra, which are then the components. After two reflections, the spectrum of light is a product
of two materials' spectra, so all bands are traced, unless all materials are grey and all lights share one spectrum.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from optics.numerics.autodiff import Array
from sim.scene.device_arrays import floats
from sim.tracing import lighting, spheres
from sim.tracing.eye_ray import EyeRay
from sim.tracing.light_components import components_in_bands, components_of, reflected_components_of
from sim.tracing.medium_on_rays import MediumOnRays
from sim.tracing.reflectance_atlas import Atlas, bake
from sim.tracing.spheres import SphereRows
from sim.tracing.upright_scene import UprightScene
from sim.tracing.wall_intersection import CellTables, Footprints, footprints_of
from sim.tracing.walls import ALIGNED, NoClosedForm

# Distance at which shadow rays and bounce rays start, relative to Mitsuba's. Mitsuba's distance, 3 mm in a maze, would
# shift the shadow of a body next to a wall by this amount. Closed forms have smaller rounding errors than meshes.
CLEARANCE = 1 / 16
Irradiance = Callable[[Array, Array], list[Array]]  # function (point, normal) of a surface: irradiance per component
ROW = 12  # floats per face: affine functions of (x, y, z) for the texel's column and row, then the texture's place


@dataclass(frozen=True)
class _Hit:
    """First hits of rays.

    t: distance to the hit [m]; infinite without a hit
    point, normal: hit point, and normal of the surface
    is_lit: True if a ray hits the front of a surface
    reflectance: reflectance at the hit, one array per component
    """

    t: Array
    point: Array
    normal: Array
    is_lit: Array
    reflectance: list[Array]


@dataclass(frozen=True)
class ClosedFormTables:
    """Arrays that are the same in all worlds.

    texels: reflectance, one array per component
    faces: see `face_rows`
    cells: grid in which the walls stand; None: walls are intersected one by one
    """

    texels: list[Array]
    faces: Array
    cells: CellTables | None


@dataclass(frozen=True)
class ClosedFormSurroundings:
    """Surfaces that the rays of one world can hit: its spheres, and the walls and floor that all worlds share.

    centres, tables: centres of visible spheres (Point3f), and arrays that are the same in all worlds
    """

    centres: list[Array]
    tables: ClosedFormTables


class ClosedForm:
    """A tracer of rays through one scene of upright walls, a floor and spheres.

    wavelengths: centres of the eye's bands [m]
    name, why: name of the tracer, and the reason for its choice, for reports
    light: how often light is reflected: "direct" (once), "bounce" (up to twice) or "all" (any number of times)
    basis: contribution of each component of the light to each band, (component, band)
    world, walls, lights: the argument `scene`, its walls and its lights
    footprints, components: method of intersecting walls; bands, or spectra of fixed shape, in which light is traced
    medium: water or air between surfaces and eyes; None: clear air
    faces: textures of walls and floor, see `face_rows`
    sphere_textures: for each sphere that rays can hit, the map from texture coordinates to texels, and the place of its
        texture in the table of all texels

    Raises:
        NoClosedForm: there are many walls, and some overlap or do not fit a grid. There are further reasons if light is
            reflected more than once: walls have several heights or are lower than a body, a body may move up or down,
            or the body that carries the eyes has a texture.
    """

    name = "closed_form"
    scene = None  # no Mitsuba scene is needed

    def __init__(self, scene: UprightScene, wavelengths: np.ndarray, light: str = lighting.DIRECT) -> None:
        self.light, self.walls, self.world = light, scene.walls, scene
        if light != lighting.DIRECT:
            _check_tops(scene)
        self.footprints: Footprints = footprints_of(self.walls)
        self.why = f"{len(self.walls)} upright walls, {self.footprints.how}"
        self._bodies, self.lights = scene.bodies, scene.lights
        geoms, place = np.unique(self.walls.geoms, return_inverse=True)
        visible = scene.spheres if light == lighting.DIRECT else scene.bodies
        bsdfs = [*(scene.bsdfs[int(g)] for g in geoms), *visible.bsdfs]
        atlas = bake(scene.model, [*geoms, *visible.geoms], bsdfs, wavelengths)
        irradiance = np.array([source.irradiance for source in self.lights]).reshape(-1, len(wavelengths))
        fewest = components_of if light == lighting.DIRECT else reflected_components_of
        medium = scene.medium
        self.components = (components_in_bands if scene.in_bands else fewest)(atlas.texels, irradiance)
        self.basis = self.components.basis
        self.medium = None if medium is None else MediumOnRays.from_bands(medium, self.basis)
        self.faces = face_rows(self.walls.uv, atlas, place)
        self._n_faces = len(self.walls.geoms)
        self.one_dimensional = atlas.one_dimensional
        self.sphere_textures = [
            (atlas.to_texels[len(geoms) + k], atlas.places[len(geoms) + k]) for k in range(len(visible))
        ]
        texels = self.components.reflectance.astype(np.float32)
        self.inputs = ClosedFormTables(
            [floats(np.ascontiguousarray(column)) for column in texels.T], floats(self.faces), self.footprints.tables
        )

    def buffers(self, n_envs: int) -> SphereRows:
        """Return a buffer for the centres of the visible spheres in `n_envs` worlds."""
        return SphereRows(self.world.spheres, n_envs)

    def around(self, scenes: None, rows: Array, tables: ClosedFormTables, world: Array) -> ClosedFormSurroundings:
        """Return the surfaces that a Dr.Jit lane's rays can hit: walls, floor, and visible spheres of its world."""
        return ClosedFormSurroundings(spheres.centres_in(rows, len(self.world.spheres), world), tables)

    def all_bodies(self, centres: list[Array], stand: Array) -> list[Array]:
        """Return the centres of the visible spheres and, if the body that carries the eyes is a sphere, its centre.

        centres, stand: centres of the visible spheres, and position of the body that carries the eyes
        """
        if not self.world.has_own:
            return centres
        return [*centres, mi.Point3f(stand.x, stand.y, float(self.world.heights[-1]))]

    def radiance(self, seen: EyeRay, there: ClosedFormSurroundings, samples: Array) -> tuple[list[Array], Array]:
        """Return each ray's light, one array per component (band or fixed spectrum), and distance to a surface [m]."""
        centres, tables = there.centres, there.tables
        bodies = self.all_bodies(centres, seen.body)
        hit = self._hit(seen.ray, centres, tables)
        light = self._irradiance(hit, bodies, tables)
        if self.light == lighting.BOUNCE:
            bounce_ray = lighting.spawn_bounce_ray(hit.point, hit.normal, samples.xy, CLEARANCE)
            second_hit = self._hit(bounce_ray, bodies, tables)
            second = zip(second_hit.reflectance, self._irradiance(second_hit, bodies, tables), strict=True)
            light = [dr.select(hit.is_lit, dr.fma(r, e, first), 0) for first, (r, e) in zip(light, second, strict=True)]
        sent = [r * e for r, e in zip(hit.reflectance, light, strict=True)]
        return sent if self.medium is None else self.medium.through(sent, hit.t), hit.t

    def returned(self, ray: Array, shade: Array, radius: float, more: Irradiance | None = None) -> list[Array]:
        """Return the light that walls and floor reflect to the rays' origins, per component (band or fixed spectrum).

        Walls and floor receive `more`, if given, and direct light that the sphere with centre `shade` does not block.
        """
        hit = self._hit(ray, [], self.inputs)
        light = self._irradiance(hit, [shade], self.inputs, [radius])
        if more:
            light = [e + other for e, other in zip(light, more(hit.point, hit.normal), strict=True)]
        return [dr.select(hit.is_lit, r * e, 0) for r, e in zip(hit.reflectance, light, strict=True)]

    def _hit(self, ray: Array, centres: list[Array], tables: ClosedFormTables) -> _Hit:
        """Return the hit of each ray with the nearest surface: a wall, the floor or a sphere.

        centres: centres of the scene's spheres; if there are fewer centres than spheres, rays ignore the last spheres
        """
        t, face, normal = self.footprints.hit(ray, tables.cells)
        on_floor, t_floor = self._floor_hit(ray)
        floor_first = on_floor & (t_floor < t)
        t = dr.select(floor_first, t_floor, t)
        seen = dr.isfinite(t)
        # Rays without a hit use the floor's face, which also exists in worlds without walls.
        face = dr.select(floor_first | ~seen, self._n_faces - 1, face)
        normal = dr.select(floor_first, mi.Normal3f(0, 0, 1), normal)
        t, which = spheres.nearest(self._bodies, centres, ray, t)
        on_sphere = which < len(centres)
        point = ray(dr.select(seen | on_sphere, t, 0))
        offset, columns, rows, x, y = self._face_texel(face, point, tables)
        if centres:
            surface, round_, uv = spheres.surface_at(self._bodies, centres, which, point)
            normal, point = dr.select(on_sphere, round_, normal), dr.select(on_sphere, surface, point)
            found = zip(self._sphere_texel(which, uv), (offset, columns, rows, x, y), strict=True)
            offset, columns, rows, x, y = (dr.select(on_sphere, mine, other) for mine, other in found)
        lit = (seen | on_sphere) & (t > 0) & (dr.dot(normal, ray.d) < 0)
        return _Hit(t, point, normal, lit, self._interpolate(offset, columns, rows, x, y, tables))

    def _floor_hit(self, ray: Array) -> tuple[Array, Array]:
        """Return whether a ray from above hits the floor, and the distance to the hit."""
        t = (self.walls.floor - ray.o.z) / ray.d.z
        lower, upper = self.walls.floor_lower, self.walls.floor_upper
        x, y = ray.o.x + t * ray.d.x, ray.o.y + t * ray.d.y
        inside = (x >= float(lower[0])) & (x <= float(upper[0])) & (y >= float(lower[1])) & (y <= float(upper[1]))
        return inside & (ray.d.z < 0) & (t > 0), t

    def _irradiance(
        self, hit: _Hit, bodies: list[Array], tables: ClosedFormTables, radii: list[float] | None = None
    ) -> list[Array]:
        """Return the irradiance at hits due to unobstructed lights, per component (band or spectrum of fixed shape).

        radii: radii of the bodies that cast shadows [m]; None: those of the scene
        """
        levels = self.components.levels
        start = lighting.clear_of(hit.point, hit.normal, CLEARANCE)
        radii = list(map(float, self._bodies.radii)) if radii is None else radii
        total = [mi.Float(0) for _ in range(levels.shape[1])]
        for light, level in zip(self.lights, levels, strict=True):
            towards = mi.Vector3f(*map(float, light.direction))
            shadow = mi.Ray3f(start, towards)
            cosine = dr.dot(hit.normal, towards)
            shines = hit.is_lit & (cosine > 0) & ~spheres.blocks(radii, bodies, shadow)
            shines &= ~self.footprints.blocks(start, light.direction, tables.cells)
            cosine = dr.select(shines, cosine, 0)
            total = [dr.fma(cosine, float(factor), sum_so_far) for factor, sum_so_far in zip(level, total, strict=True)]
        return total

    def _face_texel(self, face: Array, point: Array, tables: ClosedFormTables) -> tuple[Array, ...]:
        """Return a face's texture (first texel, number of columns, number of rows), and a point's column and row."""
        columns = dr.gather(mi.Vector4f, tables.faces, face * 3)
        place = dr.gather(mi.Vector4f, tables.faces, face * 3 + 2)
        x = _affine(columns, point)
        y = mi.Float(0)
        if not self.one_dimensional:
            y = _affine(dr.gather(mi.Vector4f, tables.faces, face * 3 + 1), point)
        return place.x, place.y, place.z, x, y

    def _sphere_texel(self, which: Array, uv: Array) -> tuple[Array, ...]:
        found: tuple[Array, ...] = tuple(mi.Float(0) for _ in range(5))
        for k, (to_texels, place) in enumerate(self.sphere_textures):
            column, row = (float(a) * uv.x + float(b) * uv.y + float(c) for a, b, c in to_texels)
            mine = (*(mi.Float(float(p)) for p in place), column, row)
            found = tuple(dr.select(which == k, a, b) for a, b in zip(mine, found, strict=True))
        return found

    def _interpolate(
        self, offset: Array, columns: Array, rows: Array, x: Array, y: Array, tables: ClosedFormTables
    ) -> list[Array]:
        """Return bilinearly interpolated reflectance of a repeating texture, per component (band or fixed spectrum)."""
        x0, x1, fx = _neighbours(x, columns)
        n = self.components.reflectance.shape[1]
        taps = [(offset, x0, 1 - fx), (offset, x1, fx)]
        if not self.one_dimensional:
            y0, y1, fy = _neighbours(y, rows)
            taps = [(first + r * columns, c, wx * wy) for first, c, wx in taps for r, wy in ((y0, 1 - fy), (y1, fy))]
        index = [(mi.UInt32(first + column), weight) for first, column, weight in taps]
        return [sum(w * dr.gather(mi.Float, tables.texels[k], i) for i, w in index) for k in range(n)]


def _check_tops(scene: UprightScene) -> None:
    """Refuse scenes if light may hit a wall's top, a body may move up or down, or the eyes' body has a texture."""
    for geom, settled in zip(scene.bodies.geoms, scene.settled, strict=True):
        if not settled:
            raise NoClosedForm(f"geom {scene.model.geom(geom).name or str(geom)!r} may change its height")
    if scene.has_own and scene.bodies.textured[-1]:
        name = scene.model.geom(scene.bodies.geoms[-1]).name
        raise NoClosedForm(f"geom {name!r}, on which the eyes are, has a texture, which would have to turn with it")
    bodies = scene.heights + scene.bodies.radii
    lowest = scene.walls.top.min(initial=np.inf)
    highest = max(scene.walls.top.max(initial=-np.inf), bodies.max(initial=-np.inf))
    if highest > lowest + ALIGNED:
        raise NoClosedForm(f"light that is reflected twice would reach the top of a wall {lowest:.2g} m high")


def face_rows(uv: np.ndarray, atlas: Atlas, place: np.ndarray) -> np.ndarray:
    """Return a row of 12 numbers for each face, from which the texel at a point is computed.

    A row contains two affine functions for the texel's column and row at a point (x, y, z, 1), the index of the
    texture's first texel, the texture's numbers of columns and rows, and an unused 0.

    uv: matrices (2, 4) from points of each face to texture coordinates, (face, 2, 4)
    place: index of each face's texture in the atlas, (face,)
    """
    rows = np.zeros((len(uv), ROW))
    for i, (affine, texture) in enumerate(zip(uv, place, strict=True)):
        to_texel = atlas.to_texels[texture] @ np.vstack([affine, [0, 0, 0, 1]])
        rows[i] = [*to_texel.ravel(), *atlas.places[texture], 0]
    return rows


def _affine(row: Array, point: Array) -> Array:
    return dr.fma(row.x, point.x, dr.fma(row.y, point.y, dr.fma(row.z, point.z, row.w)))


def _neighbours(x: Array, n: Array) -> tuple[Array, Array, Array]:
    """Return the two whole numbers around x, modulo n, and the distance of x from the first."""
    whole = dr.floor(x)
    first = dr.clip(whole - n * dr.floor(whole / n), 0, n - 1)
    second = dr.select(first + 1 >= n, 0, first + 1)
    return first, second, x - whole
