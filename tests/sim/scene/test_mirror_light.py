"""The light of a mirror against closed forms.

The tests detect these errors, each tried separately: light reversed, π forgotten, colours not linearised.
"""

import warnings

import mujoco
import numpy as np
import pytest

import sim
from optics.spectra.bands import daylight
from sim.pictures.quick_camera import QuickCamera
from sim.scene.cameras import Viewpoint
from sim.scene.color import decode_srgb
from sim.scene.mirror import MirrorWarning

from .lit import LIGHT, NM, WHITE, radiance, xml_of


def test_white_lambertian_facing_unit_light_has_the_radiance_of_daylight():
    np.testing.assert_allclose(radiance(xml_of(LIGHT, WHITE)), daylight(NM * 1e-9), rtol=1e-4)
    assert daylight(np.array([560e-9])) == pytest.approx(1.0)


def test_radiance_is_the_same_from_everywhere_and_falls_with_the_cosine():
    np.testing.assert_allclose(radiance(xml_of(LIGHT, WHITE), origin=(4.0, 1, 2)), daylight(NM * 1e-9), rtol=1e-4)
    # Two lights add up. Mitsuba draws one of them per sample: 16384 samples give a standard error of 1 %.
    other = LIGHT.replace("sun", "moon").replace("0 0 -1", "0 0.6 -0.8").replace("1 1 1", "0.5 0.5 0.5")
    slanted = LIGHT.replace("0 0 -1", "0.6 0 -0.8").replace("1 1 1", "0.5 0.5 0.5")
    np.testing.assert_allclose(radiance(xml_of(slanted, WHITE)), 0.4 * daylight(NM * 1e-9), rtol=1e-4)
    np.testing.assert_allclose(radiance(xml_of(slanted + other, WHITE), spp=4096), 0.8 * daylight(NM * 1e-9), rtol=0.02)


def test_light_shines_along_its_direction():
    """A wall that faces -x is lit by a light that travels towards +x, but not by one that travels towards -x."""
    wall = '<geom type="box" size="0.1 5 5" rgba="1 1 1 1"/>'
    for sign in (1, -1):
        light = LIGHT.replace("0 0 -1", f"{sign * 0.6} 0 -0.8")
        seen = radiance(xml_of(light, wall), origin=(-5.0, 0, 0))
        np.testing.assert_allclose(seen, (0.6 if sign > 0 else 0.0) * daylight(NM * 1e-9), rtol=1e-4)


def test_one_bounce_off_an_infinite_floor():
    """A white wall under a light from above gets no direct light. Half of its hemisphere is floor of radiance 1, so its
    radiance is 1/2. (`direct` gives 0, and one bounce gives all of it.)
    """
    floor = '<geom type="plane" size="0 0 1" rgba="1 1 1 1"/>'
    wall = '<geom type="box" size="0.1 50 50" pos="0.1 0 0" rgba="1 1 1 1"/>'
    mirror = sim.mirror(mujoco.MjModel.from_xml_string(xml_of(LIGHT, floor + wall)))
    view = Viewpoint.looking_at(np.array([-3.0, 0, 1.0]), np.array([0, 0, 1.0]), 1.0)

    def seen(integrator):
        return mirror.render(view, 2, 2, integrator, spp=4096, wavelengths=[560e-9]).mean()

    assert seen("direct") == 0
    # 16384 samples of 0 or 1 give a standard error of 0.004.
    assert seen({"type": "path", "max_depth": 3}) == pytest.approx(0.5, abs=0.016)


def test_shadows():
    blocker = '<geom type="sphere" size="0.5" pos="0 0 2"/>'
    assert np.all(radiance(xml_of(LIGHT, WHITE + blocker), origin=(3.0, 0, 3)) == 0)


def test_display_colors_are_linearised():
    grey = WHITE.replace("1 1 1 1", "0.6 0.6 0.6 1")
    np.testing.assert_allclose(radiance(xml_of(LIGHT, grey)), decode_srgb(0.6) * daylight(NM * 1e-9), rtol=2e-3)
    red = radiance(xml_of(LIGHT, WHITE.replace("1 1 1 1", "0.8 0.1 0.1 1"))) / daylight(NM * 1e-9)
    assert red[3] > 10 * red[1]


