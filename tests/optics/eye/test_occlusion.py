"""Near surfaces hide far ones: `Eye.see` is compared with rays through the pupil, and with sums over scene points."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from optics import AccuracyError, Eye, MaskMap, Pupil
from optics.eye import layered_image, occlusion
from optics.eye.occlusion import visible_layers

S, RADIUS, FOCAL, CELL, N = 2, 300e-6, 2e-3, 4e-6, 12
NEAR, FAR = 0.05, 0.5
SIDE = N * S + 28


@cache
def eye(focus, **changes):
    """An eye that is focused at this distance. Its blur is wider than its diffraction."""
    fov = 2 * math.degrees(math.atan(N * S * CELL / 2 / FOCAL))
    pupil = Pupil(RADIUS, thin_lens_focal_length=1 / (1 / FOCAL + 1 / focus))
    settings = {"bands": 1, "full_aperture": 2 * RADIUS, "tolerance": 3e-3, **changes}
    return Eye(pupil, (N, N), fov, N * S * CELL, **settings)


def see(one, scene, z, parallax=None):
    """Return signals relative to white; parallax=0 adds all light without occlusion."""
    sight = None if parallax is None else replace(one.sight(S, z, "distinct"), parallax=parallax)
    white = one.throughput * one.spectral_bands.weights[0, 0]
    return np.asarray(one.see(scene[None], S, z=z, sight=sight))[0] / white


def receptors(image):
    margin = (SIDE - N * S) // 2
    return image[margin:-margin, margin:-margin].reshape(N, S, N, S).mean(axis=(1, 3))


def by_rays(layers, focus, rays=600):
    """Return signals of rays from all over the pupil, which end at the first surface. It includes no diffraction.

    layers: (radiance, coverage, distance), from the nearest to the farthest.
    """
    rng, total = np.random.default_rng(0), np.zeros((SIDE, SIDE))
    rows, columns = np.indices(total.shape)
    for _ in range(rays):
        angle, radius, open_ = rng.uniform(0, 2 * math.pi), math.sqrt(rng.random()), np.ones_like(total)
        shift_y, shift_x = rng.random(2) - 0.5
        for radiance, coverage, z in layers:
            blur = FOCAL * (1 / z - 1 / focus) * RADIUS / CELL * radius
            y, x = (
                np.clip(np.rint(at + shift + blur * way), 0, SIDE - 1).astype(int)
                for at, shift, way in ((rows, shift_y, math.sin(angle)), (columns, shift_x, math.cos(angle)))
            )
            total += open_ * coverage[y, x] * radiance[y, x]
            open_ = open_ * (1 - coverage[y, x])
    return receptors(total / rays)


def edge():
    """A dark plate covers the left half of horizontal stripes, which continue behind it."""
    stripes = np.repeat([0.7, 1.0], 4)[np.arange(SIDE) % 8][:, None] * np.ones((1, SIDE))
    plate = np.zeros((SIDE, SIDE))
    plate[:, : SIDE // 2] = 1
    return np.where(plate > 0, 0.05, stripes), np.where(plate > 0, NEAR, FAR), stripes, plate


@pytest.mark.parametrize("focus", [NEAR, FAR, 0.03])
def test_edges_agree_with_rays_and_plain_sums_do_not(focus):
    scene, z, stripes, plate = edge()
    exact = by_rays([(scene * 0 + 0.05, plate, NEAR), (stripes, scene * 0 + 1, FAR)], focus)
    seen, summed = see(eye(focus), scene, z), see(eye(focus), scene, z, 0.0)
    assert np.abs(seen - exact).max() < 0.07  # mostly diffraction
    assert np.abs(summed - exact).max() > 0.13
    assert np.abs(seen - exact).mean() < np.abs(summed - exact).mean() / 2


def test_the_light_of_each_point_is_blocked_by_nearer_layers():
    """The reference is a sum over scene points. The kernel of each point is multiplied by the fraction of its light
    that passes the near plate. The scene has three distances, each with its own kernel.
    """
    scene, _, _, plate = edge()
    middle, one = 0.12, eye(0.1)
    floor = np.arange(SIDE)[:, None] >= SIDE // 2 + 4
    scene = np.where(plate + floor > 0, np.where(plate > 0, 0.1, 0.7), 1.0)
    z = np.where(plate > 0, NEAR, np.where(floor, middle, FAR))

    def spread(radiance, distance):
        kernel = np.asarray(one.sight(S, distance).kernels[0, 0, 0])[0]
        half, total = kernel.shape[0] // 2, np.zeros([SIDE + len(kernel) - 1] * 2)
        for i, j in np.argwhere(radiance > 0):
            total[i : i + len(kernel), j : j + len(kernel)] += radiance[i, j] * kernel
        return total[half:-half, half:-half], kernel.sum()

    whole = np.ones_like(scene)
    image = spread(whole, FAR)[0]
    for radiance, cover, distance in ((0.7, floor * whole, middle), (0.1, plate, NEAR)):
        covered, power = spread(cover, distance)
        image = radiance * covered + (1 - covered / power) * image
    assert np.abs(see(one, scene, z) - receptors(image)).max() < 2e-3
    assert np.abs(see(one, scene, z, 0.0) - receptors(image)).max() > 0.1


@pytest.mark.parametrize("focus", [NEAR, FAR])
def test_a_scene_of_uniform_radiance_shows_no_edges(focus):
    _, z, _, plate = edge()
    assert np.abs(see(eye(focus), np.ones_like(plate), z) - 1).max() < 0.01
    assert np.abs(see(eye(focus), np.ones_like(plate), z, 0.0) - 1).max() > 0.2


def test_a_mask_dims_the_scene_but_hides_as_much():
    """A mask that transmits a quarter of the light leaves a quarter of every signal."""
    scene, z, _, _ = edge()
    dim = replace(eye(FAR).pupil, mask=MaskMap(np.full((4, 4), 0.5)))
    masked, whole = (one.see(scene[None], S, z=z) for one in (replace(eye(FAR), pupil=dim), eye(FAR)))
    np.testing.assert_allclose(4 * masked, whole, rtol=0.01)


@pytest.mark.slow
def test_a_plate_on_a_slope_hides_the_slope():
    """The depth of a floor changes gradually, so it hides nothing of itself. A plate stands on it."""
    one, inverse = eye(0.4, tolerance=2e-2), np.linspace(2.0, 50.0, SIDE)[:, None] * np.ones((1, SIDE))
    scene = np.random.default_rng(0).random(inverse.shape)
    alone = one.see(scene[None], S, z=1 / inverse)
    sight = one.sight(S, 1 / inverse)
    np.testing.assert_array_equal(alone, one.see(scene[None], S, z=1 / inverse, sight=replace(sight, parallax=0.0)))
    plate = np.zeros(inverse.shape, bool)
    plate[SIDE // 2 - 20 : SIDE // 2 + 8, SIDE // 2 - 5 : SIDE // 2 + 5] = True
    depths = np.where(plate, inverse[SIDE // 2 + 8], inverse)
    layers = list(visible_layers(depths, sight.parallax))
    hiding = np.sum([layer.hiding for layer in layers], axis=0) > 0
    assert hiding[plate].mean() > 0.7
    assert hiding[~plate].mean() < 0.05
    strips = [(np.ones_like(scene), (inverse == inverse[k]) * 1.0, 1 / inverse[k, 0]) for k in range(SIDE)]
    strips.insert(SIDE // 2 + 9, (np.full_like(scene, 0.1), plate * 1.0, 1 / inverse[SIDE // 2 + 8, 0]))
    exact, picture = by_rays(strips[::-1], 0.4, 150), np.where(plate, 0.1, 1.0)[None]
    white = one.throughput * one.spectral_bands.weights[0, 0]
    seen, summed = (
        np.asarray(one.see(picture, S, z=1 / depths, sight=replace(sight, parallax=parallax)))[0] / white
        for parallax in (sight.parallax, 0.0)
    )
    above = slice(0, 8)  # rows above the line where the plate stands on the floor
    assert np.abs(seen - exact)[above].max() < 0.08
    assert np.abs(summed - exact)[above].max() > 0.2


def test_hidden_cells_have_the_light_of_their_nearest_visible_cells():
    near = np.zeros((3, 6))
    near[:, 2:4] = 10.0
    front, back = visible_layers(near, 1.0)
    assert front.hiding.sum() == front.cells.sum() == 6
    assert back.cells.all()
    assert not back.hiding.any()
    np.testing.assert_array_equal(back.source % 6, np.tile([0, 1, 1, 4, 4, 5], (3, 1)))
    assert len(list(visible_layers(near, 0.0))) == 1


def test_steps_that_the_pupil_cannot_see_around_hide_nothing():
    near = np.zeros((2, 6))
    near[:, 3:] = 1.0
    for parallax, hidden in ((0.4, False), (0.6, True)):
        assert any(layer.hiding.any() for layer in visible_layers(near, parallax)) == hidden


@pytest.mark.slow
def test_derivatives_pass_through_edges():
    import drjit as dr
    from drjit.auto.ad import Float64

    scene, z, _, _ = edge()
    weights = np.random.default_rng(0).random((N, N))

    def loss(radius):
        pupil = Pupil(radius, thin_lens_focal_length=1 / (1 / FOCAL + 1 / FAR))
        return replace(eye(FAR), pupil=pupil, dtype="float64", full_aperture=1e-3).see(scene[None], S, z=z)

    radius = Float64(RADIUS)
    dr.enable_grad(radius)
    dr.backward(dr.sum(loss(radius) * type(loss(radius))(weights[None])))
    step = 1e-3 * RADIUS
    above, below = (float((np.asarray(loss(RADIUS + sign * step)) * weights).sum()) for sign in (1, -1))
    assert radius.grad[0] == pytest.approx((above - below) / (2 * step), rel=0.03)


def test_distances_that_need_too_many_kernels_are_named(monkeypatch):
    monkeypatch.setattr("optics.eye.kernel_bank.DEPTH_COUNTS", (1, 3))
    z = np.geomspace(NEAR, FAR, SIDE)[:, None] * np.ones((1, SIDE))
    with pytest.raises(
        AccuracyError, match=r"^z from 0\.05 to 0\.5 m needs more .* tolerance of 0\.003: must span less"
    ):
        eye(0.1).see(np.ones((1, SIDE, SIDE)), S, z=z)


@pytest.mark.parametrize("wrong", [np.nan, -1.0])
def test_bad_depth_maps(wrong):
    z = np.full((SIDE, SIDE), 0.1)
    z[3, 4] = wrong
    with pytest.raises(ValueError, match=r"^z (is empty or holds NaN: must|= -1\.0: must) be"):
        eye(0.1).see(np.ones((1, SIDE, SIDE)), S, z=z)
    with pytest.raises(ValueError, match=r"^z has shape \(3, 4\): must be one distance or one per cell"):
        eye(0.1).see(np.ones((1, SIDE, SIDE)), S, z=np.full((3, 4), 0.1))


@pytest.mark.parametrize("far", [0.0, 0.3, 0.7, 2.5])
def test_layers_follow_from_differences_of_inverse_distances(far):
    """A layer begins at a multiple of the least difference from the farthest cell, wherever this cell is."""
    steps = np.array([[0.0, 0.9, 1.1, 1.9, 2.1, 0.5]])
    least = occlusion.LEAST_SHIFT
    assert occlusion.MOST_LAYERS > 2.1
    layers = list(visible_layers((far + steps) * least, 1.0))
    own = [np.flatnonzero(layer.cells & (layer.source == np.arange(6))).tolist() for layer in layers]
    assert own == [[4], [2, 3], [0, 1, 5]]


@pytest.mark.parametrize(
    ("hidden", "continued", "passing"),
    [(0.3, 0.0, 0.7), (0.3, 0.5, 0.4), (0.5, 0.5, 0), (0.6, 0.5, 0), (1e-7, 1.0, 0.9)],
)
def test_light_passes_the_part_of_the_pupil_that_is_not_covered(monkeypatch, hidden, continued, passing):
    """Cells that hide nothing are dark, so that the rest of the pupil counts as the whole."""
    cells = np.array([[True, continued > 0, False]])
    layer = occlusion.Layer(np.arange(3), cells, np.array([[True, False, False]]))
    monkeypatch.setattr(layered_image._Scene, "_coverage", lambda self, source, of: continued if of[0, 1] else hidden)
    scene = layered_image._Scene.__new__(layered_image._Scene)
    assert scene.passing(layer) == pytest.approx(passing)
