"""What eyes on a model may be, and how finely they may see."""

from __future__ import annotations

import optics
from optics.numerics.arguments import of_kind, shown
from sim.render.edge_rays import FIRST
from sim.render.fidelity import AREAS, EDGES, Fidelity
from sim.tracing import lighting

SIXTEEN = 16  # rays per receptor


def renderable(fidelity: Fidelity | None, eye: optics.Eye) -> Fidelity:
    """As asked, where rays through a model can see so; None: sixteen rays, in the eye's own bands.

    Raises:
        ValueError: areas, light that is reflected more often, rays at edges where they do not go, or an eye that looks
            aside.
    """
    of_kind("eye", eye, optics.Eye, "optics.Eye(resolution=(15, 15))")
    if any(eye.eccentricity_deg):
        raise ValueError(
            f"eye: eccentricity_deg = {shown(eye.eccentricity_deg)}: eyes in a world look along their Mount: turn that "
            "instead"
        )
    if fidelity is None:
        return Fidelity(SIXTEEN, eye.bands)
    of_kind("fidelity", fidelity, Fidelity, "Fidelity(16, bands=4)")
    if fidelity.light == lighting.ALL or fidelity.samples == AREAS:
        raise ValueError(
            f"fidelity: light = {fidelity.light!r}, samples = {fidelity.samples!r}: models of one's own are seen by "
            "rays, which follow two reflections at most"
        )
    if fidelity.samples == EDGES and fidelity.light == lighting.BOUNCE:
        raise ValueError("fidelity: samples = 'edges': is for direct light; light that bounces differs from ray to ray")
    if fidelity.samples == EDGES and fidelity.rays_per_receptor < FIRST:
        raise ValueError(
            f"fidelity: rays_per_receptor = {fidelity.rays_per_receptor:g}: must be at least {FIRST} where samples = "
            f"'edges', which looks with {FIRST} everywhere first"
        )
    if fidelity.samples == EDGES and eye.pupil is not None:
        raise ValueError("fidelity: samples = 'edges': is for perfect lenses; behind a pupil receptors share all rays")
    return fidelity
