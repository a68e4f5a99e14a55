"""Parts of the light that arrives on a plane, from given numbers."""

import math
from types import SimpleNamespace

import drjit as dr
import numpy as np
import pytest

import optics
from optics.apertures.aperture import Nodes
from optics.numerics.precision import precision
from optics.point_spread import arriving
from tests.optics.point_spread.test_psf_result import WAVES, requests, result

TYPES = precision("float64")
RNG = np.random.default_rng(2)
NARROW = optics.Pupil(2e-6, aperture=optics.Annulus(0.5), mask=optics.MaskMap(np.full((4, 4), 0.5)))
# The mask is even, so that its transmission along the edge is that of the whole aperture, 1/4.
EDGE = WAVES * 1.5 / 0.75 / (math.pi**2 * 2e-6)


def not_evanescent(monkeypatch, tilted, bent, sums, shares=None, pupil=NARROW):
    """Return the light that arrives and its uncertainty, from given parts of each request."""
    asked = []
    own = result(pupil=pupil, requests=requests(*WAVES), shares=shares)
    monkeypatch.setattr(type(own), "can_recompute", True)

    def part(values):
        return lambda request: values[list(WAVES).index(request.beam.wavelength)]

    monkeypatch.setattr(arriving, "_at_edge", lambda request: TYPES.Float(part(tilted)(request)))
    monkeypatch.setattr(arriving, "_bent_beyond_grazing", part(bent))
    monkeypatch.setattr(arriving, "_summed", lambda request, unsure: asked.append(unsure) or part(sums)(request))
    light, unsure = arriving._not_evanescent(own)
    return light.numpy(), unsure, asked


TILTED, BENT = np.array([1.5, 2.0, 3.0]), [(0.1, 0.05), (0.2, 0.0), (0.0, 0.3)]


def test_the_estimate_for_oblique_rays(monkeypatch):
    found, unsure, asked = not_evanescent(monkeypatch, TILTED, BENT, [None] * 3)
    np.testing.assert_allclose(found, 0.25 * (1 - EDGE * TILTED) * (1 - np.array([0.1, 0.2, 0])), rtol=1e-4)
    expected = 0.25 * ((EDGE * TILTED) ** 2 + EDGE * (TILTED - 1) + np.array([0.05, 0, 0.3]))
    np.testing.assert_allclose(unsure, expected, rtol=1e-4)
    assert asked == pytest.approx([max(expected)] * 3, rel=1e-4)


def test_estimates_of_very_oblique_rays_are_limited(monkeypatch):
    """The edge loses at most half of the light, and the doubt is at most one half as well."""
    found, unsure, _ = not_evanescent(monkeypatch, [1e3, 1e3, 2.0], [(0.0, 0.0)] * 3, [None] * 3)
    np.testing.assert_allclose(found, 0.25 * (1 - np.array([0.5, 0.5, 2 * EDGE[2]])), rtol=1e-4)
    np.testing.assert_allclose(unsure[:2], [0.25 * 0.75] * 2, rtol=1e-4)


def test_sums_replace_uncertain_estimates(monkeypatch):
    sums = [TYPES.Float(at) for at in (0.5, 0.6, 0.7)]
    found, unsure, _ = not_evanescent(monkeypatch, TILTED, BENT, sums)
    np.testing.assert_allclose(found, [0.5, 0.6, 0.7])
    np.testing.assert_allclose(unsure, [1e-4] * 3)
    estimate, doubt, _ = not_evanescent(monkeypatch, TILTED, BENT, [*sums[:2], None])
    np.testing.assert_allclose(estimate, not_evanescent(monkeypatch, TILTED, BENT, [None] * 3)[0])
    assert doubt.min() > 1e-4


def test_certain_estimates_need_no_sum(monkeypatch):
    wide = optics.Pupil(1e-3)
    found, unsure, asked = not_evanescent(monkeypatch, [1.0] * 3, [(0.0, 1e-5)] * 3, None, pupil=wide)
    assert asked == []
    np.testing.assert_allclose(unsure, 1e-5, rtol=1e-3)
    np.testing.assert_allclose(1 - found, WAVES / (math.pi**2 * 1e-3), rtol=1e-5)
    monkeypatch.setattr(arriving, "SURE", float(unsure.max()))
    assert not_evanescent(monkeypatch, [1.0] * 3, [(0.0, 1e-5)] * 3, None, pupil=wide)[2] == []
    monkeypatch.setattr(arriving, "SURE", 1e-4)
    _, unsure, asked = not_evanescent(
        monkeypatch, [1.0] * 3, [(0.0, 1e-5), (0.0, 2e-4), (0.0, 0.0)], [TYPES.Float(1.0)] * 3, pupil=wide
    )
    assert len(asked) == 3
    np.testing.assert_allclose(unsure, [1e-5, 1e-4, 0], atol=1e-8)


