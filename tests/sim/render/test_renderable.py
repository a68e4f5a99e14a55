"""Fidelities that eyes support, and arguments of a model's renderer."""

import pytest

import optics
import sim
from sim.eyes.depth_layers import DepthLayers
from sim.render import model_renderer
from sim.render.fidelity import Fidelity
from sim.render.renderable import check_renderable
from sim.scene.mirror import VISIBLE_GROUPS


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


def rendered(monkeypatch, *given, **named):
    """Return the arguments of the scene and of the renderer that a model's renderer prepares."""
    asked = []
    monkeypatch.setattr(
        model_renderer, "PreparedScene", lambda *args, **others: asked.append((args, others)) or "scene"
    )
    monkeypatch.setattr(model_renderer, "mounts_of", lambda name, mounts: (name, mounts))
    monkeypatch.setattr(model_renderer.source, "load", lambda model: f"loaded {model}")
    monkeypatch.setattr(model_renderer.EyeRenderer, "__init__", lambda self, *args: asked.append(args))
    sim.ModelRenderer("model", *given, **named)
    return asked


def test_defaults_of_a_model_s_renderer(monkeypatch):
    """One world, 16 rays per receptor, the eye's own bands, and Mitsuba."""
    eye = optics.Eye(resolution=(2, 3), bands=5)
    (given, named), opened = rendered(monkeypatch, eye, "mounts")
    assert given == ("loaded model", eye, ("mounts", "mounts"))
    assert named == {
        "spectra": None,
        "groups": VISIBLE_GROUPS,
        "varied": (),
        "tracer": "mitsuba",
        "medium": None,
    }
    assert opened == ("scene", 1, Fidelity(16, 5))


@pytest.mark.parametrize(
    ("samples", "tracer", "used"),
    [("rays", "mitsuba", "mitsuba"), ("areas", "mitsuba", "auto"), ("areas", "closed_form", "closed_form")],
)
def test_the_fidelity_of_a_model_s_renderer(monkeypatch, samples, tracer, used):
    """Its bands replace those of the eye, and areas need a closed form."""
    fidelity = Fidelity(4, 7, samples=samples)
    (given, named), opened = rendered(monkeypatch, optics.Eye(resolution=(2, 3)), "mounts", 3, fidelity, tracer=tracer)
    assert (given[1].bands, named["tracer"], opened) == (7, used, ("scene", 3, fidelity))
    for wrong in (0, 2**31):
        with pytest.raises(ValueError, match=r"^n_envs = "):
            rendered(monkeypatch, given[1], "mounts", wrong)


def test_compound_eyes_need_mitsuba(monkeypatch):
    facet = optics.Ommatidium(optics.Pupil(12e-6, thin_lens_focal_length=60e-6), optics.Waveguide(2e-6))
    eye = sim.CompoundEye([(0.0, 0.0), (5.0, 0.0)], facet, bands=4)
    assert rendered(monkeypatch, eye, "mounts")[1] == ("scene", 1, Fidelity(16, 4))
    with pytest.raises(ValueError, match=r"^tracer = 'auto': must be 'mitsuba' for a compound eye$"):
        rendered(monkeypatch, eye, "mounts", tracer="auto")
