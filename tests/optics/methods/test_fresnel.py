"""The paraxial methods: they give Airy's pattern exactly, and they report their error."""

import numpy as np
import pytest

import optics
from optics import BSplineRelief, Pupil
from tests.optics.methods.approximations import predicted_and_actual, random_case
from validation import reference
from validation.reference import order_of_convergence, relative_l2

WAVELENGTH = 550e-9


def paraboloid_lens(radius, f, n=1.5):
    """Return a pupil with the paraxial lens exp(-ikr²/2f), a paraboloid of curvature 1/((n - 1) f)."""
    return Pupil(radius, BSplineRelief.paraboloid(0.0, 1 / ((n - 1) * f), radius), n=n)


@pytest.mark.parametrize("f_number", [2, 4, 8, 16])
def test_a_paraxial_lens_makes_airys_pattern_in_fresnels_integral_and_in_no_exact_one(f_number):
    f = 300e-6
    radius = f / (2 * f_number)
    lens, dx = paraboloid_lens(radius, f), WAVELENGTH * f_number / 4
    settings = {"dx": dx, "shape": (65, 63), "tolerance": 1e-6, "dtype": "float64"}
    paraxial = optics.psf(lens, [WAVELENGTH], f, **settings, method="fresnel")
    airy = reference.airy_psf(np.hypot(paraxial.x, paraxial.y[:, None]), WAVELENGTH, radius, f)
    assert relative_l2(paraxial.psf[0], airy) < 1e-6
    exact = optics.psf(lens, [WAVELENGTH], f, **settings, method="exact")
    departure = relative_l2(exact.psf[0], airy)
    assert departure > 1e-3  # the oracle must reject this
    assert departure < paraxial.plan.predicted_error < 30 * departure


def test_fresnel_keeps_lommels_defocus():
    """Out of focus, the quadratic phases of lens and path do not cancel. The reference is Lommel's paraxial
    integral.
    """
    radius, f, z = 30e-6, 300e-6, 330e-6
    found = optics.psf(
        paraboloid_lens(radius, f), [WAVELENGTH], z, dx=1e-6, shape=(41, 41), tolerance=1e-6, dtype="float64",
        method="fresnel",
    )  # fmt: skip
    # Direct radial integral of eq. 4-17: U = 2π/(λz) ∫ e^{ik r²(1/z - 1/f)/2} J0(krρ/z) r dr.
    from scipy.special import j0

    nodes, weights = np.polynomial.legendre.leggauss(400)
    r, weights = radius * (nodes + 1) / 2, radius * weights / 2
    k, rho = 2 * np.pi / WAVELENGTH, np.hypot(found.x, found.y[:, None])
    wave = np.exp(0.5j * k * r**2 * (1 / z - 1 / f)) * r * weights
    u = k / z * (j0(k * rho[..., None] * r / z) @ wave)
    assert relative_l2(found.psf[0], np.abs(u) ** 2 / (np.pi * radius**2)) < 1e-6


def test_fraunhofer_is_airys_far_field():
    radius, z = 10e-6, 1e-3
    found = optics.psf(
        Pupil(radius), [WAVELENGTH], z, dx=4e-6, shape=(49, 49), tolerance=1e-6, dtype="float64", method="fraunhofer"
    )
    airy = reference.airy_psf(np.hypot(found.x, found.y[:, None]), WAVELENGTH, radius, z)
    assert relative_l2(found.psf[0], airy) < 1e-6


def errors(method, cases):
    """Return the errors of a method for circular apertures without lens; cases: (radius, distance, half width of the
    window).
    """
    found = []
    for radius, z, half in cases:
        settings = {"dx": half / 20, "shape": (41, 41), "tolerance": 1e-8, "dtype": "float64"}
        approximate, exact = (
            optics.psf(Pupil(radius), [WAVELENGTH], z, **settings, method=name).psf[0] for name in (method, "exact")
        )
        found.append(relative_l2(approximate, exact))
    return found


def test_fresnels_error_falls_with_the_square_of_the_angle():
    """The neglected phase a⁴/λz³ is N³ (λ/a)², and the neglected obliquity (a/z)² is N² (λ/a)², at a fixed Fresnel
    number N.
    """
    radii = np.array([10e-6, 20e-6, 40e-6])
    cases = [(a, a**2 / WAVELENGTH, 1.5 * a) for a in radii]
    assert order_of_convergence(radii / radii[0], errors("fresnel", cases)) == pytest.approx(-2, abs=0.1)


def test_fraunhofers_error_falls_with_the_fresnel_number():
    """The neglected phase is at most πN and changes only the imaginary part of a real field. The error of the intensity
    is therefore proportional to N² = (a²/λz)².
    """
    distances = np.array([5e-3, 10e-3, 20e-3])
    cases = [(20e-6, z, 2 * WAVELENGTH * z / 20e-6) for z in distances]
    assert order_of_convergence(distances / distances[0], errors("fraunhofer", cases)) == pytest.approx(-2, abs=0.1)


@pytest.mark.fast_cases(1)
@pytest.mark.parametrize(("method", "close"), [("fresnel", 0.95), ("fraunhofer", 0.8)])
def test_predicted_error_bounds_the_actual_one(method, close):
    """For 100 random pupils, the predicted error was always a bound. It was at most 30 times the actual error for all
    of them with "fresnel", and for 90 % with "fraunhofer".
    """
    rng = np.random.default_rng(3)
    planned, actual, seen = np.array([predicted_and_actual(random_case(rng), method) for _ in range(25)]).T
    assert np.mean(planned >= actual) >= 0.96
    assert np.all(planned >= actual / 3)
    assert np.mean(planned < 30 * actual) >= close
    assert np.mean(seen >= actual) >= 0.92
    assert np.all(seen >= actual / 3)


def test_auto_takes_fresnel_where_it_is_right_and_cheaper():
    """Exact methods cost several times more for a wide window far behind a small pupil with a relief."""
    bent = Pupil(60e-6, BSplineRelief(2e-6 * np.random.default_rng(0).random((4, 4))))
    case = {"dx": 0.1e-3, "shape": (129, 129), "tolerance": 2.9e-4}
    found = optics.psf(bent, [WAVELENGTH], 0.15, **case)
    exact = optics.psf(bent, [WAVELENGTH], 0.15, **case, method="exact")
    assert found.plan.method == "fresnel"
    assert found.plan.seconds < exact.plan.seconds
    assert relative_l2(found.psf, exact.psf) < found.plan.predicted_error + exact.plan.predicted_error < 6e-4
    steep = optics.plan(bent, WAVELENGTH, 6e-3, dx=60e-6, shape=(129, 129), tolerance=0.05)
    assert steep.predicted_error <= 0.05
