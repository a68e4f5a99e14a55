"""Measured spectra of materials and lights in the mirror, against their own tables."""

import mujoco
import numpy as np
import pytest

import sim
from optics import Spectrum, illuminant, reflectance
from optics.spectra.spectrum import daylight
from sim.scene.cameras import Viewpoint

NM = np.array([310.0, 352.5, 387.0, 450.0, 556.0, 640.0, 770.0])
XML = """<mujoco><visual><headlight active="0" ambient="0 0 0"/></visual><asset>
 <texture name="grey" type="2d" builtin="flat" width="8" height="8" rgb1=".6 .6 .6" colorspace="{space}"/>
 <texture name="red" type="2d" builtin="flat" width="8" height="8" rgb1=".9 .1 .1"/>
 <material name="leaf"/><material name="striped" texture="grey"/><material name="painted" texture="red"/>
 <material name="twin"/></asset><worldbody>
 <light name="sun" type="directional" dir="0 0 -1" diffuse=".5 .25 .5" ambient="0 0 0" specular="0 0 0"/>
 <light name="twin" active="false"/>
 <geom type="{kind}" size="5 5 1" pos="0 0 {z}" material="{material}"/></worldbody></mujoco>"""
UNEVEN = Spectrum((300, 340, 380, 420, 700), (0.1, 0.7, 0.2, 0.5, 0.9))


def seen(material, spectra, kind="plane", space="auto", variant="llvm_ad_spectral"):
    """Return the radiance at NM of the upper side of a plane or box, seen from above."""
    xml = XML.format(material=material, kind=kind, z=-1 if kind == "box" else 0, space=space)
    mirror = sim.mirror(mujoco.MjModel.from_xml_string(xml), spectra=spectra, variant=variant)
    view = Viewpoint.looking_at(np.array([0.3, 0.2, 5.0]), np.array([0.3, 0.2, 0.0]), 1.0)
    return mirror.render(view, 2, 2, spp=2, wavelengths=NM * 1e-9).mean((1, 2))


@pytest.mark.parametrize("variant", ["llvm_ad_spectral", "scalar_spectral"])
@pytest.mark.parametrize("kind", ["plane", "box"])
def test_a_material_reflects_its_spectrum_and_nothing_of_its_color(kind, variant):
    """Under a light of diffuse 0.5 (its largest component) the radiance is 0.5 ρ(λ) D65(λ), also at the kinks of the
    tables.
    """
    spectra = {"leaf": UNEVEN, "sun": "D65"}
    expected = 0.5 * UNEVEN.at(NM * 1e-9) * daylight(NM * 1e-9)
    np.testing.assert_allclose(seen("leaf", spectra, kind, variant=variant), expected, rtol=1e-4)


def test_a_light_has_its_spectrum_at_its_own_level():
    spectra = {"leaf": "foliage", "sun": "A"}
    expected = 0.5 * reflectance("foliage").at(NM * 1e-9) * illuminant("A").at(NM * 1e-9)
    np.testing.assert_allclose(seen("leaf", spectra), expected, rtol=1e-4)


@pytest.mark.parametrize("kind", ["plane", "box"])
@pytest.mark.parametrize(("space", "share"), [("linear", 0.6), ("sRGB", 0.3185)])
def test_a_grey_texture_multiplies_the_spectrum(kind, space, share):
    """A level of 0.6 of the display's white is 0.3185 of its light (IEC 61966-2-1)."""
    expected = 0.5 * share * UNEVEN.at(NM * 1e-9) * daylight(NM * 1e-9)
    found = seen("striped", {"striped": UNEVEN, "sun": "D65"}, kind, space)
    np.testing.assert_allclose(found, expected, rtol=5e-3)  # 8-bit texels


def test_daylight_is_ultraviolet_too():
    """The default light contains ultraviolet; Mitsuba's `rgb` and `d65` emitters end at 360 nm."""
    white = Spectrum((400, 700), (1, 1))
    xml = XML.format(material="leaf", kind="plane", z=0, space="auto").replace(".5 .25 .5", "1 1 1")
    mirror = sim.mirror(mujoco.MjModel.from_xml_string(xml), spectra={"leaf": white})
    view = Viewpoint.looking_at(np.array([0, 0, 5.0]), np.zeros(3), 1.0)
    found = mirror.render(view, 1, 1, spp=1, wavelengths=NM * 1e-9)[:, 0, 0]
    np.testing.assert_allclose(found, daylight(NM * 1e-9), rtol=1e-4)


def test_what_glows_glows_in_its_spectrum():
    """Without any light, the radiance is emission · ρ(λ) D65(λ). Between the tables' entries, the product of two lines
    is a parabola, which gives errors of 1e-3.
    """
    xml = XML.format(material="leaf", kind="plane", z=0, space="auto").replace('"leaf"/>', '"leaf" emission=".7"/>', 1)
    mirror = sim.mirror(
        mujoco.MjModel.from_xml_string(xml.replace('<light name="sun"', '<light active="false"')),
        spectra={"leaf": UNEVEN},
    )
    view = Viewpoint.looking_at(np.array([0, 0, 5.0]), np.zeros(3), 1.0)
    found = mirror.render(view, 1, 1, spp=1, wavelengths=NM * 1e-9)[:, 0, 0]
    np.testing.assert_allclose(found, 0.7 * UNEVEN.at(NM * 1e-9) * daylight(NM * 1e-9), rtol=2e-3)


@pytest.mark.parametrize(
    ("material", "spectra", "named"),
    [
        ("leaf", {"leef": "foliage"}, "no material or light 'leef'; did you mean 'leaf'"),
        ("leaf", {"twin": "foliage"}, "'twin' is a material and a light"),
        ("leaf", {"leaf": "folage"}, "reflectance = 'folage'.*did you mean 'foliage'"),
        ("leaf", {"sun": "foliage"}, "illuminant = 'foliage'"),
        ("leaf", {"leaf": 0.5}, "'leaf' has 0.5: must be an optics.Spectrum"),
        ("leaf", {"leaf": Spectrum((400, 500), (0.5, 1.2))}, "'leaf' reflects 1.2"),
        ("painted", {"painted": UNEVEN}, "'painted' has a coloured texture"),
    ],
)
def test_bad_spectra_are_named(material, spectra, named):
    with pytest.raises(ValueError, match=named):
        seen(material, spectra)
