"""Pupils of pixels in systems against direct sums over the pixels, some of which the rim of the aperture cuts."""

import itertools

import numpy as np
import pytest
from numpy.polynomial.legendre import leggauss

import optics
from optics import FreeSpace, HeightMap, Misaligned, PixelRelief, Pupil, propagate_through
from optics.apertures.soft_edge import SoftEdge
from tests.optics.propagation.test_misalignment import WAVELENGTH, K, kernel_sum, tilted_disk
from validation.reference import relative_l2

RNG = np.random.default_rng(5)
LEVELS = 0.25e-6 * RNG.integers(0, 4, (4, 4))
SHAPE, DX = (19, 23), 1e-6
WINDOW = {"wavelength": WAVELENGTH, "out_dx": DX, "out_shape": SHAPE}


def pixel_nodes(n, order):
    """Return nodes x and y, weights, rows and columns of n x n pixels within the unit circle.

    A pixel is divided where the circle enters and leaves it, and y ends at the circle. The nodes are dense at the ends
    of a cut panel, where the circle may be steep.
    """
    t, weight = leggauss(order)
    t, weight, borders, found = (t + 1) / 2, weight / 2, np.linspace(-1, 1, n + 1), []
    for row, column in itertools.product(range(n), repeat=2):
        (left, right), (low, high) = (borders[i : i + 2] for i in (column, row))
        whole = np.hypot(*(max(abs(a), abs(b)) for a, b in ((left, right), (low, high)))) <= 1
        crossings = [s * np.sqrt(1 - y * y) for y in (low, high) for s in (-1, 1)]
        ends = [left, right] if whole else sorted([left, right, *(x for x in crossings if left < x < right)])
        at, rate = (t, 1) if whole else (np.sin(np.pi * t / 2) ** 2, np.pi / 2 * np.sin(np.pi * t))
        for begin, end in itertools.pairwise(ends):
            x = begin + (end - begin) * at
            rim = np.inf if whole else np.sqrt(1 - x * x)
            bottom, top = np.maximum(low, -rim), np.minimum(high, rim)
            length = np.maximum(top - bottom, 0)
            y = bottom[:, None] if np.ndim(bottom) else np.full((order, 1), bottom)
            y = y + np.outer(length * np.ones(order), t)
            size = np.outer(weight * rate * (end - begin) * length, weight)
            found.append([np.repeat(x, order), y.ravel(), size.ravel(), *np.full((2, y.size), [[row], [column]])])
    return [np.concatenate(part) for part in zip(*found, strict=True)]


