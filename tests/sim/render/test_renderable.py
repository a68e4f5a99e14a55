"""Fidelities that compound eyes support."""

import pytest

import optics
import sim
from sim.eyes.depth_layers import DepthLayers
from sim.render.fidelity import Fidelity
from sim.render.renderable import check_renderable


@pytest.mark.parametrize(
    ("given", "reason"),
    [
        ({}, None),
        ({"samples": "areas"}, "samples = 'areas': must be 'rays' for a compound eye"),
        ({"samples": "edges"}, "samples = 'edges': must be 'rays' for a compound eye"),
        ({"depth": DepthLayers(20.0, 1.0, 2)}, "depth: 2 layers: must be one for a compound eye"),
        ({"bands": 5}, "bands = 5: must be the scene's 4"),
    ],
)
def test_a_fidelity_fits_compound_eyes(given, reason):
    facet = optics.Ommatidium(optics.Pupil(12e-6, thin_lens_focal_length=60e-6), optics.Waveguide(2e-6))
    eye = sim.CompoundEye([(0.0, 0.0), (5.0, 0.0)], facet, bands=4)
    fidelity = Fidelity(**({"rays_per_receptor": 4, "bands": 4} | given))
    if reason is None:
        check_renderable(fidelity, eye)
        return
    with pytest.raises(ValueError, match=rf"^fidelity[.:] ?{reason}"):
        check_renderable(fidelity, eye)