def test_means_over_requests():
    for shares, expected in ((None, [1.0, 2.0, 4.0]), (np.array([0.5, 0.25, 0.25]), [2.0])):
        own = SimpleNamespace(shares=shares)
        found = arriving._mean(own, [TYPES.Float(at) for at in (1.0, 2.0, 4.0)])
        np.testing.assert_allclose(found.numpy(), expected)
        np.testing.assert_allclose(arriving._mean_number(own, [1.0, 2.0, 4.0]), expected)
    own = SimpleNamespace(shares=None)
    assert arriving._mean(own, [TYPES.Float(3.0)]).numpy().tolist() == [3]
    pairs = arriving._mean_number(SimpleNamespace(shares=np.array([0.5, 0.5])), [(1.0, 2.0), (3.0, 6.0)])
    np.testing.assert_allclose(pairs.T, [2, 4])


@pytest.mark.parametrize(("sine", "steepest"), [((0.3, -0.4), False), ((0.9, 0.6), True)])
def test_light_at_the_edge_of_a_parallelogram(sine, steepest):
    """The corners of a parallelogram are few, so that reflected normals would give another mean. The squared sine is
    at most 0.96, also along the normal.
    """
    corners = np.array([[0.5, 0.3], [-0.2, 0.6], [-0.5, -0.3], [0.2, -0.6]])
    beam = SimpleNamespace(
        pupil=SimpleNamespace(aperture_radius=2e-6), waves=lambda x, y: (sine[0] * x + sine[1] * y) / 4e-7
    )
    outline = SimpleNamespace(points=lambda: np.tile(corners, (4, 1)))
    problem = SimpleNamespace(wavelength=4e-7, aperture=SimpleNamespace(outline=outline))
    found = arriving._at_edge(SimpleNamespace(beam=beam, problem=problem)).numpy()
    along = np.roll(corners, -1, axis=0) - np.roll(corners, 1, axis=0)
    along /= np.hypot(*along.T)[:, None]
    square = min(sine[0] ** 2 + sine[1] ** 2, 0.96)
    normal = np.minimum((sine[0] * along[:, 1] - sine[1] * along[:, 0]) ** 2, square)
    assert (square == 0.96) == steepest
    assert found == pytest.approx(np.mean(np.sqrt(normal + 1 - square) / (1 - square)), rel=1e-6)


def test_rays_beyond_grazing():
    """Sines are divided by the index. Diffraction spreads light over sines of √(λ/R) = 0.25."""
    slopes = SimpleNamespace(
        distance_from_axis=np.array([0.1, 1.0, 0.5, 0.2, 1.1]),
        radius=1.0,
        along_x=np.array([0.0, 1.2, 0.9, 0.6, 9.0]),
        along_y=np.array([0.4, 0.9, -1.2, 0.9, 9.0]),
    )
    asked = []
    pupil = SimpleNamespace(slopes=lambda *given: asked.append(given) or slopes)
    beam = SimpleNamespace(pupil=pupil, wavelength=5e-7, source="source", index=1.5)
    request = SimpleNamespace(beam=beam, problem=SimpleNamespace(wavelength=1.0, radius=16.0))
    # Sines of 0.27, 1, 1 and 0.72; only the first and the last are below 1, and below 0.75.
    assert arriving._bent_beyond_grazing(request) == (0.5, 0.5)
    slopes.along_y[3] = 1.0
    assert arriving._bent_beyond_grazing(request) == (0.5, 0.75)
    assert asked[0] == (5e-7, "source")


