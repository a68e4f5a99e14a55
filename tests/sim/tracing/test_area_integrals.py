"""The integrals over areas against sums over very many points."""

import drjit as dr
import mitsuba as mi
import numpy as np

from sim.scene.variant import variant
from sim.tracing.areas import half_planes, sphere_areas, stripes
from sim.tracing.areas.patch import Area


def test_shares_of_spheres():
    """The reference counts 200 x 200 points. Spheres are between directly in front of the eye and 6 m away; some fill
    the area, and others lie within it. The result is exact unless the area's border cuts the sphere: there, a chord
    approximates each strip's edge.
    """
    rng = np.random.default_rng(3)
    n, radius = 300, 0.5
    azimuth, (width, height), (x, up) = (
        rng.uniform(-3, 3, n),
        rng.uniform(0.05, 0.6, (2, n)),
        rng.uniform(-0.4, 0.4, (2, n)),
    )
    cos, sin, zero, distance = np.cos(azimuth), np.sin(azimuth), np.zeros(n), rng.uniform(0.51, 9, n)
    sides = np.stack([np.stack([sin, -cos, zero]) * width, np.stack([zero, zero, height])])
    ahead = np.stack([cos + sin * x, sin - cos * x, up])
    aim = ahead + np.einsum("skn,sn->kn", sides, rng.uniform(-0.6, 0.6, (2, n)))
    way = aim / np.linalg.norm(aim, axis=0) * distance
    ab = np.stack(np.meshgrid(*[(np.arange(200) + 0.5) / 200 - 0.5] * 2))
    v = ahead[..., None, None] + np.einsum("skn,shw->knhw", sides, ab)
    towards = np.einsum("knhw,kn->nhw", v, way)
    expected = (towards > 0) & (towards**2 > (v**2).sum(axis=0) * (distance**2 - radius**2)[:, None, None])
    within = expected.any(axis=(1, 2)) & ~(
        expected[:, [0, -1]].any(axis=(1, 2)) | expected[..., [0, -1]].any(axis=(1, 2))
    )
    with variant():
        ahead, right, way = (tuple(mi.Float(k.astype(np.float32)) for k in rows) for rows in (ahead, sides[0], way))
        area = Area(
            mi.Point3f(0),
            mi.Vector2f(*ahead[:2]),
            mi.Vector2f(*right[:2]),
            ahead[2],
            mi.Float(height.astype(np.float32)),
        )
        view = sphere_areas.SphereView(area, mi.Point3f(*way), radius)
        most = int(dr.max(view.sides)[0])
        found = sum(dr.select(i < view.sides, view.strip(mi.UInt32(i)).share, 0) for i in range(most)).numpy()
        assert set(view.sides.numpy()) == {3, 4}
        whole, strips = view.whole(), [view.strip(mi.UInt32(i)) for i in range(3)]
    error = found - expected.mean(axis=(1, 2))
    assert within.sum() > 10
    assert np.abs(error[within]).max() < 1e-3
    assert np.abs(error).max() < 0.03
    assert np.sqrt(np.mean(error**2)) < 0.003
    # The light is computed for a whole that has the same size and is centred. No single strip is centred.
    assert np.abs(whole.share.numpy()[within] - found[within]).max() < 1e-3
    places = np.einsum("nhw,ahw->an", expected, ab)[:, within] / expected.sum(axis=(1, 2))[within]
    for strip, in_the_middle in ((whole, True), (strips[0], False), (strips[2], False)):
        off = np.abs(np.array([strip.part.a, strip.part.b])[:, within] - places).max()
        assert (off < 0.01) == in_the_middle


def test_shares_above_lines():
    """The reference counts 400 x 400 points. A line crosses at most 800 of their cells, so that the reference is
    accurate to 1/200.
    """
    rng = np.random.default_rng(0)
    s, p, q = rng.uniform(-1, 1, (3, 300))
    p[:50], q[50:100] = 0, 0
    a, b = np.meshgrid(*[(np.arange(400) + 0.5) / 400 - 0.5] * 2)
    expected = [np.mean(si + pi * a + qi * b > 0) for si, pi, qi in zip(s, p, q, strict=True)]
    with variant():
        found = half_planes.share_above(*(mi.Float(np.ascontiguousarray(x, np.float32)) for x in (s, p, q))).numpy()
    np.testing.assert_allclose(found, expected, atol=5e-3)


