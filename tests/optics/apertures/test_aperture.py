"""Every aperture against its closed Fourier transform: softened on a grid, and as quadrature nodes."""

import drjit as dr
import numpy as np
import pytest
from scipy.special import j0, j1

from optics.apertures.circular import Annulus, Circle
from optics.apertures.polygonal import Polygon, Slit
from optics.numerics.precision import precision
from optics.numerics.quadrature import gauss_legendre
from validation.reference.apertures import annulus_spectrum, disk_spectrum, polygon_spectrum, rectangle_spectrum

TYPES = precision("float64")
STAR = [(r * np.cos(a), r * np.sin(a)) for r, a in zip(5 * [1, 0.4], np.arange(10) * np.pi / 5 + 0.1, strict=True)]
U_SHAPE = [(-0.6, -0.6), (0.6, -0.6), (0.6, 0.6), (0.4, 0.6), (0.4, -0.4), (-0.4, -0.4), (-0.4, 0.6), (-0.6, 0.6)]
SHAPES = {
    "circle": Circle(),
    "annulus": Annulus(0.4),
    "thin annulus": Annulus(0.95),
    "central stop": Annulus(0.05),
    "triangle": Polygon.regular(3, 20),
    "hexagon": Polygon.regular(6, 11),
    "clockwise L": Polygon([(-0.6, 0.6), (0, 0.6), (0, 0), (0.6, 0), (0.6, -0.6), (-0.6, -0.6)]),
    "star": Polygon(STAR),
    "U": Polygon(U_SHAPE),
    "sliver": Polygon([(-0.9, 0.0), (0.9, 0.01), (0.9, 0.03)]),
    "slit": Slit(0.1, 1.8),
    "square": Slit(1.2, 1.2),
}
shapes = pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES.keys())


def closed_spectrum(shape, fx, fy):
    if isinstance(shape, Circle):
        return disk_spectrum(fx, fy)
    if isinstance(shape, Annulus):
        return annulus_spectrum(fx, fy, shape.inner)
    if isinstance(shape, Slit):
        return rectangle_spectrum(fx, fy, shape.width, shape.height)
    return polygon_spectrum(fx, fy, shape.vertices)


def frequencies(lowest, highest, n=60):
    """Return random frequency vectors with lengths from `lowest` to `highest`; the seed is fixed."""
    angle = np.random.default_rng(0).uniform(0, 2 * np.pi, n)
    f = np.linspace(lowest, highest, n)
    return f * np.cos(angle), f * np.sin(angle)


def at(soft, x, y):
    x, y = np.broadcast_arrays(x, y)
    return soft.transmittance(TYPES.Float64(x.ravel()), TYPES.Float64(y.ravel()), TYPES).numpy().reshape(x.shape)


def grid_spectrum(soft, fx, fy, rate):
    n = int((1 + soft.reach) * rate + 2)
    x = (np.arange(-n, n + 1) + 0.3) / rate  # an offset, so that symmetry of shape and grid cannot hide errors
    sampled = at(soft, x[None, :], x[:, None])
    waves_x, waves_y = np.exp(-2j * np.pi * np.outer(fx, x)), np.exp(-2j * np.pi * np.outer(fy, x))
    return np.einsum("fy,yx,fx->f", waves_y, sampled, waves_x) / rate**2


@pytest.mark.fast_cases(12)
@shapes
@pytest.mark.parametrize(("ripple", "passband"), [(1e-3, 6.0), (1e-6, 2.0), (1e-8, 15.0), (1e-10, 4.0)])
def test_spectrum_is_the_closed_form_then_nothing(shape, ripple, passband):
    """Samples are as far apart as the stopband allows. If the edge is soft, the aliases lie outside the passband."""
    soft = shape.soften(passband, ripple)
    fx, fy = frequencies(1e-3, passband)
    error = grid_spectrum(soft, fx, fy, soft.passband + soft.stopband) - closed_spectrum(shape, fx, fy)
    assert np.abs(error).max() < ripple * max(shape.area, 0.3)
    beyond = frequencies(soft.stopband, 1.3 * soft.stopband)
    assert np.abs(grid_spectrum(soft, *beyond, 3 * soft.stopband)).max() < ripple * max(shape.area, 0.3)


@shapes
def test_hard_edge_fails_the_same_test(shape):
    soft = shape.soften(6.0, 1e-3)
    fx, fy = frequencies(1e-3, 6.0)
    rate = soft.passband + soft.stopband
    n = int(rate + 2)
    x = (np.arange(-n, n + 1) + 0.3) / rate
    sampled = shape.contains(x[None, :], x[:, None])
    waves = np.exp(-2j * np.pi * fx[:, None] * x), np.exp(-2j * np.pi * fy[:, None] * x)
    spectrum = np.einsum("fy,yx,fx->f", waves[1], sampled, waves[0]) / rate**2
    assert np.abs(spectrum - closed_spectrum(shape, fx, fy)).max() > 3e-3 * max(shape.area, 0.3)


def distance_to_edge(shape, x, y):
    if isinstance(shape, Circle | Annulus):
        radii = [1.0] if isinstance(shape, Circle) else [shape.inner, 1.0]
        return np.min([np.abs(np.hypot(x, y) - radius) for radius in radii], axis=0)
    vertices = shape.soften(1.0, 0.1).vertices
    distances = []
    for v, w in zip(vertices, np.roll(vertices, -1, axis=0), strict=True):
        t = np.clip(((x - v[0]) * (w - v)[0] + (y - v[1]) * (w - v)[1]) / np.sum((w - v) ** 2), 0, 1)
        distances.append(np.hypot(x - v[0] - t * (w - v)[0], y - v[1] - t * (w - v)[1]))
    return np.min(distances, axis=0)