@pytest.mark.parametrize(
    ("change", "summed"),
    [
        ({}, True),
        ({"nodes": 2000, "counted": 2000}, True),
        ({"nodes": 2001, "counted": 1}, False),
        ({"nodes": 1, "counted": 2001}, False),
        ({"nodes": 2000, "counted": None}, True),
        ({"nodes": 200, "counted": 200, "unsure": 1e-4}, True),
        ({"nodes": 201, "counted": 201, "unsure": 1e-4}, False),
        ({"nodes": 2001, "counted": 2001, "unsure": 1.0}, False),
        ({"radius": 100.0, "phase_band": 0.0}, True),
        ({"radius": 100.1, "phase_band": 0.0}, False),
        ({"radius": 10.0, "phase_band": 9.0}, True),
        ({"radius": 10.0, "phase_band": 9.1}, False),
        ({"pixelated": 1}, False),
    ],
)
def test_sums_that_are_worth_their_time(monkeypatch, change, summed):
    """A sum has at most 2e8 pairs of nodes and frequencies, here 100,000 frequencies."""
    given = {"radius": 10.0, "phase_band": 5.0, "nodes": 10, "counted": 10, "pixelated": None, "unsure": 1e-3} | change
    asked = []
    aperture = SimpleNamespace(
        area=4.0,
        node_count=lambda phase, digits: asked.append((phase, digits)) or given["counted"],
        nodes=lambda phase, digits: (
            asked.append((phase, digits)) or SimpleNamespace(x=1, y=2, weight=range(given["nodes"]))
        ),
    )
    problem = SimpleNamespace(
        aperture=aperture, wavelength=1.0, **{name: given[name] for name in ("radius", "phase_band", "pixelated")}
    )

    class Everywhere:
        def nodes(self, cycles, digits):
            asked.append((cycles, digits))
            return SimpleNamespace(weight=range(10**5))

    def from_beam(beam, *others, derivatives):
        assert (beam, others, derivatives) == ("beam", ("window", 1e-3, "float64"), False)
        return problem

    monkeypatch.setattr(arriving, "Circle", Everywhere)
    monkeypatch.setattr(arriving, "Problem", SimpleNamespace(from_beam=from_beam))
    monkeypatch.setattr(arriving._Sum, "fraction", lambda self, beam, wavelength: 2.0 * wavelength)
    own = SimpleNamespace(window="window", tolerance=1e-3, dtype="float64")
    found = arriving._summed(SimpleNamespace(beam="beam", problem=own), given["unsure"])
    assert found == (0.5 if summed else None)
    if summed:
        phase = given["radius"] * (1 + given["phase_band"])
        assert asked == [(phase, 5.0), (2 * given["radius"], 5.0), (phase, 5.0)]


POINTS, FREQUENCIES = RNG.random((3, 5)), RNG.random((3, 4))


def fraction(radius, tilt, waist, masked):
    """Return the light of five nodes at four frequencies. The waves of the beam depend on its tilt."""
    types = TYPES.Float64
    pupil = SimpleNamespace(
        aperture_radius=radius, mask=masked or None, amplitude=lambda x, y: dr.exp(-(x * x + y) / types(waist))
    )
    beam = SimpleNamespace(pupil=pupil, waves=lambda x, y: types(tilt) * (x + 2 * y * y) + 0.3 * x)
    return arriving._Sum(*POINTS, Nodes(*FREQUENCIES)).fraction(beam, 0.5)


def exact_fraction(radius, tilt, waist, masked):
    (x, y, u), (sx, sy, w) = POINTS, FREQUENCIES
    h, waves = radius / 0.5, tilt * (x * radius + 2 * (y * radius) ** 2) + 0.3 * x * radius
    light = u * np.exp(-(x * x + y) / waist) if masked else u
    turns = waves - h * (np.outer(sx, x) + np.outer(sy, y))
    return h**2 * (w * abs((light * np.exp(2j * math.pi * turns)).sum(axis=1)) ** 2).sum()


@pytest.mark.parametrize("masked", [False, True])
def test_the_power_of_some_frequencies_and_its_derivatives(masked):
    at = [0.7, 1.3, 0.9]
    exact = exact_fraction(*at, masked)
    assert fraction(*map(TYPES.Float64, at), masked).numpy() == pytest.approx(exact)
    for k in range(3 if masked else 2):
        given = [TYPES.Float64(one) for one in at]
        dr.enable_grad(given[k])
        found = fraction(*given, masked)
        assert found.numpy() == pytest.approx(exact)
        dr.backward(found)
        step = 1e-5
        above, below = (
            exact_fraction(*(one + sign * step * (i == k) for i, one in enumerate(at)), masked) for sign in (1, -1)
        )
        assert dr.grad(given[k]).numpy() == pytest.approx((above - below) / (2 * step), rel=1e-5)
