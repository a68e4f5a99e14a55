"""Worlds of any shapes, ray traced by Mitsuba; only the movers are solved here."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from optics.numerics.autodiff import Array
from sim.scene.variant import MitsubaObject
from sim.tracing import lighting, spheres
from sim.tracing.static_scene import StaticScene


class Traced:
    """Traces rays through one world: one component per band.

    name, why: of this way of tracing, for reports
    basis: (component, band): what each component is worth in each band

    Raises:
        ValueError: lights other than directional ones and for surfaces that are not Lambertian.
    """

    name = "mitsuba"

    def __init__(self, static: StaticScene, wavelengths: np.ndarray, why: str, light: str = lighting.DIRECT) -> None:
        self.why, self.light = why, light
        self.basis = np.eye(len(wavelengths))
        self.scene = static.scene
        self._bodies = static.bodies
        self._lights = lighting.directional_lights(static.scene, wavelengths)
        self._bands = lighting.spectra(wavelengths)
        # Never empty: a BSDF among the inputs is what makes the recording collect the BSDFs' textures.
        self.inputs = {"bsdfs": mi.BSDFPtr([*static.bodies.bsdfs, static.scene.shapes()[0].bsdf()])}

    def radiance(
        self,
        scene: MitsubaObject,
        ray: Array,
        agent: Array,
        centres: list[Array],
        inputs: dict[str, Array],
        bounce_sample: Array | None = None,
    ) -> tuple[list[Array], Array]:
        """What comes along each ray, one array per component, and from how far [m]."""
        bodies = [*centres, agent]

        def occluded(shadow: Array, active: Array) -> Array:
            blocked = spheres.blocks(list(map(float, self._bodies.radii)), bodies, shadow)
            return blocked | scene.ray_test(shadow, active & ~blocked)

        si, bsdf = self._first_hit(scene, ray, centres, inputs)
        spectra = lighting.direct_light(si, bsdf, self._lights, self._bands, occluded)
        if self.light == lighting.BOUNCE:
            seen_from = dr.copysign(mi.Float(1), dr.dot(si.n, si.to_world(si.wi)))
            second = lighting.onwards(si.p, si.sh_frame.n * seen_from, bounce_sample)
            there = self._first_hit(scene, second, bodies, inputs)
            bounced = lighting.direct_light(*there, self._lights, self._bands, occluded)
            sent_on = [lighting.diffuse_reflectance(si, bsdf, b) for b in self._bands]
            valid = si.is_valid()
            spectra = [dr.select(valid, dr.fma(r, b, s), s) for s, r, b in zip(spectra, sent_on, bounced, strict=True)]
        return [spectra[b // lighting.LANES][b % lighting.LANES] for b in range(len(self.basis))], si.t

    def _first_hit(
        self, scene: MitsubaObject, ray: Array, centres: list[Array], inputs: dict[str, Array]
    ) -> tuple[Array, Array]:
        """Where the ray meets the static scene or a sphere first, and the BSDF there."""
        ray.wavelengths = self._bands[0]
        preliminary = scene.ray_intersect_preliminary(ray)
        si = preliminary.compute_surface_interaction(ray, mi.RayFlags.All)
        bsdf = si.bsdf()
        if not centres:
            return si, bsdf
        t, which = spheres.nearest(self._bodies, centres, ray, si.t)
        on_sphere = which < len(centres)
        point = ray(t)
        normal, uv = spheres.normal_and_uv(self._bodies, centres, which, point)
        si.t = t
        si.p = dr.select(on_sphere, point, si.p)
        si.n = dr.select(on_sphere, normal, si.n)
        si.uv = dr.select(on_sphere, uv, si.uv)
        si.sh_frame = dr.select(on_sphere, mi.Frame3f(normal), si.sh_frame)
        si.wi = si.to_local(-ray.d)
        return si, dr.select(on_sphere, dr.gather(mi.BSDFPtr, inputs["bsdfs"], which, on_sphere), bsdf)
