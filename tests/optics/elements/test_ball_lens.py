"""Gradient-index ball lenses: closed forms of Luneburg and Maxwell, rays by an ODE solver, and the wavefront."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import optics
from optics import BallLens
from optics.elements.ball_lens import _profile
from optics.elements.refractive_index import medium

R = 1e-3
HEIGHTS = np.array([0.05, 0.3, 0.6, 0.9]) * R


def test_a_focal_ratio_of_one_is_luneburgs_closed_form():
    u = np.linspace(0, 1, 12)
    np.testing.assert_allclose(BallLens.luneburg(R, 1.2).index(u * R), 1.2 * np.sqrt(2 - u * u), atol=1e-10)


@pytest.mark.parametrize("ratio", [1.0, 1.4, 2.5])
def test_generalised_luneburg_lenses_focus_all_heights_at_one_point(ratio):
    lens = BallLens.luneburg(R, 1.333, ratio)
    np.testing.assert_allclose(lens.focus(HEIGHTS), ratio * R, rtol=1e-7)
    assert lens.focal_length() == pytest.approx(ratio * R, rel=1e-7)


def test_maxwells_lens_images_its_surface_on_the_opposite_point():
    np.testing.assert_allclose(BallLens.maxwell(R, 1.1).turning(HEIGHTS), math.pi, atol=1e-7)


def test_a_glass_ball_has_the_textbook_focal_length_and_refracts_by_snells_law():
    lens = BallLens(R, 1.5, 1.5, 1.0)
    assert lens.focal_length() == pytest.approx(1.5 * R / (2 * 0.5))
    sine = HEIGHTS / R
    np.testing.assert_allclose(lens.deviation(HEIGHTS), 2 * (np.arcsin(sine) - np.arcsin(sine / 1.5)), rtol=1e-9)


def traced(lens, height):
    """Return the direction [rad] towards the axis and the optical path of a ray behind the lens, by d/ds (n dx/ds) =
    grad n.
    """
    entry = np.array([-math.sqrt(R * R - height * height), height])
    normal = entry / R
    relative = float(lens.index(R)) / float(lens.medium_n)
    sine = np.array([1.0, 0.0]) - normal * normal[0]  # part of the direction along the surface
    inside = sine / relative
    direction = inside - normal * math.sqrt(1 - inside @ inside)

    def slopes(_, state):  # with dt = ds / n: dx/dt = n dx/ds = v, dv/dt = n grad n
        r = min(math.hypot(*state[:2]), R)
        step = 1e-6 * R
        n, bend = float(lens.index(r)), float(lens.index(r) - lens.index(r - step)) / step
        return [state[2], state[3], n * bend * state[0] / r, n * bend * state[1] / r, n * n]

    def outside(_, state):
        return math.hypot(*state[:2]) - R * (1 + 1e-12)

    outside.terminal, outside.direction = True, 1
    start = [*entry * (1 - 1e-9), *direction * float(lens.index(R)), 0.0]
    found = solve_ivp(slopes, (0, 5 * R), start, events=outside, rtol=1e-10, atol=1e-14).y[:, -1]
    normal, velocity = found[:2] / R, found[2:4] / float(lens.index(R))
    along = velocity - normal * (velocity @ normal)
    leaving = along * relative
    leaving = leaving + normal * math.sqrt(1 - leaving @ leaving)
    return -math.atan2(leaving[1], leaving[0]), found[4]


def test_rays_agree_with_an_ode_solver():
    lens = BallLens(R, 1.5, 1.38, 1.336, lambda u: 1 - 0.7 * u**2 - 0.3 * u**6)
    for height in (0.2 * R, 0.75 * R):
        angle, path = traced(lens, height)
        assert float(lens.deviation(height)) == pytest.approx(angle, rel=2e-5)
        inside = _profile(lens, 550e-9).path(np.array([height / R]))[0] * 1.336 * R
        assert path == pytest.approx(inside, rel=1e-6)


def test_the_wavefront_of_a_perfect_lens_is_flat_and_its_psf_that_of_an_ideal_lens():
    pupil = BallLens.luneburg(R, 1.336, 2.5).pupil(0.2 * R)
    assert max(map(abs, pupil.wavefront.modes.values())) < 1e-5  # [µm]
    assert pupil.image_distance(math.inf) == pytest.approx(2.5 * R, rel=1e-7)
    sine = 0.2 / 2.5  # Abbe's sine condition
    assert pupil.radius == pytest.approx(2.5 * R * sine / math.sqrt(1 - sine**2), rel=1e-6)
    result = optics.psf(pupil, [550e-9])
    assert optics.strehl_ratio(result) == pytest.approx(1, abs=2e-3)


def test_the_wavefronts_slope_is_the_longitudinal_aberration():
    """A ray at the height x, at which the wavefront is ahead by W, crosses the axis at the distance z with n/z = n/f +
    W'/x, up to the fourth order in x/f.
    """
    lens = BallLens(R, 1.5, 1.5, 1.0)
    pupil, focal = lens.pupil(0.1 * R), lens.focal_length()
    x = np.linspace(0.098, 0.1, 3) * R
    ahead, edge = pupil.wavefront.ahead, pupil.radius
    values = ahead(x / edge, np.zeros(3))
    slope = (values[2] - values[0]) / (x[2] - x[0])
    expected = 1 / (1 / focal + slope / x[1])
    shift = float(lens.focus(0.099 * R)) - focal
    assert shift < 0
    assert expected - focal == pytest.approx(shift, rel=0.02)


def test_dispersion_moves_the_focus():
    water = medium("water")
    plain = BallLens.luneburg(R, 1.333, 2.5)
    core = optics.RefractiveIndex.from_abbe(float(plain.core_n), 50.0)
    lens = BallLens(R, core, water, water, plain.shape)
    assert lens.focal_length(450e-9) < lens.focal_length(550e-9) < lens.focal_length(650e-9)
    assert lens.pupil(0.3 * R, 450e-9).thin_lens_focal_length == lens.focal_length(450e-9)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"radius": -1.0}, "radius"),
        ({"core_n": 0.5}, "core_n"),
        ({"shape": 3}, "shape"),
        ({"shape": lambda u: 1 + u}, "shape"),
        (
            {"core_n": 6.0, "surface_n": 2.0, "medium_n": 1.0, "shape": lambda u: (1 - u**2) * (1 - 8 * u**2)},
            "must grow",
        ),
    ],
)
def test_invalid_lenses_raise_one_line(change, message):
    with pytest.raises(ValueError, match=message) as error:
        BallLens(**{"radius": R, "core_n": 1.5, "surface_n": 1.38, "medium_n": 1.336, **change})
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("height", [0.0, R, 2 * R, math.nan])
def test_rays_must_hit_the_lens(height):
    with pytest.raises(ValueError, match="height"):
        BallLens.maxwell(R).focus(height)


def test_lenses_that_scatter_light_have_no_focal_length():
    with pytest.raises(ValueError, match="focuses"):
        BallLens(R, 1.34, 1.34, 1.4).focal_length()
    with pytest.raises(ValueError, match="surface_n"):
        BallLens(R, 1.3, 1.3, 1.4).focus(0.95 * R)
    with pytest.raises(ValueError, match="focal_ratio"):
        BallLens.luneburg(R, 1.3, 0.5)