@shapes
def test_one_or_zero_beyond_the_reach(shape):
    soft = shape.soften(20.0, 1e-4)
    x, y = np.random.default_rng(1).uniform(-1.3, 1.3, (2, 3000))
    distance, error = distance_to_edge(shape, x, y), np.abs(at(soft, x, y) - shape.contains(x, y))
    assert (distance > soft.reach).sum() > 300
    assert error[distance > soft.reach].max() < 1e-12
    assert error[distance < soft.reach / 4].max() > 0.1


@pytest.mark.fast_cases(14)
@shapes
@pytest.mark.parametrize(
    ("cycles", "digits"), [(0.3, 12), (0.5, 12), (3.0, 3), (3.0, 6), (3.0, 10), (25.0, 4), (25.0, 9)]
)
def test_nodes_integrate_plane_waves(shape, cycles, digits):
    nodes = shape.nodes(cycles, digits)
    assert len(nodes) == len(nodes.x) == len(nodes.y)
    assert shape.node_count(cycles, digits) in (len(nodes), None)
    assert shape.contains(nodes.x, nodes.y).all()
    slow, fast = frequencies(cycles / 60, cycles), frequencies(cycles, cycles)
    fx, fy = (np.concatenate(both) for both in zip(slow, fast, strict=True))
    waves = np.exp(-2j * np.pi * (np.outer(fx, nodes.x) + np.outer(fy, nodes.y))) @ nodes.weight
    assert np.abs(waves - closed_spectrum(shape, fx, fy)).max() < 10.0**-digits * shape.area
    assert nodes.weight.sum() == pytest.approx(shape.area, rel=10.0**-digits)


@pytest.mark.fast_cases(3)
@pytest.mark.parametrize("name", ["circle", "annulus", "hexagon", "U", "slit"])
@pytest.mark.parametrize(("cycles", "digits"), [(10.0, 6), (40.0, 9)])
def test_nodes_are_not_wasted(name, cycles, digits):
    """A rule with 30 % fewer nodes misses the requested digits."""
    shape = SHAPES[name]
    enough, digits_left = len(shape.nodes(cycles, digits)), digits
    while len(nodes := shape.nodes(cycles, digits_left)) > 0.7 * enough:
        digits_left -= 0.2
    fx, fy = frequencies(cycles / 60, cycles)
    waves = np.exp(-2j * np.pi * (np.outer(fx, nodes.x) + np.outer(fy, nodes.y))) @ nodes.weight
    assert np.abs(waves - closed_spectrum(shape, fx, fy)).max() > 10.0**-digits * shape.area


@pytest.mark.parametrize("name", ["circle", "central stop", "hexagon", "star", "slit"])
@pytest.mark.parametrize("mode", ["forward", "backward"])
def test_derivatives(name, mode):
    """The reference is a fourth-order difference, also at the centre, on an edge and at a corner."""
    shape = SHAPES[name]
    soft = shape.soften(10.0, 1e-8)
    corners = soft.vertices if name not in ("circle", "central stop") else np.array([[1.0, 0.0], [0.05, 0.0]])
    special = np.concatenate([corners, [[0.0, 0.0]], [(corners[0] + corners[1]) / 2]])
    x, y = np.concatenate([np.random.default_rng(2).uniform(-1.1, 1.1, (400, 2)), special]).T
    h = 1e-3 / soft.stopband
    steps = ((1, 2 / 3), (-1, -2 / 3), (2, -1 / 12), (-2, 1 / 12))
    for along in (0, 1):
        expected = sum(c * at(soft, x + k * h * (1 - along), y + k * h * along) for k, c in steps) / h
        point = TYPES.Float64(x), TYPES.Float64(y)
        dr.enable_grad(point[along])
        value = soft.transmittance(*point, TYPES)
        if mode == "forward":
            dr.forward(point[along])
            slope = dr.grad(value)
        else:
            dr.backward(dr.sum(value))
            slope = dr.grad(point[along])
        assert np.abs(slope.numpy() - expected).max() < 1e-6 * np.abs(expected).max()


def test_power_of_the_soft_disk():
    """The sum of squares over the grid equals the integral of the squared spectrum (Parseval's theorem). The spectrum
    is the product of the disk's spectrum and the kernel's.
    """
    soft = Circle().soften(5.0, 1e-6)
    rate = 2.01 * soft.stopband
    x = np.arange(-int(1.3 * rate), int(1.3 * rate) + 1) / rate
    u, weight = gauss_legendre(400)
    f, r = soft.stopband * u, soft.reach * u
    kernel = j0(2 * np.pi * np.outer(f, r)) @ (soft.reach * weight * soft.edge.ring(r))
    power = np.sum(2 * np.pi * f * (j1(2 * np.pi * f) / f * kernel) ** 2 * weight * soft.stopband)
    assert np.sum(at(soft, x[None, :], x[:, None]) ** 2) / rate**2 == pytest.approx(power, rel=1e-6)
    assert power < 0.995 * np.pi


def test_ripple_converges():
    """The error against the closed form falls with the ripple."""
    fx, fy = frequencies(0.1, 5.0)
    shape = SHAPES["star"]
    errors = []
    for ripple in (1e-2, 1e-4, 1e-6, 1e-8):
        soft = shape.soften(5.0, ripple)
        spectrum = grid_spectrum(soft, fx, fy, soft.passband + soft.stopband)
        errors.append(np.abs(spectrum - closed_spectrum(shape, fx, fy)).max() / ripple)
    assert max(errors) < shape.area
    assert min(errors) > 1e-4
