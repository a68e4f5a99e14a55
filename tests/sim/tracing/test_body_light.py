"""Light on the visible part of a body, against light that is computed separately for every slope."""

import dataclasses

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from sim.render.world_scene import WorldScene
from sim.scene.variant import variant
from sim.tracing.areas.body_light import BodyLight
from sim.tracing.areas.illumination import FrameState, Illumination
from sim.tracing.areas.light_baking import FOURS
from sim.tracing.areas.light_table import sum_of
from sim.tracing.areas.patch import Patch
from sim.worlds.world import build_world
from tests.sim.tracing.area_views import COARSE
from tests.sim.tracing.crowded_rooms import WORLDS, bodies_of

SIZE = 0.05  # of a patch [m]
SIDES = ((1.0, 0.0, 0.0), (0.0, -0.6, 0.8), (-0.8, 0.0, -0.6))


@pytest.fixture(scope="module")
def scene():
    return WorldScene(build_world("detection"), COARSE)


def moment(tracer, centres):
    bodies = [mi.Point3f(c.T.astype(np.float32)) for c in np.moveaxis(centres, 1, 0)]
    place = dr.arange(mi.UInt32, tracer.places * WORLDS) % tracer.places
    spread = [mi.Point3f(np.repeat(c, tracer.places, axis=0).T.astype(np.float32)) for c in np.moveaxis(centres, 1, 0)]
    lit = tracer.body_light(place, spread, tracer.inputs)
    return FrameState(bodies, tracer.inputs, dr.arange(mi.UInt32, WORLDS), lit)


def patch_of(tracer, now, side):
    """Return a patch of the first body at this surface normal."""
    normal = mi.Normal3f(*map(float, side))
    along = dr.normalize(dr.cross(normal, mi.Vector3f(0.1, 0.2, 1)))
    return Patch(now.bodies[0] + normal * tracer._radii[0], normal, along * SIZE, dr.cross(normal, along) * SIZE)


def by_itself(tracer, patch, now):
    """Return the light per component and world: direct light, and light reflected by walls, floor and other bodies."""
    straight = tracer._illumination.arriving(patch.normal, tracer._illumination.visibility(patch, now, 0))
    fours = [
        tracer._reflected.on_body(mi.UInt32(0), mi.UInt32(four), now.bodies[0], now.inputs.reflected)
        for four in range(FOURS)
    ]
    free = [sum_of(list(component), patch.normal) for component in zip(*fours, strict=True)]
    reflected = tracer._illumination.past_bodies(patch, free, now, 0)
    return np.array([np.array(a + b) for a, b in zip(straight, reflected, strict=True)])


def on(light, patch):
    return np.array([np.array(component) for component in light.on(patch.normal)])


def light_at(tracer, now, side):
    patch = patch_of(tracer, now, side)
    return BodyLight.on_patch(tracer._illumination, 0, patch, now), patch


@pytest.mark.parametrize("side", SIDES)
def test_on_its_own_slope_it_is_what_is_found_by_itself(scene, side):
    with variant():
        tracer = scene.areas("all")
        now = moment(tracer, bodies_of(scene))
        light, patch = light_at(tracer, now, side)
        expected = by_itself(tracer, patch, now)
        np.testing.assert_allclose(on(light, patch), expected, rtol=1e-5, atol=1e-6)
        # Other bodies' shadows and reflections are included, and are not negligible.
        unchanged = dataclasses.replace(light, change=[mi.Float(0)] * len(light.change))
        assert np.abs(on(unchanged, patch) - expected).max() > 0.01 * expected.max()


def test_slopes_nearby_have_their_own_light(scene):
    """An eye of 15 x 15 receptors may see a whole body in one receptor, in which slopes differ from that in the middle
    by up to twelve degrees. The root-mean-square error is 1 % of the brightest light. If the light at the middle's
    slope were used everywhere, it would be five times as large.
    """
    turned = np.array([np.cos(np.radians(12)), np.sin(np.radians(12)), 0.0])
    with variant():
        tracer = scene.areas("all")
        now = moment(tracer, bodies_of(scene))
        light, middle = light_at(tracer, now, SIDES[0])
        patch = patch_of(tracer, now, turned)
        expected = by_itself(tracer, patch, now)
        error, wrong = (np.sqrt(np.mean((found - expected) ** 2)) for found in (on(light, patch), on(light, middle)))
    assert error < 0.01 * expected.max()
    assert wrong > 5 * error


def test_light_that_is_not_followed_is_not_there(scene):
    with variant():
        tracer, all_ = scene.areas("direct"), scene.areas("all")
        now = dataclasses.replace(moment(all_, bodies_of(scene)), body_light=[])
        light, patch = light_at(tracer, now, SIDES[1])
        straight = tracer._illumination.arriving(patch.normal, tracer._illumination.visibility(patch, now, 0))
        np.testing.assert_array_equal(on(light, patch), [np.array(component) for component in straight])


def test_shadows_of_other_bodies_are_noticed(scene, monkeypatch):
    with variant():
        tracer = scene.areas("all")
        now = moment(tracer, bodies_of(scene))
        light, patch = light_at(tracer, now, SIDES[0])
        expected = by_itself(tracer, patch, now)
        monkeypatch.setattr(Illumination, "visibility", lambda self, *_: [mi.Float(1)] * len(self._directions))
        unshaded, _ = light_at(tracer, now, SIDES[0])
        assert np.abs(on(unshaded, patch) - expected).max() > 0.2 * expected.max()
        np.testing.assert_allclose(on(light, patch), expected, rtol=1e-5, atol=1e-6)