def at_window(z):
    y, x = ((np.arange(n) - n // 2) * DX for n in SHAPE)
    return np.stack([*(part.ravel() for part in np.meshgrid(x, y)), np.full(x.size * y.size, z)], axis=-1)


def behind_pixels(heights, radius, z, order):
    """Return the field behind pixels of index 1.5 in a plane wave."""
    x, y, size, row, column = pixel_nodes(len(heights), order)
    light = np.exp(0.5j * K * heights[row.astype(int), column.astype(int)]) * size * radius**2
    at = radius * np.stack([x, y, 0 * x], axis=-1)
    return kernel_sum(light, at, np.array([0, 0, 1.0]), at_window(z)).reshape(SHAPE)


# Name: heights. Pixels with gaps between them, and pixels that are not square, consist of smaller pixels.
HEIGHTS = {
    "random": 1e-6 * RNG.random((8, 8)),
    "gaps": np.kron(1e-6 * RNG.random((3, 3)), np.pad(np.ones((3, 3)), (0, 1))),
    "oblong": np.repeat(1e-6 * RNG.random((8, 4)), 2, axis=1),
    "three wavelengths": 0.5e-6 * RNG.integers(0, 2, (16, 16)),
}


@pytest.mark.fast_cases(2)
@pytest.mark.parametrize("name", HEIGHTS)
def test_pixels_are_sums_over_their_area(name):
    """The error stays below the prediction at every tolerance. Smooth heights through the same samples are rejected."""
    heights, radius, z = HEIGHTS[name], 12e-6, 60e-6
    exact = np.abs(behind_pixels(heights, radius, z, 10 + 100 // len(heights))) ** 2
    for tolerance, dtype in ((1e-2, "float32"), (1e-6, "float64")):
        elements = [Pupil(radius, PixelRelief(heights)), FreeSpace(z)]
        out = propagate_through(elements, **WINDOW, tolerance=tolerance, dtype=dtype)
        assert relative_l2(np.abs(out.u) ** 2, exact) < out.predicted_error < tolerance
    smooth = propagate_through([Pupil(radius, HeightMap(heights)), FreeSpace(z)], **WINDOW, tolerance=1e-2)
    assert relative_l2(np.abs(smooth.u) ** 2, exact) > 0.1


FIRST, GAP, RADIUS, BACK = 10e-6, 150e-6, 9e-6, 120e-6


def exact(decentre, tilt):
    """Return the field behind an aperture and misaligned pixels, by one sum over each of their planes."""
    nodes = optics.Circle().nodes(16.0, 7.0)
    first = FIRST * np.stack([nodes.x, nodes.y, 0 * nodes.x], axis=-1)
    x, y, size, row, column = pixel_nodes(4, 14)
    normal, second = tilted_disk(RADIUS * x, RADIUS * y, tilt)
    second += np.array([*decentre, GAP])
    arriving = kernel_sum(nodes.weight * FIRST**2, first, np.array([0, 0, 1.0]), second)
    light = arriving * np.exp(0.5j * K * LEVELS[row.astype(int), column.astype(int)])
    return kernel_sum(light * size * RADIUS**2, second, normal, at_window(GAP + BACK)).reshape(SHAPE)


def system(decentre, tilt, relief=PixelRelief, gap=GAP):
    moved = Misaligned(Pupil(RADIUS, relief(LEVELS)), decentre, tilt)
    return [Pupil(FIRST), FreeSpace(gap), moved, FreeSpace(BACK)]


@pytest.mark.fast_cases(1)
@pytest.mark.parametrize(
    ("decentre", "tilt", "tolerances"),
    [
        ((2e-6, -1e-6), (0.0, 0.0), (1e-2, 1e-5)),
        ((2e-6, -1e-6), (0.15, -0.12), (5e-2,)),
        ((0.0, 2e-6), (0.0, 0.05), (2e-2,)),
    ],
)
def test_misaligned_pixels_are_sums_over_planes_in_space(decentre, tilt, tolerances):
    expected = exact(decentre, tilt)
    for tolerance in tolerances:
        out = propagate_through(system(decentre, tilt), **WINDOW, tolerance=tolerance, dtype="float64")
        assert relative_l2(np.abs(out.u) ** 2, np.abs(expected) ** 2) < out.predicted_error < tolerance
        assert np.linalg.norm(out.u - expected) < tolerance * np.linalg.norm(expected)
    # The comparison rejects smooth heights, and the opposite misalignment.
    opposite = tuple(-d for d in decentre), tuple(-t for t in tilt)
    for wrong in (system(decentre, tilt, HeightMap), system(*opposite)):
        out = propagate_through(wrong, **WINDOW, tolerance=5e-2)
        assert relative_l2(np.abs(out.u) ** 2, np.abs(expected) ** 2) > 0.1


def test_equal_tilts_of_both_axes_mirror_a_symmetric_relief():
    """Both shears together treat x and y alike, although they are evaluated one after the other."""
    symmetric = LEVELS + LEVELS.T
    moved = Misaligned(Pupil(RADIUS, PixelRelief(symmetric)), tilt=(0.1, 0.1))
    where = WINDOW | {"out_shape": (19, 19)}
    u = propagate_through([Pupil(FIRST), FreeSpace(GAP), moved, FreeSpace(BACK)], **where, tolerance=5e-2).u
    assert np.linalg.norm(u - u.T) < 1e-5 * np.linalg.norm(u)


def test_batches_pass_pixels():
    systems = [system(((i - 1) * 1e-6, 0.0), (0.0, 0.0)) for i in range(3)]
    found = optics.propagate_through_batch(systems, **WINDOW, tolerance=1e-2)
    for elements, out in zip(systems, found, strict=True):
        alone = propagate_through(elements, **WINDOW, tolerance=1e-2)
        assert relative_l2(np.abs(out.u) ** 2, np.abs(alone.u) ** 2) < 1e-2


def test_backward_light_is_the_adjoint_of_forward_light():
    """The forward map F and the backward map B of fields of finite extent fulfil <v, F u> = <B v, u>."""
    at = (np.arange(65) - 32) * DX
    u, v = (
        np.exp(-np.add.outer((at - y) ** 2, (at - x) ** 2) / (4e-6) ** 2).astype(complex)
        for x, y in ((0, 0), (6e-6, -3e-6))
    )
    elements = [FreeSpace(80e-6), Pupil(30e-6, PixelRelief(1e-6 * RNG.random((8, 8)))), FreeSpace(80e-6)]
    settings = {"wavelength": WAVELENGTH, "dx": DX, "tolerance": 1e-3}
    there, back = (
        propagate_through(elements, field, **settings, backward=backward).u
        for field, backward in ((u, False), (v, True))
    )
    size = np.linalg.norm(v) * np.linalg.norm(there)
    assert np.vdot(v, there) == pytest.approx(np.vdot(back, u), abs=1e-3 * size)
    assert abs(np.vdot(v, there)) > 0.01 * size  # the comparison can fail


def test_level_pixels_change_nothing_and_one_large_pixel_only_the_phase():
    plain = propagate_through([Pupil(RADIUS), FreeSpace(BACK)], **WINDOW, tolerance=1e-5, dtype="float64")
    for pupil in (Pupil(RADIUS, PixelRelief(LEVELS), n=1.0), Pupil(RADIUS, PixelRelief(np.ones((1, 1))))):
        out = propagate_through([pupil, FreeSpace(BACK)], **WINDOW, tolerance=1e-5, dtype="float64")
        assert relative_l2(np.abs(out.u) ** 2, np.abs(plain.u) ** 2) < 1e-7
    lens = Pupil(RADIUS, PixelRelief(LEVELS), thin_lens_focal_length=BACK, mask=optics.GaussianMask(8e-6))
    psf = optics.psf(lens, [WAVELENGTH], BACK, dx=DX, shape=SHAPE, tolerance=1e-6, dtype="float64").psf[0]
    out = propagate_through([lens, FreeSpace(BACK)], **WINDOW, tolerance=1e-4, dtype="float64")
    assert relative_l2(np.abs(out.u) ** 2 / lens.area, psf) < out.predicted_error < 1e-4


def test_impossible_requests_are_refused():
    import drjit as dr

    from optics.numerics.precision import precision

    u = np.ones((9, 9), complex)
    pixels = PixelRelief(LEVELS)
    with pytest.raises(ValueError, match="a PixelRelief lies in the plane of the output: put FreeSpace"):
        propagate_through([FreeSpace(GAP), Pupil(RADIUS, pixels)], u, wavelength=WAVELENGTH, dx=DX)
    with pytest.raises(optics.AccuracyError, match=r"1500 x 1500 pixels .* more than 4096 nodes across"):
        propagate_through([Pupil(RADIUS, PixelRelief(RNG.random((1500, 1500)) * 1e-6)), FreeSpace(GAP)], **WINDOW)
    radius = precision("float64").Float64(RADIUS)
    dr.enable_grad(radius)
    with pytest.raises(ValueError, match="aperture_radius: must be a plain number for a PixelRelief"):
        propagate_through([Pupil(radius, pixels), FreeSpace(GAP)], **WINDOW)


@pytest.mark.parametrize("ripple", [1e-3, 1e-6, 1e-12])
@pytest.mark.parametrize("passband", [0.0, 3.0, 200.0])
def test_the_kernel_passes_its_passband_and_nothing_beyond_its_stopband(passband, ripple):
    edge = SoftEdge.cheapest(passband, ripple, 0.25)
    x, weight = leggauss(int(600 + 40 * edge.cycles))
    kernel = edge.line(x * edge.reach) * weight * edge.reach
    low, high = np.linspace(0, passband, 60), np.linspace(edge.stopband, 3 * edge.stopband, 120)
    passed, stopped = (np.cos(2 * np.pi * np.outer(f, x * edge.reach)) @ kernel for f in (low, high))
    assert np.abs(passed - 1).max() < ripple
    assert np.abs(stopped).max() < ripple
    inside = np.linspace(0, edge.stopband, 50)
    direct = np.cos(2 * np.pi * np.outer(inside, x * edge.reach)) @ kernel
    np.testing.assert_allclose(edge.line_response(inside), direct, atol=1e-13)