def test_means_of_clamped_lines():
    rng = np.random.default_rng(1)
    first = rng.uniform(-3, 4, 400)
    last = first + rng.choice([1e-3, 0.02, 1, 5], 400) * rng.uniform(-1, 1, 400)
    steps = (np.arange(10_000) + 0.5) / 10_000
    expected = np.clip(first + (last - first) * steps[:, None], 0, 1).mean(axis=0)
    with variant():
        found = half_planes.mean_clamped(mi.Float(first.astype(np.float32)), mi.Float(last.astype(np.float32))).numpy()
    np.testing.assert_allclose(found, expected, atol=2e-5)


def test_textures_are_averaged():
    """Averages over segments and parallelograms of any size agree with the mean of many texel lookups."""
    rng = np.random.default_rng(2)
    texels = np.concatenate([rng.random((512, 2)), np.repeat(rng.random((8, 2)), 32, axis=0)])
    places = np.array([[0, 512], [512, 256]])
    n = 200
    which = rng.integers(2, size=n)
    # From sides of one texel, the width of the narrowest ramp in a texture, to longer than a whole texture.
    middle, one, other = rng.uniform(-900, 900, n), *(np.exp(rng.uniform(0, np.log(700), (2, n))))

    def look(x):
        first, columns = places[which].T
        whole = np.floor(x).astype(int)
        a, b = (texels[first + (whole + i) % columns] for i in (0, 1))
        return a + (b - a) * (x - whole)[..., None]

    def steps(count):
        return (np.arange(count) + 0.5) / count - 0.5

    line = np.mean([look(middle + one * a) for a in steps(20_000)], axis=0)
    longer, shorter = np.maximum(one, other), np.minimum(one, other)
    both = np.mean([look(middle + longer * a + shorter * b) for a in steps(1500) for b in steps(30)], axis=0)
    with variant():
        pattern = stripes.Stripes(texels, places)
        floats = [mi.Float(np.ascontiguousarray(x, np.float32)) for x in (middle, one, other, *places[which].T)]
        inputs = pattern.tables
        x, w, h, *texture = floats
        texture = stripes.Texture(*texture)
        found_line = np.transpose(pattern.mean(texture, [x - w / 2, x + w / 2], 0, inputs))
        found_both = np.transpose(pattern.mean_over(texture, x, (w, h), inputs))
    np.testing.assert_allclose(found_line, line, atol=2e-3)
    np.testing.assert_allclose(found_both, both, atol=3e-3)


def test_short_sides_of_long_textures():
    """Rounding of the second integral limits how short the sides may be. If half of a texture's 8,192 columns are
    bright, means over single texels would be wrong by more than 0.1. With the least side, the error is at most
    `stripes.ROUNDING`. Built-in stripes of 128 of 1,536 texels are averaged over single texels.
    """
    halves, built_in = (np.repeat(np.tile([0.1, 0.9], n), width)[:, None] for n, width in ((1, 4096), (6, 128)))
    middle = np.random.default_rng(3).uniform(200, 3900, 500)  # far from the edge
    with variant():
        pattern = stripes.Stripes(halves, np.array([[0, len(halves)]]))
        texture = pattern.texture(0, len(halves))
        errors = [
            np.abs(
                pattern.mean_over(which, mi.Float(middle), (mi.Float(1),) * 2, pattern.tables)[0].numpy() - 0.1
            ).max()
            for which in (texture, stripes.Texture(texture.first, texture.columns))
        ]
        assert errors[0] <= stripes.ROUNDING
        assert errors[1] > 0.1
        assert stripes.Stripes(built_in, np.array([[0, len(built_in)]])).texture(0, 1536).least_side == 1
