"""Light that a body reflects onto near surfaces, against closed forms and the visible cap of the body."""

from types import SimpleNamespace

import mitsuba as mi
import numpy as np
import pytest

from sim.scene.variant import variant
from sim.tracing.areas.illumination import Illumination


def test_a_body_shines_as_lamberts_sphere():
    """The body's disk is 2/3 as bright as a matt disk from the direction of the light, 0 from behind, and 2/(3π) from
    the side. (The phase function is sin α + (π - α) cos α, over π.) Only the nearest point is visible from a short
    distance, and has the brightness of the incident light.
    """
    straight = SimpleNamespace(_levels=np.array([[0.8]]), _directions=[[0.0, 0.0, 1.0]], _colours=[[0.5]], _radii=[0.2])
    with variant():
        straight.bodies = SimpleNamespace(on_side=lambda *_: [mi.Float(1.0)])
        now = SimpleNamespace(bodies=[mi.Point3f(0, 0, 1)], world=None, body_light=None)
        ways = ((0, 0, 1), (1, 0, 0), (0, 0, -1), (0.6, 0, 0.8))
        for nearness, expected in ((0.0, (2 / 3, 2 / (3 * np.pi), 0.0, None)), (1.0, (1.0, 0.0, 0.0, 0.8))):
            for towards, share in zip(ways, expected, strict=True):
                if share is not None:
                    (sent,) = Illumination._sent(straight, mi.UInt32(0), mi.Vector3f(*towards), nearness, now)
                    assert sent.numpy() == pytest.approx(0.8 * 0.5 * share, abs=1e-6)


@pytest.mark.parametrize("nearness", [0.2, 0.5, 0.8])
def test_between_near_and_far_a_body_shines_as_its_visible_cap(nearness):
    """The reference is the mean over the visible cap, weighted by projected solid angle. The fit's error is up to 0.05
    of the light. The formula for either end has a larger error.
    """
    rng = np.random.default_rng(0)
    sine, around = np.sqrt(rng.random(20_000)) * nearness, rng.uniform(0, 2 * np.pi, 20_000)
    ray = np.stack([sine * np.cos(around), sine * np.sin(around), np.sqrt(1 - sine**2)], axis=-1)
    t = ray[:, 2] - np.sqrt(ray[:, 2] ** 2 - 1 + nearness**2)
    normals = (ray * t[:, None] - [0, 0, 1]) / nearness  # a ball at distance 1, seen from -z
    straight = SimpleNamespace(_levels=np.array([[1.0]]), _directions=[[0.0, 0.0, 1.0]], _colours=[[1.0]], _radii=[0.2])
    errors = {nearness: [], 0.0: [], 1.0: []}
    with variant():
        straight.bodies = SimpleNamespace(on_side=lambda *_: [mi.Float(1.0)])
        now = SimpleNamespace(bodies=[mi.Point3f(0, 0, 1)], world=None, body_light=None)
        for angle in np.linspace(0, np.pi, 19):
            exact = np.maximum(normals @ [np.sin(angle), 0, -np.cos(angle)], 0).mean()
            towards = mi.Vector3f(float(np.sin(angle)), 0, float(np.cos(angle)))
            for taken, found in errors.items():
                (sent,) = Illumination._sent(straight, mi.UInt32(0), towards, taken, now)
                found.append(abs(float(sent.numpy()[0]) - exact))
    assert max(errors[nearness]) < 0.055
    assert max(errors[0.0]) > 0.055
    assert max(errors[1.0]) > 0.055
