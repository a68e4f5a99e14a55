"""Gloss, mirrors, metal and glow of materials against closed forms.

The tests detect these errors, each tried separately: gloss for MuJoCo's defaults, specular used as the reflectance, a
box's mirror on all its sides, a perfect mirror in Mitsuba's blend, glow not decoded.
"""

import numpy as np
import pytest

import sim
from optics.spectra.spectrum import daylight
from sim.scene.cameras import Viewpoint
from sim.scene.color import decode_srgb

NM = 560e-9
SUN = '<light type="directional" dir="0 0 -1" diffuse="1 1 1"/>'


def seen(material, geom='<geom type="plane" size="50 50 1" material="m"/>', lights=SUN, origin=(0, 0, 5.0), **how):
    """Return the radiance at 560 nm at the origin."""
    xml = f"""<mujoco><visual><headlight active="0"/></visual><asset>{how.pop("assets", "")}
    <material name="m" {material}/></asset><worldbody>{lights}{geom}</worldbody></mujoco>"""
    view = Viewpoint.looking_at(np.array(origin), np.array(how.pop("target", (0, 0, 0.0))), 0.2)
    return float(sim.mirror(xml).render(view, 1, 1, **{"spp": 16, "wavelengths": [NM], **how})[0, 0, 0])


@pytest.mark.parametrize("material", ["", 'specular="0" shininess="0.9"', 'specular="0.5" shininess="0.5"'])
def test_materials_that_do_not_ask_for_gloss_are_lambertian(material):
    """MuJoCo's defaults are 0.5 and 0.5. From both sides, the surface is not brighter at the angle of a highlight."""
    grey = f'rgba="0.6 0.6 0.6 1" {material}'
    assert seen(grey) == pytest.approx(decode_srgb(0.6), rel=2e-3)
    assert seen(grey, origin=(4.0, 0, 3)) == pytest.approx(decode_srgb(0.6), rel=2e-3)


@pytest.mark.parametrize(("specular", "shininess"), [(1.0, 0.8), (0.5, 0.2), (0.25, 1.0)])
def test_highlight_peaks_where_and_as_high_as_a_beckmann_lobe(specular, shininess):
    """Light and eye are on the normal of a black surface: L / E = F₀ D(0) / 4 with D(0) = 1 / (π α²), and E = π."""
    black = f'rgba="0 0 0 1" specular="{specular}" shininess="{shininess}"'
    peak = 0.08 * specular / (4 * 2 / (128 * shininess + 2))
    assert seen(black) == pytest.approx(peak, rel=5e-3)
    # Off the peak, the half vector is at 26.6° from the normal: sharp lobes vanish, and others are lower.
    assert seen(black, origin=(4.0, 0, 3)) < 0.35 * peak


def test_gloss_reflects_no_more_light_than_arrives():
    """Under a white sky (radiance 1 from everywhere), no surface may be brighter than the sky."""
    sky = '<texture type="skybox" builtin="flat" rgb1="1 1 1" width="8" height="48"/>'
    for origin in ((0, 0, 5.0), (5.0, 0, 1.0)):
        found = seen('rgba="1 1 1 1" specular="1" shininess="0.5"', lights="", origin=origin, assets=sky, spp=4096)
        assert 0.8 < found < 1.02


def test_reflectance_is_a_mirrors_share():
    """The eye sees a glowing sphere in a mirror of 0.3 on a grey surface: 0.3 of the sphere and 0.7 of the grey."""
    floor = '<geom type="plane" size="50 50 1" material="m"/><geom size="0.5" pos="-3 0 3" material="lamp"/>'
    lamp = '<material name="lamp" rgba="1 1 1 1" emission="0.7"/>'
    how = {"geom": floor, "origin": (3.0, 0, 3), "assets": lamp, "spp": 4096}
    grey, silver = 'rgba="0.6 0.6 0.6 1"', 'rgba="0.6 0.6 0.6 1" reflectance="0.3"'
    # 4096 draws of 0.3 give a standard error of 2.4 %.
    assert seen(silver, lights="", **how) == pytest.approx(0.3 * 0.7 + 0.7 * seen(grey, lights="", **how), rel=0.08)
    aside = how | {"target": (3.0, 3.0, 0)}
    assert seen(silver, **aside) == pytest.approx(0.7 * seen(grey, **aside), rel=0.02)


def test_only_the_top_of_a_box_is_a_mirror():
    box = '<geom type="box" size="1 1 1" material="m"/>'
    grey, silver = 'rgba="0.6 0.6 0.6 1"', 'rgba="0.6 0.6 0.6 1" reflectance="0.5"'
    sun = '<light type="directional" dir="-0.6 0 -0.8" diffuse="1 1 1"/>'
    top = {"geom": box, "lights": sun, "origin": (0, 2.0, 5.0), "target": (0, 0, 1.0)}
    side = {"geom": box, "lights": sun, "origin": (5.0, 0, 0.5), "target": (1.0, 0, 0)}
    assert seen(silver, **top) == pytest.approx(0.5 * seen(grey, **top), rel=1e-4)
    assert seen(silver, **side) == pytest.approx(seen(grey, **side), rel=1e-4)
    assert seen(grey, **side) > 0.1


def test_metal_has_a_coloured_highlight_and_no_matt_part():
    metal = 'rgba="1 0.2 0.2 1" metallic="1" roughness="0.3"'
    assert seen(metal) > 1.5
    assert seen(metal, origin=(4.0, 0, 3)) < 0.02
    assert seen(metal, wavelengths=[650e-9]) / daylight(np.array([650e-9]))[0] > 3 * seen(metal, wavelengths=[500e-9])


def test_glow_is_its_share_of_daylight():
    ball = '<geom size="1" material="m"/>'
    found = seen('rgba="0.6 0.6 0.6 1" emission="0.7"', geom=ball, lights="")
    assert found == pytest.approx(0.7 * decode_srgb(0.6), rel=1e-4)


@pytest.mark.parametrize("geom", ['type="plane" size="1 1 1"', 'type="box" size="1 1 .1" pos="0 0 -.1"'])
def test_textures_glow_in_their_colors(geom):
    checker = '<texture name="t" type="2d" builtin="flat" rgb1=".6 .6 .6" width="8" height="8"/>'
    found = seen('texture="t" emission="0.5"', geom=f'<geom {geom} material="m"/>', lights="", assets=checker)
    assert found == pytest.approx(0.5 * decode_srgb(0.6), rel=5e-3)
