"""A check that the accuracy settings of a rendering (`Fidelity`) can be used with an eye."""

from __future__ import annotations

from optics.numerics.arguments import of_kind, shown
from sim.eyes.compound_eye import CompoundEye, WorldEye, world_eye
from sim.render.edge_rays import FIRST
from sim.render.fidelity import AREAS, EDGES, RAYS, Fidelity
from sim.tracing import lighting


def check_renderable(fidelity: Fidelity, eye: WorldEye) -> None:
    """Refuse a fidelity (accuracy of rendering) with which an eye cannot be rendered.

    fidelity: accuracy of rendering, such as the number of bands and the kind of samples
    eye: an eye in a world

    Raises:
        ValueError: the eye's `eccentricity_deg` is not (0, 0), its number of bands differs from the fidelity's, or it
            cannot be rendered with the kind of samples or the depth layers of the fidelity. Samples "edges" (adaptive
            edge sampling) need a perfect lens, direct light and at least four rays per receptor. Samples "areas"
            (rectangles of the visual field over which light is averaged) need receptors of equal size. Compound eyes
            support only samples "rays" and a single depth layer.
    """
    world_eye("eye", eye)
    if not isinstance(eye, CompoundEye) and any(eye.eccentricity_deg):
        raise ValueError(
            f"eye: eccentricity_deg = {shown(eye.eccentricity_deg)}: must be (0, 0); eyes in a world look along their "
            "Mount, turn that instead"
        )
    of_kind("fidelity", fidelity, Fidelity, "Fidelity(16, bands=4)")
    if fidelity.bands != eye.bands:
        raise ValueError(f"fidelity.bands = {fidelity.bands}: must be the scene's {eye.bands}")
    if isinstance(eye, CompoundEye):
        _check_ommatidia(fidelity)
        return
    if fidelity.samples == AREAS and eye.lattice is not None:
        raise ValueError(
            "fidelity: samples = 'areas': divides the field into equal rectangles, but the eye's receptors have a "
            "density and different sizes: must be 'rays', which follow the density"
        )
    if fidelity.samples != EDGES:
        return
    if fidelity.light == lighting.BOUNCE:
        raise ValueError("fidelity: samples = 'edges': is for direct light; light that bounces differs between rays")
    if fidelity.rays_per_receptor < FIRST:
        raise ValueError(
            f"fidelity: rays_per_receptor = {fidelity.rays_per_receptor:g}: must be at least {FIRST} where samples = "
            f"'edges', which first traces {FIRST} rays for every receptor"
        )
    if eye.pupil is not None:
        raise ValueError("fidelity: samples = 'edges': is for perfect lenses; behind a pupil receptors share all rays")


def _check_ommatidia(fidelity: Fidelity) -> None:
    if fidelity.samples != RAYS:
        raise ValueError(
            f"fidelity: samples = {fidelity.samples!r}: must be 'rays' for a compound eye, whose acceptance functions "
            "draw them"
        )
    if fidelity.depth.count > 1:
        raise ValueError(
            f"fidelity: depth: {fidelity.depth.count} layers: must be one for a compound eye, whose facets have a "
            "large depth of field"
        )
