"""Directions of bounced light."""

import mitsuba as mi
import numpy as np
import pytest

from sim.eyes.receptive_fields import bounce_samples
from sim.scene.variant import variant
from sim.tracing import lighting


@pytest.mark.parametrize(
    "normal", [(0, 0, 1), (0, 0, -1), (1, 0, 0), (0, -1, 0), (0.36, 0.48, 0.8), (-0.1, 0.1, -0.99)]
)
def test_rays_go_on_by_lamberts_cosine(normal):
    """The mean of the cosines is 2/3 (1/2 for uniform directions), and that of their squares is 1/2. No side is
    preferred.
    """
    normal = np.array(normal) / np.linalg.norm(normal)
    n = 4096
    with variant():
        place = mi.Point2f(bounce_samples(n).T.astype(np.float32))
        ray = lighting.spawn_bounce_ray(mi.Point3f(3, -4, 0.5), mi.Normal3f(*normal.tolist()), place)
        start, directions = np.array(ray.o).T, np.array(ray.d).T
    cosine = directions @ normal
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1, atol=1e-6)
    assert cosine.min() > 0
    # Halton's points have errors of a few times log(n)^2 / n.
    assert cosine.mean() == pytest.approx(2 / 3, abs=2e-3)
    assert (cosine**2).mean() == pytest.approx(1 / 2, abs=2e-3)
    np.testing.assert_allclose(directions.mean(axis=0), 2 / 3 * normal, atol=4e-3)
    assert ((start - [3, -4, 0.5]) @ normal > 1e-4).all()


def test_a_wall_that_is_level_to_rounding_has_one_frame():
    with variant():
        rays = [
            lighting.spawn_bounce_ray(mi.Point3f(0, 0, 1), mi.Normal3f(1, 0, z), mi.Point2f(0.3, 0.8))
            for z in (-1e-8, 0, 1e-8)
        ]
        directions = [np.array(ray.d).ravel() for ray in rays]
    np.testing.assert_allclose(directions, np.broadcast_to(directions[0], (3, 3)), atol=1e-6)
