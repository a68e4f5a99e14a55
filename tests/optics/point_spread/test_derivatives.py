"""Derivatives of PSF and quality against central differences, forward and backward, for every method."""

import numpy as np
import pytest

import optics
from optics import BSplineRelief, Pupil
from optics.numerics.device import device
from optics.numerics.precision import precision
from tests.slow_part import slow

WAVELENGTH, SHAPE = 550e-9, (17, 15)
# Whole waves of defocus, an index step and a source nearby: every parameter changes the PSF.
PARAMETERS = {"radius": 12e-6, "distance": 120e-6, "n": 1.5, "focal_length": 140e-6, "source_distance": 1e-3}
EXACT = ["low_rank", "far_field", "angular_spectrum", "split_angular_spectrum", "rayleigh_sommerfeld"]
METHODS = [*EXACT, "fresnel", "fraunhofer", "geometric"]
# Relative step of central differences: rounding (1e-10 of the PSF) over the step, and its square, both below 1e-4.
STEP = 1e-5


def float64(value):
    return precision("float64").Float(value)


def asking(value):
    """Return the same number with its gradient enabled."""
    import drjit as dr

    x = float64(value)
    dr.enable_grad(x)
    return x


def total(values, heights=None, method="auto"):
    """Return a sum of the PSF with random weights, as a Dr.Jit scalar."""
    import drjit as dr

    relief = None if heights is None else BSplineRelief(heights)
    pupil = Pupil(values["radius"], relief, n=values["n"], thin_lens_focal_length=values["focal_length"])
    result = optics.psf(
        pupil,
        [WAVELENGTH],
        values["distance"],
        values["source_distance"],
        dx=0.7e-6,
        shape=SHAPE,
        tolerance=1e-5 if method == "far_field" else 1e-8,  # it has many nodes, the same for both differences
        method=method,
        dtype="float64",
    )
    weight = np.random.default_rng(5).random(SHAPE).ravel()
    return dr.sum(result.tensor.array * float64(weight)) * 1e-10


def difference(function, values, name):
    step = STEP * values[name]
    high, low = (function({**values, name: values[name] + sign * step}) for sign in (1, -1))
    return (high - low) / (2 * step)


def number(value):
    return float(np.asarray(value.numpy()).ravel()[0])


def none_on_a_gpu(method, function):
    """Return whether a method has no derivatives on this device; it must report this."""
    if method != "geometric" or device() == "cpu":
        return False
    with pytest.raises(ValueError, match="no derivatives on a GPU"):
        function()
    return True


def assert_derivatives(function, values, name, rel=1e-4):
    import drjit as dr

    expected = difference(lambda at: number(function(at)), values, name)
    assert expected != 0
    for run in ("backward", "forward"):
        x = asking(values[name])
        out = function({**values, name: x})
        if run == "backward":
            dr.backward(out)
            found = dr.grad(x)
        else:
            dr.forward(x)
            found = dr.grad(out)
        assert number(found) == pytest.approx(expected, rel=rel), run


HEIGHTS = np.random.default_rng(2).random((4, 4)) * 2e-6


@pytest.mark.fast_cases(4)
@pytest.mark.parametrize(
    ("method", "name"),
    [(method, name) for method in METHODS for name in ("distance", "radius")]
    + [(method, name) for method in ("angular_spectrum", "geometric") for name in ("focal_length", "n")]
    + [(method, "source_distance") for method in ("far_field", "fresnel")],
)
def test_psf_of_a_relief(method, name):
    moving = {**PARAMETERS, name: asking(PARAMETERS[name])}
    if not none_on_a_gpu(method, lambda: total(moving, HEIGHTS, method)):
        assert_derivatives(lambda values: total(values, HEIGHTS, method), PARAMETERS, name)


@pytest.mark.parametrize("name", ["radius", "distance", "focal_length", "source_distance"])
@pytest.mark.parametrize("method", ["hankel", "rayleigh_sommerfeld"])
def test_psf_of_a_symmetric_pupil(method, name):
    assert_derivatives(lambda values: total(values, None, method), PARAMETERS, name)


@pytest.mark.fast_cases(4)
@pytest.mark.parametrize("method", [slow(method) if method == "geometric" else method for method in METHODS])
def test_psf_by_control_points(method):
    import drjit as dr

    heights = precision("float64").Tensor(HEIGHTS)
    dr.enable_grad(heights)
    if none_on_a_gpu(method, lambda: total(PARAMETERS, heights, method)):
        return
    dr.backward(total(PARAMETERS, heights, method))
    found = dr.grad(heights).numpy()
    for index in ((0, 0), (1, 2), (3, 1)):
        step = np.zeros((4, 4))
        step[index] = 1e-11
        high, low = (number(total(PARAMETERS, HEIGHTS + sign * step, method)) for sign in (1, -1))
        assert found[index] == pytest.approx((high - low) / 2e-11, abs=1e-4 * np.abs(found).max())


def test_a_derivative_asks_about_every_control_point():
    """A paraboloid is symmetric, but no longer so if one control point changes. The derivative must not assume a
    symmetric pupil.
    """
    import drjit as dr

    points = BSplineRelief.paraboloid(1e-6, 1 / (0.5 * 120e-6), 12e-6).control_points
    heights = precision("float64").Tensor(points)
    dr.enable_grad(heights)
    dr.backward(total(PARAMETERS, heights))
    gradient = dr.grad(heights).numpy()
    step = np.zeros((4, 4))
    step[0, 2] = 1e-11
    high, low = (number(total(PARAMETERS, points + sign * step)) for sign in (1, -1))
    assert gradient[0, 2] == pytest.approx((high - low) / 2e-11, abs=1e-4 * np.abs(gradient).max())


QUALITIES = {
    "strehl_ratio": optics.strehl_ratio,
    "mtf": lambda result: optics.mtf(result).profile(np.array([2e4, 5e4])),
    "mtf of all the light": lambda result: optics.mtf(result, arriving=1.0).profile(np.array([2e4, 5e4])),
    "image_quality": lambda result: optics.image_quality(result, 1e5, 0.5, 0.01),
}


@pytest.mark.fast_cases(2)
@pytest.mark.parametrize("name", ["radius", "distance", "n"])
@pytest.mark.parametrize("quality", sorted(QUALITIES))
def test_quality(quality, name):
    import drjit as dr

    def function(values):
        pupil = Pupil(values["radius"], BSplineRelief(HEIGHTS), n=values["n"], thin_lens_focal_length=140e-6)
        result = optics.psf(
            pupil, [WAVELENGTH], values["distance"], dx=0.8e-6, shape=(33, 33), tolerance=1e-8, dtype="float64"
        )
        value = QUALITIES[quality](result)
        return float64(value.ravel()) if isinstance(value, np.ndarray) else dr.sum(dr.ravel(value))

    def scalar(values):
        out = function(values)
        return dr.sum(out)

    # The largest sample, clipping at the noise floor and |OTF| have kinks, but not here.
    assert_derivatives(scalar, PARAMETERS, name)


def test_without_derivatives_results_are_numpy():
    result = optics.psf(Pupil(12e-6, thin_lens_focal_length=120e-6), sensor_distance=120e-6, shape=(17, 17))
    for function in QUALITIES.values():
        assert isinstance(function(result), np.ndarray)
    assert isinstance(result.psf, np.ndarray)
