"""Distant and shifted windows against Rayleigh-Sommerfeld's sum at single points, closed forms, and transforms."""

import itertools

import numpy as np
import pytest

import optics
from optics.numerics.grid import Grid
from optics.numerics.precision import precision
from optics.propagation.propagate import WRAP_RIPPLE_PER_TOLERANCE
from optics.propagation.separable_kernel import separable
from optics.propagation.spectrum_filter import filtered
from optics.propagation.transfer_function import EVERYTHING, Passage
from optics.propagation.transform_sampling import sampling
from validation.reference import relative_l2

WAVELENGTH = 633e-9


def tilted(n, dx, waist, sines):
    """Return a Gaussian with a random phase of low order, which travels obliquely towards a window."""
    x = (np.arange(n) - n // 2) * dx
    shape = np.exp(-(np.add.outer(x**2, x**2) / waist**2) + 2j * np.outer(x, x**2) / waist**3)
    return shape * np.exp(2j * np.pi * (sines[0] * x[None, :] + sines[1] * x[:, None]) / WAVELENGTH)


def direct_sum(u, dx, z, x, y):
    """Return the first Rayleigh-Sommerfeld integral over the samples at points (x, y), without a matrix or a
    transform.
    """
    at, k = (np.arange(len(u)) - len(u) // 2) * dx, 2 * np.pi / WAVELENGTH
    found = []
    for px, py in zip(x, y, strict=True):
        rho2 = (px - at[None, :]) ** 2 + (py - at[:, None]) ** 2
        path = np.sqrt(z**2 + rho2)
        kernel = z / (2 * np.pi * path**2) * (1 / path - 1j * k) * np.exp(1j * k * rho2 / (path + z))
        found.append((u * kernel).sum() * dx**2)
    return np.array(found) * np.exp(1j * k * z)


CASES = {
    "5 m, shifted": (150, 10e-6, 5.0, 1e-4, (256, 256), (30e-3, -20e-3)),
    "5 m, wide": (96, 10e-6, 5.0, 2e-4, (512, 512), (30e-3, -20e-3)),
    "0.3 m, oblique": (80, 2e-6, 0.3, 10e-6, (60, 90), (20e-3, 25e-3)),
}


@pytest.mark.parametrize(("tolerance", "dtype"), [(1e-2, "float32"), (1e-3, "float32"), (1e-8, "float64")])
@pytest.mark.parametrize("name", CASES)
def test_the_direct_sum_is_met_to_the_predicted_error(name, tolerance, dtype):
    n, dx, z, out_dx, shape, centre = CASES[name]
    u = tilted(n, dx, n * dx / 6, (centre[0] / z, centre[1] / z))
    settings = {"dx": dx, "wavelength": WAVELENGTH, "distance": z, "out_dx": out_dx, "out_shape": shape}
    out = optics.propagate(u, **settings, out_centre=centre, tolerance=tolerance, dtype=dtype)
    assert out.plan.method == "separable_kernel"
    rows, columns = np.unravel_index(np.argsort(np.abs(out.u).ravel())[:: -out.u.size // 40], shape)
    exact = direct_sum(u, dx, z, out.x[columns], out.y[rows])
    found = out.u[rows, columns]
    error = relative_l2(np.abs(found) ** 2, np.abs(exact) ** 2)
    assert error < out.plan.predicted_error < tolerance
    assert np.linalg.norm(found - exact) < out.plan.predicted_error * np.linalg.norm(exact) + 1e-6
    elsewhere = direct_sum(u, dx, z, out.x[columns] + 25 * out_dx, out.y[rows])
    assert relative_l2(np.abs(elsewhere) ** 2, np.abs(exact) ** 2) > 1e-2  # the oracle rejects a shifted window


def test_the_paraxial_kernel_is_wrong_where_the_separable_kernel_is_right():
    """The phase k ρ⁴/8z³ that Fresnel neglects displaces light by ρ³/2z² = 44 µm (4 samples) at a distance of 0.3 m, 20
    mm off the axis.
    """
    n, dx, z, out_dx, shape, centre = CASES["0.3 m, oblique"]
    u = tilted(n, dx, n * dx / 6, (0.06, 0.08))
    settings = {"dx": dx, "wavelength": WAVELENGTH, "distance": z, "out_dx": out_dx, "out_shape": shape}
    exact, paraxial = (optics.propagate(u, **settings, out_centre=centre, method=m).u for m in ("auto", "fresnel"))
    assert relative_l2(np.abs(paraxial) ** 2, np.abs(exact) ** 2) > 1e-2


@pytest.mark.parametrize("distance", [2.0, -2.0])
def test_a_tilted_gaussian_beam_lands_beside_the_axis(distance):
    """The paraxial beam (Siegman, Lasers, §17.1) with the tilt sin θ = λf is displaced by λfz."""
    n, dx, waist, f = 96, 20e-6, 0.25e-3, np.array([15e3, -8e3])
    x = (np.arange(n) - n // 2) * dx
    u = np.exp(-np.add.outer(x**2, x**2) / waist**2 + 2j * np.pi * np.add.outer(f[1] * x, f[0] * x))
    centre = WAVELENGTH * distance * f
    out = optics.propagate(
        u, dx=dx, wavelength=WAVELENGTH, distance=distance, out_dx=50e-6, out_shape=(101, 91),
        out_centre=tuple(centre), method="fresnel",
    )  # fmt: skip
    spread = 1 + 1j * distance * WAVELENGTH / (np.pi * waist**2)
    r2 = np.add.outer((out.y - centre[1]) ** 2, (out.x - centre[0]) ** 2)
    beam = np.exp(-r2 / (waist**2 * spread)) / spread
    np.testing.assert_allclose(np.abs(out.u), np.abs(beam), atol=2e-5)


@pytest.mark.parametrize("paraxial", [False, True])
def test_transforms_and_products_give_the_same_field(paraxial):
    """Both are exact in amplitude and phase, so they differ at most by their predicted errors."""
    source, window = Grid((64, 50), 4e-6), Grid((40, 60), 12e-6, (1e-3, -0.6e-3))
    passage = Passage(WAVELENGTH, 60e-3, paraxial, EVERYTHING, WRAP_RIPPLE_PER_TOLERANCE * 1e-7, window.centre)
    u = tilted(64, 4e-6, 40e-6, (0.016, -0.01))[:, 7:57]
    types = precision("float64")
    products = separable(passage, source, window, 1e-7)
    one = products.propagated(u, types)
    other = filtered(u, sampling(passage, source, window, 0.0), types)
    assert np.linalg.norm(one.u - other.u) < (one.error + other.error) * np.linalg.norm(other.u)
    assert max(one.error, other.error) < 2e-7


def test_each_term_divides_the_error():
    """The phase that couples x and y is 0.8 rad here, so the error of the kernel falls with the number of terms like
    that of the exponential series.
    """
    source, window = Grid((96, 96), 10e-6), Grid((512, 512), 2e-4, (30e-3, -20e-3))
    passage = Passage(WAVELENGTH, 5.0, False, EVERYTHING, 1e-9, window.centre)
    errors = {}
    for allowed in 10.0 ** np.arange(-1.0, -10.0, -0.5):
        terms = separable(passage, source, window, float(allowed)).terms
        assert 4 * terms.error <= allowed
        errors[terms.count] = terms.error
    counts = sorted(errors)
    assert len(counts) >= 4
    for fewer, more in itertools.pairwise(counts):
        assert errors[more] < 0.2 * errors[fewer]


def test_the_angular_spectrum_can_be_requested():
    u = tilted(64, 10e-6, 100e-6, (0.0, 0.0))
    settings = {"dx": 10e-6, "wavelength": WAVELENGTH, "distance": 0.2, "out_dx": 30e-6, "out_shape": (96, 96)}
    auto, requested = (optics.propagate(u, **settings, method=method) for method in ("auto", "angular_spectrum"))
    assert (auto.plan.method, requested.plan.method) == ("separable_kernel", "angular_spectrum")
    assert relative_l2(np.abs(auto.u) ** 2, np.abs(requested.u) ** 2) < auto.plan.predicted_error


def test_a_near_window_is_left_to_transforms():
    u = tilted(128, 1e-6, 20e-6, (0.0, 0.0))
    near = optics.propagate(u, dx=1e-6, wavelength=WAVELENGTH, distance=0.2e-3, out_dx=2e-6, out_shape=(512, 512))
    assert near.plan.method == "angular_spectrum"
