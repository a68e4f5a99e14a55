"""Rotationally symmetric pictures along one radius: enough points, and none where they would not pay."""

import math

import numpy as np
import pytest

import optics
from optics import Pupil
from optics.numerics.radial_profile import RadialProfile
from validation.reference import circular_aperture_on_axis, ideal_lens_field, relative_l2


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6])
def test_obliquity_alone_is_resolved(tolerance):
    """A hole far below the wavelength has no fringes: all that the line must carry is z²/(z² + r²)², here to 66°."""
    asked = {"dx": 2e-4, "shape": (17, 17), "tolerance": tolerance, "dtype": "float64"}
    result = optics.psf(Pupil(1e-12), [550e-9], 1e-3, **asked, method="rayleigh_sommerfeld")
    rho2 = result.x**2 + result.y[:, None] ** 2 + 1e-6
    lobe = math.pi * 1e-24 * 1e-6 / (550e-9 * rho2) ** 2 * (1 + (550e-9 / (2 * math.pi)) ** 2 / rho2)
    assert relative_l2(result.psf[0], lobe) < tolerance


def test_a_window_far_off_the_axis_needs_no_line():
    """From the axis to 5 mm there are 18 000 fringes, of which the window sees two."""
    line = RadialProfile.resolving(5e-3, 5e5, 2e-4, 1e-4)
    assert not line.pays(81)
    asked = {"centre": (5e-3, 0.0), "dx": 2e-6, "shape": (3, 3), "tolerance": 1e-3, "dtype": "float64"}
    result = optics.psf(Pupil(30e-6), [550e-9], 2e-4, **asked, method="rayleigh_sommerfeld")
    r = np.hypot(result.x[None, :], result.y[:, None])
    exact = np.abs(ideal_lens_field(r, 550e-9, 30e-6, distance=2e-4)) ** 2 / (math.pi * 9e-10)
    assert relative_l2(result.psf[0], exact) < 1e-3


@pytest.mark.parametrize(("radius", "distance"), [(1e-7, 1e-9), (1e-7, 1e-7), (1e-9, 1e-9), (3e-5, 1e-6)])
def test_planes_nearer_than_the_pupil_is_wide(radius, distance):
    """There the kernel's poles need more nodes than its phase: the axis against Osterberg and Smith's closed form."""
    asked = {"dx": radius / 4, "shape": (9, 9), "tolerance": 1e-8, "dtype": "float64"}
    result = optics.psf(Pupil(radius), [550e-9], distance, **asked, method="rayleigh_sommerfeld")
    exact = circular_aperture_on_axis(radius, distance, 550e-9) / (math.pi * radius**2)
    assert result.psf[0, 4, 4] == pytest.approx(exact, rel=1e-7)
    assert result.plan.predicted_error <= 1e-8


def test_a_profile_costs_no_more_than_its_wave_turns():
    """Of a wave that turns 2πbR = 63 radians over its radius, and an obliquity that adds a tenth: some fifty points
    and a table twice as fine. A rim a hundred times as far away adds nothing."""
    near, far = (RadialProfile.resolving(1e-4, 1e5, distance, 1e-4) for distance in (2e-3, 2e-1))
    assert 30 < far.points <= near.points < 150
    assert 60 < far.table <= near.table < 1.05 * far.table
