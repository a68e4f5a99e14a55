"""A tracer of rays through any model: Mitsuba intersects static geoms, `sim.tracing.movers` the moving ones.

Direct light comes from lamps only. With bounced light (`sim.tracing.lighting`), a bounce ray leaves every visible
surface. It collects light that a second surface reflects or emits, or light of the sky. If there is a sky or a glowing
geom, another ray leaves the second surface and collects their light. Light is thus reflected at most twice.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from optics.numerics.autodiff import Array
from sim.scene.device_arrays import SharedBuffer, whole_numbers
from sim.scene.poses import Poses
from sim.scene.variant import MitsubaObject, computed
from sim.scene.variant import variant as in_variant
from sim.tracing import lighting
from sim.tracing.eye_ray import EyeRay
from sim.tracing.medium_on_rays import MediumOnRays
from sim.tracing.model_lights import ROWS as LIGHT_ROWS
from sim.tracing.model_scene import ModelScene
from sim.tracing.movers import MoverRows
from sim.tracing.paint import PaintRows
from sim.tracing.world_rows import WorldRows


@dataclass(frozen=True)
class Scenes:
    """Mitsuba scenes of the static geoms and the sky, and of the moving meshes (`MeshAtlas`), if there are any."""

    still: MitsubaObject
    meshes: MitsubaObject | None


@dataclass(frozen=True)
class Tables:
    """Arrays that are the same in all worlds. A moving geom is one "mover" for each material that it may have.

    bsdfs, painted: each mover's BSDF, and its geom's index among geoms whose colour differs between worlds (`Paint`)
    ends: for each kind of geom, such as spheres, the index of its first mover; the number of movers comes last
    sky, glows: the sky's emitter; BSDFs that yield the radiance of glowing geoms as a reflectance (each None if absent)
    glowing: for each mover, its index in `glows`, or len(glows) if it does not glow; None if no geom glows
    """

    bsdfs: Array
    ends: Array
    painted: Array
    sky: Array | None = None
    glowing: Array | None = None
    glows: Array | None = None


@dataclass(frozen=True)
class Rows:
    """Arrays with the poses of moving geoms, the poses of lights, and the colours of geoms, in all worlds."""

    movers: Array
    lights: Array
    paint: Array


@dataclass(frozen=True)
class Surroundings:
    """All that a ray can meet in its world. All worlds share the static geoms (`still`) and the arrays in `tables`."""

    still: MitsubaObject
    movers: MoverRows
    lights: WorldRows
    paint: PaintRows
    tables: Tables


class RowBuffers:
    """Buffers from which kernels read poses of moving geoms and lights, and colours of geoms, in `n_envs` worlds."""

    def __init__(self, scene: ModelScene, n_envs: int) -> None:
        self._scene = scene
        sizes = scene.movers.n_rows, max(len(scene.lights), 1) * LIGHT_ROWS, scene.paint.n_rows
        self._shared = [SharedBuffer(n_envs * n * 4) for n in sizes]
        self._movers, self._lights, self._paint = (shared.values.reshape(n_envs, -1) for shared in self._shared)

    def fill(self, poses: Poses) -> None:
        """Write the poses of moving geoms and lights, and the colours of geoms, in all worlds into the buffers."""
        scene = self._scene
        self._movers[:] = scene.movers.rows(poses)
        if len(scene.paint):
            with in_variant(scene.variant):
                self._paint[:] = scene.paint.rows(poses)
        if len(scene.lights):
            self._lights[:] = scene.lights.rows(poses).reshape(poses.n, -1)

    def arrays(self) -> Rows:
        """Return the buffers as arrays on the device."""
        return Rows(*(shared.array for shared in self._shared))


@dataclass(frozen=True)
class _SurfaceHit:
    """First hits of rays.

    si, bsdf: Mitsuba's description of the hit, and the BSDF of the hit surface, which is evaluated with it
    colors, glow: factors by which the surface's reflectance and its emission are multiplied, spectra of 4 bands each
    which: index of the hit moving geom in `Movers`, or len(Movers) if the ray hits no moving geom
    seen, active: seen is True for rays that hit a surface, active is True for rays that are traced
    point, normal, t, direction: hit point, normal towards the ray's origin, distance [m], and direction of the ray
    """

    si: Array
    bsdf: Array
    colors: list[Array]
    glow: list[Array]
    which: Array
    seen: Array
    active: Array
    point: Array
    normal: Array
    t: Array
    direction: Array


class ModelTracer:
    """A tracer of rays through any MuJoCo model. Surfaces are Lambertian. Each hit of a ray samples every lamp once.

    name, why: name of the tracer, and the reason for its choice, for reports
    light: how often light is reflected: "direct" (once) or "bounce" (up to twice); ValueError for "all"
    basis: identity matrix (component, band), because the light is traced in components that are single bands
    """

    name = "mitsuba"

    def __init__(self, scene: ModelScene, light: str = lighting.DIRECT, why: str = "requested") -> None:
        if light == lighting.ALL:
            raise ValueError("light = 'all': rays follow at most two reflections, see samples = 'areas'")
        self._scene, self._bands, self.light = scene, lighting.spectra(scene.wavelengths), light
        self.why, self.basis = why, np.eye(len(scene.wavelengths))
        self._medium = None if scene.medium is None else MediumOnRays.from_bands(scene.medium, self.basis)
        self.scene = Scenes(scene.still, scene.movers.atlas.scene)
        shapes = scene.still.shapes()
        self._any_still = len(shapes) > 0
        # Never empty: a recording includes the BSDFs' textures only if a BSDF is among the inputs.
        known = [*(scene.bsdfs[look] for look in scene.movers.looks), *(shape.bsdf() for shape in shapes[:1])]
        sky = mi.EmitterPtr([scene.still.environment()]) if scene.has_sky else None
        self.inputs = Tables(mi.BSDFPtr(known), scene.movers.ends, scene.paint.painted, sky, *self._of_glows())

    def _of_glows(self) -> tuple[Array | None, Array | None]:
        scene = self._scene
        if not scene.glows:
            return None, None
        number = {look: k for k, look in enumerate(scene.glows)}
        of_movers = [number.get(look, len(number)) for look in scene.movers.looks]
        return whole_numbers([*of_movers, len(number)]), mi.BSDFPtr(list(scene.glows.values()))

    def buffers(self, n_envs: int) -> RowBuffers:
        """Return buffers for the poses of moving geoms and lights, and the colours of geoms, in `n_envs` worlds."""
        return RowBuffers(self._scene, n_envs)

    def around(self, scenes: Scenes, rows: Rows, tables: Tables, world: Array) -> Surroundings:
        """Return all that rays can meet, given the index of each ray's world."""
        sizes = self._scene.movers.n_rows, max(len(self._scene.lights), 1) * LIGHT_ROWS, self._scene.paint.n_rows
        movers, lights, paint = (world * n for n in sizes)
        return Surroundings(
            scenes.still,
            MoverRows(rows.movers, movers, tables.ends),
            WorldRows(rows.lights, lights),
            PaintRows(rows.paint, paint, tables.painted),
            tables,
        )

    def radiance(self, seen: EyeRay, there: Surroundings, samples: Array) -> tuple[list[Array], Array]:
        """Return the light along each ray, per band, and the distance to the visible surface [m], see `Tracer`."""
        hit = self._first_hits(seen.ray, there)
        arrives = self._irradiance(hit, seen.axis, there)
        if self.light == lighting.BOUNCE:
            reflected = self._returned(hit, seen.axis, there, samples)
            arrives = [e + dr.pi * more for e, more in zip(arrives, reflected, strict=True)]
        spectra = self._sent(hit, arrives, there)
        sent = [spectra[b // lighting.LANES][b % lighting.LANES] for b in range(len(self.basis))]
        return sent if self._medium is None else self._medium.through(sent, hit.t), hit.t

    def _returned(self, hit: _SurfaceHit, axis: Array, there: Surroundings, samples: Array) -> list[Array]:
        """Return the light that each visible surface receives from one direction, which is sampled at random."""
        bounce_ray = lighting.spawn_bounce_ray(hit.point, hit.normal, mi.Point2f(samples.x, samples.y))
        second = self._first_hits(bounce_ray, there, hit.seen)
        arrives = self._irradiance(second, axis, there)
        if self._scene.has_sky or self._scene.glows:
            further = lighting.spawn_bounce_ray(second.point, second.normal, mi.Point2f(samples.z, samples.w))
            last = self._first_hits(further, there, second.seen)
            emitted = self._emitted(last, there)
            arrives = [e + dr.pi * more for e, more in zip(arrives, emitted, strict=True)]
        found = self._sent(second, arrives, there)
        return [dr.select(hit.seen, spectrum, 0) for spectrum in found]

    def _first_hits(self, ray: Array, there: Surroundings, active: Array | None = None) -> _SurfaceHit:
        """Return the first hits of the rays that are `active` (None: all); the others hit nothing."""
        movers = self._scene.movers
        active = mi.Bool(True) if active is None else active
        ray.wavelengths = self._bands[0]
        si = there.still.ray_intersect(ray, active) if self._any_still else _nothing()
        if movers.apart:
            computed(si)  # evaluated here, because otherwise every kernel that reads `si` would trace the rays again
        hit = movers.nearest(ray, dr.select(active, si.t, 0), there.movers)
        on_mover = active & (hit.which < len(movers))
        seen = active & (si.is_valid() | on_mover)
        point = ray(dr.select(seen, hit.t, 0))
        normal = dr.select(on_mover, hit.normal, mi.Vector3f(si.sh_frame.n))
        normal = dr.select(dr.dot(normal, ray.d) > 0, -normal, normal)
        si.p, si.n, si.uv, si.t = point, mi.Normal3f(normal), dr.select(on_mover, hit.uv, si.uv), hit.t
        si.sh_frame = mi.Frame3f(si.n)
        si.wi = si.to_local(-ray.d)
        bsdfs = there.tables.bsdfs
        mine = dr.gather(mi.BSDFPtr, bsdfs, dr.minimum(hit.which, len(bsdfs) - 1), on_mover)
        bsdf = dr.select(on_mover, mine, si.bsdf()) if self._any_still else mine
        colors = glow = [mi.Spectrum(1) for _ in self._bands]
        which, paint = dr.minimum(hit.which, len(movers)), self._scene.paint
        if len(paint):
            colors = paint.factors(which, there.paint, seen)
        if paint.glow:
            glow = paint.factors(which, there.paint, seen, glow=True)
        return _SurfaceHit(si, bsdf, colors, glow, which, seen, active, point, normal, hit.t, ray.d)

    def distance(self, ray: Array, there: Surroundings) -> Array:
        """Return the distance to the first hit of each ray [m]; infinite without a hit."""
        si = there.still.ray_intersect_preliminary(ray) if self._any_still else _nothing()
        far = dr.select(si.is_valid(), si.t, dr.inf)
        return self._scene.movers.nearest(ray, far, there.movers).t

    def which(self, ray: Array, there: Surroundings) -> Array:
        """Return what a ray hits first: a moving geom's index in `Movers`, or len(Movers) plus a static shape's id.

        The id is 0 without a hit. `there.still` must be the first item of `ModelScene.one_shape_per_geom`, a scene.
        """
        movers, any_still = len(self._scene.movers), len(there.still.shapes()) > 0
        si = there.still.ray_intersect_preliminary(ray) if any_still else _nothing()
        far = dr.select(si.is_valid(), si.t, dr.inf)
        hit = self._scene.movers.nearest(ray, far, there.movers)
        shape: Array = dr.reinterpret_array(mi.UInt32, si.shape) if any_still else mi.UInt32(0)
        return dr.select(hit.which < movers, hit.which, movers + dr.select(si.is_valid(), shape, 0))

    def _irradiance(self, hit: _SurfaceHit, axis: Array, there: Surroundings) -> list[Array]:
        """Return the irradiance of hit surfaces due to lamps. Each Mitsuba spectrum in the list contains 4 bands."""
        start = lighting.clear_of(hit.point, hit.normal)
        total = [mi.Spectrum(0) for _ in self._bands]
        for k, light in enumerate(self._scene.lights.found):
            towards, far, share = self._scene.lights.towards(k, hit.point, axis, there.lights)
            cosine = dr.dot(hit.normal, towards)
            shines = hit.seen & (cosine > 0) & (share > 0)
            if light.casts_shadow:
                shines &= ~self._shadowed(mi.Ray3f(start, towards), far, shines, there)
            arrives = dr.select(shines, cosine * share, 0)
            chunks = np.pad(light.level, (0, -len(light.level) % lighting.LANES)).reshape(-1, lighting.LANES)
            total = [e + arrives * mi.Spectrum(*map(float, chunk)) for e, chunk in zip(total, chunks, strict=True)]
        return total

    def _shadowed(self, ray: Array, far: Array, active: Array, there: Surroundings) -> Array:
        ray.maxt = far
        blocked = self._scene.movers.block(ray, dr.select(active, far, 0), there.movers)
        return blocked | there.still.ray_test(ray, active & ~blocked) if self._any_still else blocked

    def _sent(self, hit: _SurfaceHit, arrives: list[Array], there: Surroundings) -> list[Array]:
        """Return the radiance along rays: light that surfaces reflect and emit, or light of the sky."""
        emitted, found = self._emitted(hit, there), []
        for band, color, e, own in zip(self._bands, hit.colors, arrives, emitted, strict=True):
            hit.si.wavelengths = band
            reflected = color * e * hit.bsdf.eval_diffuse_reflectance(hit.si, hit.seen) * dr.inv_pi
            found.append(own + dr.select(hit.seen, reflected, 0))
        return found

    def _emitted(self, hit: _SurfaceHit, there: Surroundings) -> list[Array]:
        """Return the radiance of the sky for rays without a hit, and of glowing geoms, as spectra of 4 bands."""
        found = [mi.Spectrum(0) for _ in self._bands]
        if self._scene.has_sky:
            nothing = hit.active & ~hit.seen
            sky = (self._sky_radiance(there.still, hit.direction, nothing, band) for band in self._bands)
            found = [e + light for e, light in zip(found, sky, strict=True)]
        if there.tables.glows is not None:
            k = dr.gather(mi.UInt32, there.tables.glowing, hit.which, hit.seen)
            glows = hit.seen & (k < len(there.tables.glows))
            glow = dr.gather(mi.BSDFPtr, there.tables.glows, k, glows)
            for i, band in enumerate(self._bands):
                hit.si.wavelengths = band
                found[i] += dr.select(glows, hit.glow[i] * glow.eval_diffuse_reflectance(hit.si, glows), 0)
        return found

    @staticmethod
    def _sky_radiance(still: MitsubaObject, direction: Array, active: Array, band: Array) -> Array:
        """Return the radiance of the sky at the wavelengths `band` [nm]; 0 in lanes that are not `active`."""
        si = dr.zeros(mi.SurfaceInteraction3f)
        si.wi, si.wavelengths = -direction, band
        return dr.select(active, still.environment().eval(si, active), 0)


def _nothing() -> Array:
    """Return the interaction of a ray that hits nothing."""
    si: Array = dr.zeros(mi.SurfaceInteraction3f)
    si.t = mi.Float(dr.inf)
    return si