def test_material_color_counts_where_the_geom_has_none():
    """A geom's rgba overrides its material's unless it is the default, by MuJoCo's rule."""
    material = '<asset><material name="m" rgba="0.8 0.8 0.8 1"/></asset><worldbody>'
    geom = '<geom type="plane" size="5 5 1" material="m"{}/>'
    for rgba, value in (("", 0.8), (' rgba="0.3 0.3 0.3 1"', 0.3)):
        xml = xml_of(LIGHT, geom.format(rgba)).replace("<worldbody>", material)
        np.testing.assert_allclose(radiance(xml), decode_srgb(value) * daylight(NM * 1e-9), rtol=2e-3)


def test_colored_light():
    """White under a light of linear RGB (1, 0.3, 0.3) has the colour of the light."""
    from sim.scene.color import preview

    red = LIGHT.replace("1 1 1", "1 0.3 0.3")
    mirror = sim.mirror(mujoco.MjModel.from_xml_string(xml_of(red, WHITE)))
    nm = np.arange(365.0, 776.0, 10.0)
    view = Viewpoint.looking_at(np.array([0, 0, 5.0]), np.zeros(3), 1.0)
    seen = mirror.render(view, 1, 1, spp=1, wavelengths=nm * 1e-9)
    np.testing.assert_allclose(preview(seen, nm)[0, 0], [1, 0.3, 0.3], atol=0.02)


def test_headlight_shines_from_the_camera():
    for origin in ((0, 0, 5.0), (0, 0, 2.0)):
        seen = radiance(xml_of("", WHITE, headlight=True), origin=origin)
        np.testing.assert_allclose(seen, 0.4 * daylight(NM * 1e-9), rtol=1e-3)


def test_point_light_obeys_the_inverse_square_law():
    xml = xml_of('<light type="point" pos="0 0 {}" diffuse="1 1 1" castshadow="false"/>', WHITE)
    with pytest.warns(MirrorWarning, match="attenuation"):
        near = radiance(xml.format(3), origin=(4.0, 0, 1))
    # stat.center is the centre of the plane, so that the plane right below the light is as bright as in MuJoCo's
    # rendering.
    np.testing.assert_allclose(near, daylight(NM * 1e-9), rtol=2e-3)


def test_emissive_material_glows():
    xml = xml_of("", '<geom type="sphere" size="1" material="m"/>').replace(
        "<worldbody>", '<asset><material name="m" rgba="1 1 1 1" emission="0.7"/></asset><worldbody>'
    )
    np.testing.assert_allclose(radiance(xml), 0.7 * daylight(NM * 1e-9), rtol=1e-4)


GLASS = """<mujoco><visual><headlight active="0"/></visual><worldbody>
    <light type="directional" dir="0 0 -1" diffuse=".9 .9 .9"/><geom type="plane" size="3 3 .1" rgba="1 1 1 1"/>
    <geom name="pane" type="plane" size=".2 .2 .05" pos="0 -1 2" rgba="0 0 0 .5"/></worldbody></mujoco>"""


def test_who_looks_through_glass_is_told_where_it_is_not_seen_through():
    """A black pane of alpha ½ is in front of a white floor that is lit around the pane. "path" shows half of the
    floor's light; "direct" shows none of it, and warns.
    """
    view = Viewpoint.looking_at([0, -2, 4], [0, 0, 0.0], 2)
    mirror, floor = sim.mirror(GLASS), 0.9
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        through = mirror.render(view, 2, 2, "path", spp=256, wavelengths=[560e-9])
    np.testing.assert_allclose(through, floor / 2, rtol=0.1)
    with pytest.warns(sim.MirrorWarning, match="'direct' does not show what is behind the transparent geom 'pane'"):
        assert mirror.render(view, 2, 2, spp=4, wavelengths=[560e-9]).max() < 0.01
    model = mujoco.MjModel.from_xml_string(GLASS)
    with pytest.warns(sim.MirrorWarning, match="quick images do not show what is behind the transparent geom 'pane'"):
        QuickCamera(model)
