"""Rotationally symmetric PSFs along one radius: enough points, and no radial line if it does not save time."""

import math

import numpy as np
import pytest

import optics
from optics import PointSource, Pupil
from optics.elements.beam import Beam
from optics.methods.problem import Problem
from optics.methods.rayleigh_sommerfeld import direct_sum, node_rule
from optics.numerics import radial_profile
from optics.numerics.grid import Grid
from optics.numerics.precision import precision
from optics.numerics.radial_profile import DistinctRadii, RadialProfile
from validation.reference import circular_aperture_on_axis, ideal_lens_field, relative_l2


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6])
def test_obliquity_alone_is_resolved(tolerance):
    """An aperture far smaller than the wavelength gives no fringes. The profile must only represent z²/(z² + r²)², here
    up to 66°.
    """
    asked = {"dx": 2e-4, "shape": (17, 17), "tolerance": tolerance, "dtype": "float64"}
    result = optics.psf(Pupil(1e-12), [550e-9], 1e-3, **asked, method="rayleigh_sommerfeld")
    rho2 = result.x**2 + result.y[:, None] ** 2 + 1e-6
    lobe = math.pi * 1e-24 * 1e-6 / (550e-9 * rho2) ** 2 * (1 + (550e-9 / (2 * math.pi)) ** 2 / rho2)
    assert relative_l2(result.psf[0], lobe) < tolerance


def test_a_window_far_off_the_axis_needs_no_line():
    """There are 18 000 fringes between the axis and 5 mm, of which the window contains two."""
    line = RadialProfile.resolving(5e-3, 5e5, 2e-4, 1e-4)
    assert not line.pays(81)
    asked = {"centre": (5e-3, 0.0), "dx": 2e-6, "shape": (3, 3), "tolerance": 1e-3, "dtype": "float64"}
    result = optics.psf(Pupil(30e-6), [550e-9], 2e-4, **asked, method="rayleigh_sommerfeld")
    r = np.hypot(result.x[None, :], result.y[:, None])
    exact = np.abs(ideal_lens_field(r, 550e-9, 30e-6, distance=2e-4)) ** 2 / (math.pi * 9e-10)
    assert relative_l2(result.psf[0], exact) < 1e-3


@pytest.mark.fast_cases(1)
@pytest.mark.parametrize(("radius", "distance"), [(1e-7, 1e-9), (1e-7, 1e-7), (1e-9, 1e-9), (3e-5, 1e-6)])
def test_planes_nearer_than_the_pupil_is_wide(radius, distance):
    """The number of nodes follows from the poles of the kernel there, and not from its phase. The reference on the axis
    is Osterberg and Smith's closed form.
    """
    asked = {"dx": radius / 4, "shape": (9, 9), "tolerance": 1e-8, "dtype": "float64"}
    result = optics.psf(Pupil(radius), [550e-9], distance, **asked, method="rayleigh_sommerfeld")
    exact = circular_aperture_on_axis(radius, distance, 550e-9) / (math.pi * radius**2)
    assert result.psf[0, 4, 4] == pytest.approx(exact, rel=1e-7)
    assert result.plan.predicted_error <= 1e-8


def test_a_profile_costs_no_more_than_its_wave_turns():
    """About fifty points and a table twice as fine are enough if the phase changes by 63 radians over the radius, and
    the obliquity adds a tenth. A pupil a hundred times as far away needs no additional points.
    """
    near, far = (RadialProfile.resolving(1e-4, 1e5, distance, 1e-4) for distance in (2e-3, 2e-1))
    assert 30 < far.points <= near.points < 150
    assert 60 < far.table <= near.table < 1.05 * far.table


HOLE = {"radius": 1e-3, "distance": 1e-6 / (1000 * 550e-9)}  # Fresnel number 1,000: rays are as steep as 1/2


@pytest.mark.slow
def test_a_hole_of_a_thousand_zones():
    """The window contains the whole shadow in few samples. They agree with the direct sum, and on the axis with
    Osterberg and Smith's closed form.
    """
    samples = 65
    radius, distance = HOLE["radius"], HOLE["distance"]
    asked = {"dx": 2.2 * radius / samples, "tolerance": 1e-3}
    result = optics.psf(Pupil(radius), [550e-9], distance, shape=(samples, samples), **asked)
    assert result.plan.method == "hankel"
    middle = circular_aperture_on_axis(radius, distance, 550e-9) / (math.pi * radius**2)
    assert result.psf[0, samples // 2, samples // 2] == pytest.approx(middle, rel=1e-3)
    places = np.linspace(0, samples - 1, 7).astype(int)
    beam = Beam(Pupil(radius), PointSource(), 550e-9, distance)
    problem = Problem.from_beam(beam, Grid(result.psf.shape[1:], asked["dx"]), 1e-4, "float64")
    types, rule = precision("float64"), (beam.pupil.aperture, *node_rule(problem), True)
    x = types.Float64(np.abs(result.x[places]))
    exact = direct_sum(beam, rule, x, 0 * x, types).intensity.numpy() / beam.pupil.area
    assert relative_l2(result.psf[0, samples // 2, places], exact) < 1e-3


def test_long_lines_are_their_own_table(monkeypatch):
    """A profile with many points is interpolated without a matrix from Chebyshev points. The PSF is the same."""
    asked = {"dx": 1e-6, "shape": (101, 101), "tolerance": 1e-5, "dtype": "float64", "method": "hankel"}
    by_points = optics.psf(Pupil(30e-6), [550e-9], 1e-3, **asked).psf[0]
    monkeypatch.setattr(radial_profile, "LARGEST_MATRIX", 1)
    line = RadialProfile.resolving(1e-4, 1e5, 1e-3, 1e-5)
    assert line.is_table
    assert line.entries == 0
    by_table = optics.psf(Pupil(30e-6), [550e-9], 1e-3, **asked | {"tolerance": 0.99e-5}).psf[0]
    assert 0 < relative_l2(by_table, by_points) < 1e-5


@pytest.mark.parametrize("centre", [(0.0, 0.0), (2e-6, 0.3e-6)])
def test_every_sample_has_its_own_radius(centre):
    window = Grid((9, 12), 0.5e-6, centre)
    line = DistinctRadii(window)
    types = precision("float64")
    found = line.onto(types.Float64(line.positions), window, types).numpy()
    np.testing.assert_allclose(found, np.hypot(window.x[None, :], window.y[:, None]).ravel(), rtol=1e-6, atol=1e-15)
    if centre == (0.0, 0.0):
        assert line.points < 9 * 12 / 3
