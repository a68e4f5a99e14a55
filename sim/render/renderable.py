"""A check whether a fidelity fits the eye that it is used for."""

from __future__ import annotations

import optics
from optics.numerics.arguments import of_kind, shown
from sim.render.edge_rays import FIRST
from sim.render.fidelity import EDGES, Fidelity
from sim.tracing import lighting


def check_renderable(fidelity: Fidelity, eye: optics.Eye) -> None:
    """Refuse a fidelity that does not fit the eye.

    Raises:
        ValueError: an eye with an eccentricity, another number of bands than the eye's, or adaptive edge sampling that
            is not possible.
    """
    of_kind("eye", eye, optics.Eye, "optics.Eye(resolution=(15, 15))")
    if any(eye.eccentricity_deg):
        raise ValueError(
            f"eye: eccentricity_deg = {shown(eye.eccentricity_deg)}: must be (0, 0); eyes in a world look along their "
            "Mount, turn that instead"
        )
    of_kind("fidelity", fidelity, Fidelity, "Fidelity(16, bands=4)")
    if fidelity.bands != eye.bands:
        raise ValueError(f"fidelity.bands = {fidelity.bands}: must be the scene's {eye.bands}")
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
