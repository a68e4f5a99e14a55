"""Light along rays through a model: what stands still is met by Mitsuba, what moves in closed form.

Direct light is that of lamps. Light that bounces is followed as `sim.tracing.lighting` says: a surface that is seen
looks in one direction for what is reflected to it once more, for the sky and for what glows, and what it sees there
looks once again for the latter two. So nothing is left out that is reflected twice at most.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from optics.numerics.autodiff import Array
from sim.scene.device_arrays import whole_numbers
from sim.scene.variant import MitsubaObject, computed
from sim.tracing import lighting
from sim.tracing.model_scene import ModelScene


@dataclass(frozen=True)
class Rows:
    """Where the kernel finds one world's movers, lights and colours: their rows, and which is its first."""

    movers: Array
    first_mover: Array
    lights: Array
    first_light: Array
    paint: Array
    first_paint: Array


@dataclass(frozen=True)
class _Met:
    """What rays end at.

    si: to ask the BSDF by · colors, glow: that multiply its reflectance and what it emits, per chunk of bands
    which: mover, as many as there are: none · seen: whether there is anything · active: rays that there are
    point, normal: in the world, towards where the ray comes from · t: distance [m] · direction: of the ray
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
    """One component per band: surfaces are Lambertian, and each lamp is asked for once per ray and reflection.

    light: what of it is followed, "direct" or "bounce"
    basis: (component, band): what each component is worth in each band · inputs: arrays for the kernel
    """

    def __init__(self, scene: ModelScene, wavelengths: np.ndarray, light: str = lighting.DIRECT) -> None:
        self._scene, self._bands, self.light = scene, lighting.spectra(wavelengths), light
        self.basis = np.eye(len(wavelengths))
        self._glows = len(scene.glows) > 0
        shapes = scene.scene.shapes()
        self._any_still = len(shapes) > 0
        # Never empty: a BSDF among the inputs is what makes the recording collect the BSDFs' textures.
        known = [*scene.bsdfs, *(shape.bsdf() for shape in shapes[:1])]
        self.inputs = {"bsdfs": mi.BSDFPtr(known), **scene.movers.inputs, **scene.paint.inputs}
        if scene.has_sky:
            self.inputs["sky"] = mi.EmitterPtr([scene.scene.environment()])
        if self._glows:
            number = {look: k for k, look in enumerate(scene.glows)}
            of_movers = [number.get(look, len(number)) for look in scene.movers.looks]
            self.inputs["glowing"] = whole_numbers([*of_movers, len(number)])
            self.inputs["glows"] = mi.BSDFPtr(list(scene.glows.values()))

    def radiance(
        self, still: MitsubaObject, ray: Array, axis: Array, rows: Rows, inputs: dict[str, Array], samples: Array
    ) -> tuple[list[Array], Array]:
        """What comes along each ray, per band, and from how far [m]; axis: of the eye that looks; samples: each ray's
        own, twice two numbers on the unit square, wanted for light that bounces (`lighting.onwards`)."""
        met = self._met(still, ray, rows, inputs)
        arrives = self._irradiance(still, met, axis, rows, inputs, shadow_of_headlight=False)
        if self.light == lighting.BOUNCE:
            onwards = self._returned(still, met, axis, rows, inputs, samples)
            arrives = [e + dr.pi * more for e, more in zip(arrives, onwards, strict=True)]
        spectra = self._sent(still, met, arrives, inputs)
        return [spectra[b // lighting.LANES][b % lighting.LANES] for b in range(len(self.basis))], met.t

    def _returned(
        self, still: MitsubaObject, met: _Met, axis: Array, rows: Rows, inputs: dict[str, Array], samples: Array
    ) -> list[Array]:
        """What comes to surfaces that are seen, from one direction each, drawn from Lambert's cosine: light that is
        reflected there, and what glows, the sky too, be it there or reflected there."""
        onwards = lighting.onwards(met.point, met.normal, mi.Point2f(samples.x, samples.y))
        there = self._met(still, onwards, rows, inputs, met.seen)
        arrives = self._irradiance(still, there, axis, rows, inputs, shadow_of_headlight=True)
        if self._scene.has_sky or self._glows:
            further = lighting.onwards(there.point, there.normal, mi.Point2f(samples.z, samples.w))
            last = self._met(still, further, rows, inputs, there.seen)
            emitted = self._emitted(still, last, inputs)
            arrives = [e + dr.pi * more for e, more in zip(arrives, emitted, strict=True)]
        found = self._sent(still, there, arrives, inputs)
        return [dr.select(met.seen, spectrum, 0) for spectrum in found]

    def _met(
        self, still: MitsubaObject, ray: Array, rows: Rows, inputs: dict[str, Array], active: Array | None = None
    ) -> _Met:
        """What rays meet first."""
        movers = self._scene.movers
        active = mi.Bool(True) if active is None else active
        ray.wavelengths = self._bands[0]
        si = still.ray_intersect(ray, active) if self._any_still else _nothing()
        if movers.apart:
            computed(si)  # once: every kernel that reads of it would trace it anew
        far = dr.select(active, si.t, 0)
        hit = movers.nearest(ray, far, rows.movers, rows.first_mover, inputs)
        on_mover = active & (hit.which < len(movers))
        seen = active & (si.is_valid() | on_mover)
        point = ray(dr.select(seen, hit.t, 0))
        normal = dr.select(on_mover, hit.normal, mi.Vector3f(si.sh_frame.n))
        normal = dr.select(dr.dot(normal, ray.d) > 0, -normal, normal)
        si.p, si.n, si.uv = point, mi.Normal3f(normal), dr.select(on_mover, hit.uv, si.uv)
        si.t = hit.t
        si.sh_frame = mi.Frame3f(si.n)
        si.wi = si.to_local(-ray.d)
        mine = dr.gather(mi.BSDFPtr, inputs["bsdfs"], dr.minimum(hit.which, len(inputs["bsdfs"]) - 1), on_mover)
        bsdf = dr.select(on_mover, mine, si.bsdf()) if self._any_still else mine
        colors = glow = [mi.Spectrum(1) for _ in self._bands]
        which, paint = dr.minimum(hit.which, len(movers)), self._scene.paint
        if len(paint):
            colors = paint.of(which, rows.paint, rows.first_paint, inputs, seen)
        if paint.glow:
            glow = paint.of(which, rows.paint, rows.first_paint, inputs, seen, glow=True)
        return _Met(si, bsdf, colors, glow, which, seen, active, point, normal, hit.t, ray.d)

    def distance(self, still: MitsubaObject, ray: Array, rows: Rows, inputs: dict[str, Array]) -> Array:
        """How far what each ray meets is [m]."""
        si = still.ray_intersect_preliminary(ray) if self._any_still else _nothing()
        far = dr.select(si.is_valid(), si.t, dr.inf)
        return self._scene.movers.nearest(ray, far, rows.movers, rows.first_mover, inputs).t

    def which(self, told_apart: MitsubaObject, ray: Array, rows: Rows, inputs: dict[str, Array]) -> Array:
        """What each ray meets: a mover by its number; what stands still by its id in Mitsuba, after all movers, and
        nothing as the id 0."""
        movers, any_still = len(self._scene.movers), len(told_apart.shapes()) > 0
        si = told_apart.ray_intersect_preliminary(ray) if any_still else _nothing()
        far = dr.select(si.is_valid(), si.t, dr.inf)
        hit = self._scene.movers.nearest(ray, far, rows.movers, rows.first_mover, inputs)
        shape: Array = dr.reinterpret_array(mi.UInt32, si.shape) if any_still else mi.UInt32(0)
        return dr.select(hit.which < movers, hit.which, movers + dr.select(si.is_valid(), shape, 0))

    def _irradiance(
        self,
        still: MitsubaObject,
        met: _Met,
        axis: Array,
        rows: Rows,
        inputs: dict[str, Array],
        *,
        shadow_of_headlight: bool,
    ) -> list[Array]:
        """Of a surface by lamps, as spectra of so many bands each."""
        start = lighting.clear_of(met.point, met.normal)
        total = [mi.Spectrum(0) for _ in self._bands]
        for k, light in enumerate(self._scene.lights.found):
            towards, far, share = self._scene.lights.towards(k, met.point, axis, rows.lights, rows.first_light)
            cosine = dr.dot(met.normal, towards)
            shines = met.seen & (cosine > 0) & (share > 0)
            if light.light >= 0 or shadow_of_headlight:  # an eye's own headlight throws no shadow that it could see
                shines &= ~self._shadowed(still, mi.Ray3f(start, towards), far, shines, rows, inputs)
            arrives = dr.select(shines, cosine * share, 0)
            chunks = np.pad(light.level, (0, -len(light.level) % lighting.LANES)).reshape(-1, lighting.LANES)
            total = [e + arrives * mi.Spectrum(*map(float, chunk)) for e, chunk in zip(total, chunks, strict=True)]
        return total

    def _shadowed(
        self, still: MitsubaObject, ray: Array, far: Array, active: Array, rows: Rows, inputs: dict[str, Array]
    ) -> Array:
        ray.maxt = far
        blocked = self._scene.movers.block(ray, dr.select(active, far, 0), rows.movers, rows.first_mover, inputs)
        return blocked | still.ray_test(ray, active & ~blocked) if self._any_still else blocked

    def _sent(self, still: MitsubaObject, met: _Met, arrives: list[Array], inputs: dict[str, Array]) -> list[Array]:
        """Radiance: what is reflected of the light that arrives, and what is emitted."""
        emitted, found = self._emitted(still, met, inputs), []
        for band, color, e, own in zip(self._bands, met.colors, arrives, emitted, strict=True):
            met.si.wavelengths = band
            reflected = color * e * met.bsdf.eval_diffuse_reflectance(met.si, met.seen) * dr.inv_pi
            found.append(own + dr.select(met.seen, reflected, 0))
        return found

    def _emitted(self, still: MitsubaObject, met: _Met, inputs: dict[str, Array]) -> list[Array]:
        """Radiance of the sky where nothing is met, and of what glows."""
        found = [mi.Spectrum(0) for _ in self._bands]
        if self._scene.has_sky:
            nothing = met.active & ~met.seen
            found = [
                e + self._heaven(still, met.direction, nothing, b) for e, b in zip(found, self._bands, strict=True)
            ]
        if self._glows:
            k = dr.gather(mi.UInt32, inputs["glowing"], met.which, met.seen)
            glows = met.seen & (k < len(inputs["glows"]))
            glow = dr.gather(mi.BSDFPtr, inputs["glows"], k, glows)
            for i, band in enumerate(self._bands):
                met.si.wavelengths = band
                found[i] += dr.select(glows, met.glow[i] * glow.eval_diffuse_reflectance(met.si, glows), 0)
        return found

    @staticmethod
    def _heaven(still: MitsubaObject, direction: Array, active: Array, band: Array) -> Array:
        """Radiance of the sky."""
        si = dr.zeros(mi.SurfaceInteraction3f)
        si.wi, si.wavelengths = -direction, band
        return dr.select(active, still.environment().eval(si, active), 0)


def _nothing() -> Array:
    """Where a ray meets nothing."""
    si: Array = dr.zeros(mi.SurfaceInteraction3f)
    si.t = mi.Float(dr.inf)
    return si
