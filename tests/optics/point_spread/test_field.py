"""The complex amplitude next to its square: against the integral written out, for every method that has a phase."""

import itertools
import math

import drjit as dr
import numpy as np
import pytest

import optics
from optics import Annulus, BSplineRelief, PixelRelief, Pupil
from tests.optics.device_types import Float64

R, Z, WAVE = 30e-6, 250e-6, 550e-9
RELIEF = np.random.default_rng(1).random((4, 4)) * 2e-6
PUPILS = {
    "lens": Pupil(R, thin_lens_focal_length=Z),
    "relief in water": Pupil(R, BSplineRelief(RELIEF), medium_n=1.33),
    "ring": Pupil(R, aperture=Annulus(0.4), thin_lens_focal_length=0.9 * Z),
}
ASKED = {"wavelengths": [WAVE], "sensor_distance": Z, "dx": 0.9e-6, "shape": (15, 11), "dtype": "float64"}


def written_out(pupil, x, y):
    """Return the first Rayleigh-Sommerfeld integral over a ring, including the carrier, by Gauss nodes in the radius
    and equidistant angles.
    """
    inner = pupil.aperture.rings[0][0]
    square, weight = np.polynomial.legendre.leggauss(160)
    rho2 = inner**2 + (1 - inner**2) * (square + 1) / 2
    theta = 2 * np.pi * np.arange(240) / 240
    px, py = R * np.outer(np.sqrt(rho2), np.cos(theta)), R * np.outer(np.sqrt(rho2), np.sin(theta))
    area = np.outer(weight * (1 - inner**2) / 4 * 2 * np.pi / 240, np.ones(240)) * R**2
    from optics.elements.source import PointSource
    from optics.numerics.precision import precision

    types = precision("float64")
    path = pupil.path(types.Float64(px.ravel()), types.Float64(py.ravel()), WAVE, PointSource()).numpy()
    k, n = 2 * np.pi / WAVE, pupil.medium_n
    found = np.empty((y.size, x.size), dtype=complex)
    for row, column in np.ndindex(found.shape):
        d = np.sqrt((x[column] - px) ** 2 + (y[row] - py) ** 2 + Z * Z)
        kernel = Z / (2 * np.pi * d * d) * (1 / d - 1j * k * n) * np.exp(1j * k * n * d)
        found[row, column] = np.sum(area * np.exp(1j * k * path.reshape(px.shape)) * kernel)
    return found / math.sqrt(pupil.area)


METHODS = ("low_rank", "angular_spectrum", "split_angular_spectrum", "rayleigh_sommerfeld")


@pytest.mark.fast_cases(1)
@pytest.mark.parametrize(
    ("name", "method"), [*itertools.product(PUPILS, METHODS), ("lens", "hankel"), ("ring", "hankel")]
)
def test_field_is_the_integral(name, method):
    result = optics.psf(PUPILS[name], **ASKED, method=method, tolerance=1e-6, field=True)
    exact = written_out(PUPILS[name], result.x, result.y)
    assert np.linalg.norm(result.field[0] - exact) < 2e-6 * np.linalg.norm(exact)
    np.testing.assert_allclose(np.abs(result.field) ** 2, result.psf, rtol=1e-9, atol=1e-9 * result.psf.max())
    # A field without phase would not pass.
    assert np.linalg.norm(np.abs(exact) - exact) > 0.1 * np.linalg.norm(exact)


def test_symmetric_fields_along_a_line_are_those_of_the_plane():
    """The sum over nodes is computed along one radius only if the window is wide."""
    wide = {**ASKED, "dx": 0.5e-6, "shape": (121, 121)}
    line = optics.psf(PUPILS["lens"], **wide, method="rayleigh_sommerfeld", tolerance=1e-6, field=True)
    plane = optics.psf(PUPILS["lens"], **wide, method="split_angular_spectrum", tolerance=1e-6, field=True)
    assert np.linalg.norm(line.field - plane.field) < 2e-6 * np.linalg.norm(plane.field)


@pytest.mark.slow
def test_pixels_off_axis_windows_and_both_precisions():
    pupil = Pupil(R, PixelRelief(np.random.default_rng(2).random((20, 20)) * 1e-6), object_n=1.1, medium_n=1.3)
    asked = {**ASKED, "centre": (8e-6, -5e-6), "source_angle": (0.05, 0.0)}
    del asked["dtype"]
    exact = optics.psf(pupil, **asked, dtype="float64", method="rayleigh_sommerfeld", tolerance=1e-6, field=True).field
    for method in ("low_rank", "angular_spectrum", "split_angular_spectrum", "auto"):
        found = optics.psf(pupil, **asked, method=method, tolerance=1e-4, field=True)
        assert found.field.dtype == np.complex64
        assert np.linalg.norm(found.field - exact) < 1e-4 * np.linalg.norm(exact)


def test_without_being_asked_for_there_is_none():
    assert optics.psf(PUPILS["lens"], **ASKED).field is None
    with pytest.raises(ValueError, match="method = 'far_field' has no phase"):
        optics.psf(PUPILS["lens"], **ASKED, method="far_field", field=True)


@pytest.mark.parametrize("method", ["far-field", "field", ["auto"]])
def test_methods_that_are_none_are_named(method):
    with pytest.raises(ValueError, match=r"method = .* must be one of 'auto', 'exact', "):
        optics.psf(PUPILS["lens"], **ASKED, method=method)


def test_the_phase_carries_derivatives():
    """The derivative of the phase of U with respect to the distance is about k, because it includes the carrier."""

    def real_part(z):
        asked = {**ASKED, "sensor_distance": z, "method": "rayleigh_sommerfeld", "tolerance": 1e-8}
        return optics.psf(PUPILS["ring"], **asked, field=True)

    z = Float64(Z)
    dr.enable_grad(z)
    result = real_part(z)
    dr.backward(result.field_parts[0][0, 7, 6])
    more, less = (real_part(Z + step).field[0, 7, 6].real for step in (1e-10, -1e-10))
    assert dr.grad(z)[0] == pytest.approx((more - less) / 2e-10, rel=1e-4)
    assert abs(dr.grad(z)[0]) > 0.01 * 2 * math.pi / WAVE * abs(result.field[0, 7, 6])
