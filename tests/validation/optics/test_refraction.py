"""Rays through a real surface: Snell's law, and the rays that hit the surface twice."""

import numpy as np
import pytest

from validation.optics import refraction


@pytest.mark.parametrize("slope", [0.0, 0.1, -0.4, 0.85])
def test_snells_law_and_unit_length(slope):
    """The angles to the normal satisfy n sin i = sin t. The ray stays in the plane of incidence, and is deflected
    towards the thicker glass.
    """
    tx, tz = refraction.refract(np.array(slope), 1.5)
    normal = np.array([-slope, 1]) / np.hypot(slope, 1)
    assert np.hypot(tx, tz) == pytest.approx(1)
    assert abs(tx * normal[1] - tz * normal[0]) == pytest.approx(1.5 * abs(normal[0]))
    assert np.sign(tx) == np.sign(slope)


def test_ray_and_closed_form_agree_and_end_at_the_critical_angle():
    for degrees in (5, 20, 41):
        angle = np.deg2rad(degrees)
        tx, tz = refraction.refract(np.tan(angle), 1.5)
        assert np.arctan2(tx, tz) == pytest.approx(refraction.deviation_glass_first(angle, 1.5))
    beyond = np.arcsin(1 / 1.5) + 1e-6
    assert np.isnan(refraction.refract(np.tan(beyond), 1.5)[0])
    assert np.isnan(refraction.deviation_glass_first(beyond, 1.5))
    assert refraction.transmission(beyond, 1.5) == 0


def test_all_three_prisms_agree_for_small_angles():
    angle = 1e-4
    deviations = [f(angle, 1.5) for f in (refraction.deviation_glass_first, refraction.deviation_relief_first)]
    assert deviations == pytest.approx([refraction.thin_deviation(angle, 1.5)] * 2, rel=1e-7)


def test_transmission_has_its_known_values():
    """Glass with n = 1.5 reflects 4 % of the light at normal incidence, and no p-polarised light at Brewster's angle
    arctan(1/n).
    """
    assert refraction.transmission(0.0, 1.5) == pytest.approx(0.96)
    brewster = np.arctan(1 / 1.5)
    s = np.sin(2 * brewster - np.pi / 2) ** 2
    assert refraction.transmission(brewster, 1.5) == pytest.approx(1 - s / 2)


def test_no_ray_leaves_a_gentle_surface_twice_and_some_leave_a_steep_one():
    assert refraction.corrugation(0.1, 1.5).caught == 0
    steep = refraction.corrugation(1.0, 1.5)
    assert steep.caught > 0
    # Light is totally reflected if |cos 2πx| > tan(critical) / (π depth).
    critical = np.tan(np.arcsin(1 / 1.5)) / np.pi
    assert steep.reflected == pytest.approx(2 / np.pi * np.arccos(critical), abs=1e-3)


def test_a_slow_real_lens_is_ideal_and_its_height_is_the_sag():
    lens = refraction.real_lens(0.05, 240e-6, 1.5, 550e-9)
    assert lens.strehl == pytest.approx(1, abs=1e-5)
    assert lens.height == pytest.approx((0.05 * 240e-6) ** 2 / (2 * 240e-6 * 0.5), rel=5e-3)
