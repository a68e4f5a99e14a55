"""Direct light along rays through a model: what stands still by Mitsuba, what moves in closed form."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from optics.numerics.autodiff import Array
from sim.robots.model_scene import ModelScene
from sim.scene.variant import MitsubaObject
from sim.tracing import lighting


@dataclass(frozen=True)
class Rows:
    """Where the kernel finds one world's movers, lights and colours: their rows, and which is its first."""

    movers: Array
    first_mover: Array
    lights: Array
    first_light: Array
    paint: Array
    first_paint: Array


class ModelTracer:
    """One component per band: surfaces are Lambertian, and each light is asked for once per ray.

    basis: (component, band): what each component is worth in each band · inputs: arrays for the kernel
    """

    def __init__(self, scene: ModelScene, wavelengths: np.ndarray) -> None:
        self._scene, self._bands = scene, lighting.spectra(wavelengths)
        self.basis = np.eye(len(wavelengths))
        self._sky = scene.has_sky
        shapes = scene.scene.shapes()
        self._any_still = len(shapes) > 0
        # Never empty: a BSDF among the inputs is what makes the recording collect the BSDFs' textures.
        known = [*scene.bsdfs, *(shape.bsdf() for shape in shapes[:1])]
        self.inputs = {"bsdfs": mi.BSDFPtr(known), **scene.movers.inputs, **scene.paint.inputs}
        if self._sky:
            self.inputs["sky"] = mi.EmitterPtr([scene.scene.environment()])

    def radiance(
        self, still: MitsubaObject, ray: Array, axis: Array, rows: Rows, inputs: dict[str, Array]
    ) -> tuple[list[Array], Array]:
        """What comes along each ray, per band, and from how far [m]; axis: of the eye that looks."""
        movers = self._scene.movers
        ray.wavelengths = self._bands[0]
        si = still.ray_intersect(ray) if self._any_still else _nothing()
        hit = movers.nearest(ray, si.t, rows.movers, rows.first_mover, inputs)
        on_mover = hit.which < len(movers)
        seen = si.is_valid() | on_mover
        point = ray(dr.select(seen, hit.t, 0))
        normal = dr.select(on_mover, hit.normal, mi.Vector3f(si.sh_frame.n))
        normal = dr.select(dr.dot(normal, ray.d) > 0, -normal, normal)
        si.p, si.n, si.uv = point, mi.Normal3f(normal), dr.select(on_mover, hit.uv, si.uv)
        si.t = hit.t
        si.sh_frame = mi.Frame3f(si.n)
        si.wi = si.to_local(-ray.d)
        mine = dr.gather(mi.BSDFPtr, inputs["bsdfs"], dr.minimum(hit.which, len(inputs["bsdfs"]) - 1), on_mover)
        bsdf = dr.select(on_mover, mine, si.bsdf()) if self._any_still else mine
        arrives = self._irradiance(still, point, normal, seen, axis, rows, inputs)
        if len(self._scene.paint):
            paint = self._scene.paint.of(dr.minimum(hit.which, len(movers)), rows.paint, rows.first_paint, inputs, seen)
            arrives = [e * color for e, color in zip(arrives, paint, strict=True)]
        spectra = self._sent_on(si, bsdf, seen, arrives)
        if self._sky:
            spectra = [s + self._heaven(still, ray, ~seen, band) for s, band in zip(spectra, self._bands, strict=True)]
        return [spectra[b // lighting.LANES][b % lighting.LANES] for b in range(len(self.basis))], hit.t

    def distance(self, still: MitsubaObject, ray: Array, rows: Rows, inputs: dict[str, Array]) -> Array:
        """How far what each ray meets is [m]."""
        si = still.ray_intersect_preliminary(ray) if self._any_still else _nothing()
        far = dr.select(si.is_valid(), si.t, dr.inf)
        return self._scene.movers.nearest(ray, far, rows.movers, rows.first_mover, inputs).t

    def which(self, told_apart: MitsubaObject, ray: Array, rows: Rows, inputs: dict[str, Array]) -> Array:
        """What each ray meets: a mover by its number, after all movers the shapes of what stands still by theirs, and
        nothing at last."""
        movers, still = len(self._scene.movers), len(told_apart.shapes())
        si = told_apart.ray_intersect_preliminary(ray) if still else _nothing()
        hit = self._scene.movers.nearest(
            ray, dr.select(si.is_valid(), si.t, dr.inf), rows.movers, rows.first_mover, inputs
        )
        standing = dr.select(si.is_valid(), movers + si.shape_index, movers + still) if still else mi.UInt32(movers)
        return dr.select(hit.which < movers, hit.which, standing)

    def _irradiance(
        self,
        still: MitsubaObject,
        point: Array,
        normal: Array,
        seen: Array,
        axis: Array,
        rows: Rows,
        inputs: dict[str, Array],
    ) -> list[Array]:
        """Of a surface, as spectra of so many bands each."""
        start = lighting.clear_of(point, normal)
        total = [mi.Spectrum(0) for _ in self._bands]
        for k, light in enumerate(self._scene.lights.found):
            towards, far, share = self._scene.lights.towards(k, point, axis, rows.lights, rows.first_light)
            cosine = dr.dot(normal, towards)
            shines = seen & (cosine > 0) & (share > 0)
            if light.light >= 0:  # an eye's own headlight throws no shadow that it could see
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

    def _sent_on(self, si: Array, bsdf: MitsubaObject, seen: Array, arrives: list[Array]) -> list[Array]:
        found = []
        for band, e in zip(self._bands, arrives, strict=True):
            si.wavelengths = band
            found.append(dr.select(seen, e * bsdf.eval_diffuse_reflectance(si, seen) * dr.inv_pi, 0))
        return found

    @staticmethod
    def _heaven(still: MitsubaObject, ray: Array, active: Array, band: Array) -> Array:
        """Radiance of the sky."""
        si = dr.zeros(mi.SurfaceInteraction3f)
        si.wi, si.wavelengths = -ray.d, band
        return dr.select(active, still.environment().eval(si, active), 0)


def _nothing() -> Array:
    """Where a ray meets nothing."""
    si: Array = dr.zeros(mi.SurfaceInteraction3f)
    si.t = mi.Float(dr.inf)
    return si
