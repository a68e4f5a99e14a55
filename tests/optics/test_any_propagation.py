"""A call of `propagate` with arbitrary arguments gives a finite answer within its predicted error, or a one-line error.

OPTICS_EXAMPLES=20 python -m pytest --all tests/optics/test_any_propagation.py     tries 20 times the inputs
"""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

import optics
from optics import AccuracyError
from tests.optics.any_numbers import WAVELENGTHS, examples, logarithmic, only_one_line, or_odd
from validation.reference import relative_l2


@st.composite
def fields(draw):
    """Draw a field and its pitch [wavelengths]: noise, spots, tilted waves or single samples, of real, complex or whole
    numbers.
    """
    shape = draw(st.integers(1, 24)), draw(st.integers(1, 24))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    y, x = (np.arange(n) - n // 2 for n in shape)
    kind = draw(st.sampled_from(["noise", "spot", "wave", "sample", "dark", "counts"]))
    if kind == "noise":
        u = rng.normal(size=shape) + 1j * rng.normal(size=shape)
    elif kind == "spot":
        u = np.exp(-(x[None, :] ** 2 + y[:, None] ** 2) / draw(logarithmic(0.3, 30)) ** 2)
    elif kind == "wave":
        u = np.exp(2j * np.pi * (draw(st.floats(-0.5, 0.5)) * x[None, :] + draw(st.floats(-0.5, 0.5)) * y[:, None]))
    elif kind == "counts":
        u = rng.integers(-3, 4, shape)
    else:
        u = np.zeros(shape, np.complex64)
        u[shape[0] // 2, 0] = 1.0 if kind == "sample" else 0.0
    return u, draw(logarithmic(0.1, 30))


@st.composite
def smooth_fields(draw):
    """Draw tilted spots that are well sampled in space and in frequency, so that the sampling adds no error."""
    height, width = draw(st.integers(28, 36)), draw(st.integers(28, 36))
    y, x = np.arange(height) - height // 2, np.arange(width) - width // 2
    waist = draw(st.floats(2.8, 3.0))
    spot = np.exp(-(x[None, :] ** 2 + y[:, None] ** 2) / waist**2)
    tilt = np.exp(2j * np.pi * (draw(st.floats(-0.08, 0.08)) * x[None, :] + draw(st.floats(-0.08, 0.08)) * y[:, None]))
    return spot * tilt, draw(logarithmic(0.75, 30))


def brute_force(u, dx, wavelength, distance, out_dx, out_shape):
    """Return the propagated sinc interpolant of the samples by definition: ∫ Û(f) H(f) e^{2πi f·x} df over the band of
    the samples, by Gauss-Legendre quadrature, where evanescent waves decay. Without a discrete transform, nothing is
    periodic.
    """
    band = 0.5 / dx
    reach = abs(distance) / wavelength + (max(u.shape) * dx + max(out_shape) * out_dx) / wavelength
    count = int(60 + 8 * reach * min(1, band * wavelength))
    nodes, weights = np.polynomial.legendre.leggauss(count)
    f, df = band * nodes, band * weights
    places = [(np.arange(n) - n // 2) * dx for n in u.shape]
    out = [(np.arange(n) - n // 2) * out_dx for n in out_shape]
    spectrum = np.exp(-2j * np.pi * np.outer(f, places[0])) @ u @ np.exp(-2j * np.pi * np.outer(places[1], f)) * dx**2
    axial = np.sqrt(1 / wavelength**2 - f[:, None] ** 2 - f[None, :] ** 2 + 0j)
    spectrum = spectrum * np.exp(2j * np.pi * distance * axial) * df[:, None] * df[None, :]
    return np.exp(2j * np.pi * np.outer(out[0], f)) @ spectrum @ np.exp(2j * np.pi * np.outer(f, out[1]))


@examples(60)
@given(smooth_fields(), st.floats(0.01, 40), logarithmic(1e-4, 0.3), st.sampled_from(["float32", "float64"]), st.data())
def test_any_field_propagates_within_its_predicted_error(field, waves, tolerance, dtype, data):
    u, pitch = field  # at least 0.75 λ, so that no frequency exceeds 1/λ, where the integrand has a branch point
    wavelength = data.draw(st.floats(*WAVELENGTHS))
    dx, distance = pitch * wavelength, waves * wavelength
    asked = {"wavelength": wavelength, "dx": dx, "distance": distance, "tolerance": tolerance, "dtype": dtype}
    window = {"out_dx": dx * data.draw(st.floats(0.3, 3)), "out_shape": (data.draw(st.integers(1, 24)), 7)}
    try:
        result = optics.propagate(u, **asked, **window)
    except AccuracyError as error:
        only_one_line(error)
        return
    exact = brute_force(u, dx, wavelength, distance, **window)
    assert np.isfinite(result.u).all()
    if np.abs(exact).max() > 0:
        assert relative_l2(np.abs(result.u) ** 2, np.abs(exact) ** 2) <= result.plan.predicted_error + 1e-6
    else:
        assert not np.abs(result.u).any()


@examples(300)
@given(fields(), st.data())
def test_any_propagation_is_finite_or_refused_in_one_line(field, data):
    u, pitch = field
    if data.draw(st.integers(0, 9)) == 0:
        u = data.draw(st.sampled_from([u * math.nan, u[0], u[:0], u[None], np.array(1.0), u * 1e-30]))
    asked = {
        "dx": data.draw(or_odd(st.just(pitch * 5e-7))),
        "wavelength": data.draw(or_odd(st.floats(*WAVELENGTHS))),
        "distance": data.draw(or_odd(st.floats(-2e-4, 2e-4))),
        "medium_n": data.draw(or_odd(st.floats(1, 2))),
        "tolerance": data.draw(or_odd(logarithmic(1e-5, 0.4))),
        "method": data.draw(st.sampled_from(["auto", "angular_spectrum", "fresnel", "no such"])),
        "out_shape": data.draw(st.sampled_from([None, (1, 1), (5, 9), (40, 3), (0, 2), (2.5, 1)])),
    }
    try:
        result = optics.propagate(u, **asked)
    except ValueError as error:
        only_one_line(error)
        return
    assert np.isfinite(result.u).all()
    assert 0 <= result.plan.predicted_error <= asked["tolerance"]
    assert 0 <= result.evanescent_power <= 1 + 1e-6
