"""Derivatives of fields behind systems against differences of fields at tight tolerances, and adjoint identities."""

import numpy as np
import pytest

import optics
from optics import FreeSpace, Misaligned, Pupil, propagate_through
from optics.numerics.grid import Grid
from optics.numerics.precision import precision
from optics.propagation.misalignment import Alignment, Depths
from optics.propagation.spectrum_filter import linear_map
from optics.propagation.transfer_function import EVERYTHING, Passage
from optics.propagation.transform_sampling import sampling

WAVELENGTH, RADIUS, SHAPE = 500e-9, 40e-6, (15, 17)
WEIGHT = np.random.default_rng(0).standard_normal(SHAPE)
MAP = np.random.default_rng(1).standard_normal((6, 6))
ZERNIKES = ((2, 2), (3, 1), (4, 0))


def lens(focal_length=2e-3, **given):
    return Pupil(RADIUS, thin_lens_focal_length=focal_length, **given)


def system(first, tilt=0.0, gap=1e-3, back=1.5e-3):
    second = Misaligned(lens(3e-3), (3e-6, -2e-6), (tilt, 0.0))
    return [first, FreeSpace(gap), second, FreeSpace(back)]


def of_zernike(values):
    return lens(wavefront=optics.Zernike({mode: values[i] for i, mode in enumerate(ZERNIKES)}))


def tilted_pixels(heights):
    """Return a system with pixels that are tilted about both axes."""
    return [
        lens(),
        FreeSpace(1e-3),
        Misaligned(lens(height=optics.PixelRelief(heights)), tilt=(0.02, 0.01)),
        FreeSpace(2e-3),
    ]


# Name: system of the parameters, their values, and a step for differences.
INPUTS = {
    "flat relief": (lambda v: system(lens(height=v)), np.zeros((6, 6)), 2e-9),
    "rough relief": (lambda v: system(lens(height=v)), 40e-9 * MAP, 2e-9),
    "relief and tilt": (lambda v: system(lens(height=v), tilt=0.01), 40e-9 * MAP, 2e-9),
    "wavefront": (lambda v: system(lens(wavefront=optics.WavefrontMap(v, RADIUS))), 20e-9 * MAP, 2e-9),
    "mask": (lambda v: system(lens(mask=optics.MaskMap(v, RADIUS))), 0.5 + 0.05 * MAP, 1e-3),
    "zernike": (lambda v: system(of_zernike(v)), np.array([0.05, -0.03, 0.04]), 1e-4),
    "focal length": (lambda v: system(lens(v[0])), np.array([2e-3]), 1e-7),
    "radius": (lambda v: system(Pupil(v[0], thin_lens_focal_length=2e-3)), np.array([RADIUS]), 1e-9),
    "distances": (lambda v: system(lens(), gap=v[0], back=v[1]), np.array([1e-3, 1.5e-3]), 1e-7),
    "distances and tilt": (lambda v: system(lens(), 0.01, v[0], v[1]), np.array([1e-3, 1.5e-3]), 1e-7),
    "pixels": (lambda v: system(lens(height=optics.PixelRelief(v))), 40e-9 * MAP, 2e-9),
    "pixels and tilt": (lambda v: tilted_pixels(v), 40e-9 * MAP, 2e-9),
    "index of pixels": (lambda v: system(lens(height=optics.PixelRelief(0.1e-6 * MAP), n=v[0])), np.array([1.5]), 1e-4),
    "index": (lambda v: system(lens(height=0.1e-6 * MAP, n=v[0])), np.array([1.5]), 1e-4),
}


def seen(elements, tolerance, dtype):
    where = {"wavelength": WAVELENGTH, "out_dx": 5e-6, "out_shape": SHAPE}
    return propagate_through(elements, **where, tolerance=tolerance, dtype=dtype)


def asking(values):
    import drjit as dr

    types = precision("float64")
    found = types.Tensor64(values) if values.ndim == 2 else [types.Float64(value) for value in values.tolist()]
    dr.enable_grad(found)
    return found


def gradient(name, tolerance, dtype):
    """Return the gradient of a random functional of the intensity."""
    import drjit as dr

    build, values, _ = INPUTS[name]
    inputs = asking(values)
    result = seen(build(inputs), tolerance, dtype)
    types = precision(dtype)
    dr.backward(dr.sum(types.Float(dr.ravel(result.tensor)) * types.Float(WEIGHT.ravel().astype(dtype))))
    grads = [inputs] if values.ndim == 2 else inputs
    np.testing.assert_allclose(np.abs(result.u) ** 2, result.tensor.numpy(), rtol=1e-5)
    return np.concatenate([np.ravel(dr.grad(each).numpy()) for each in grads]).reshape(values.shape)


def difference(name, direction):
    """Return the derivative of the functional along a direction, from central differences."""
    build, values, step = INPUTS[name]
    tolerance = 1e-3 if "tilt" in name else 3e-5
    ends = [seen(build(values + sign * step * direction), tolerance, "float64") for sign in (1, -1)]
    change = [float((np.abs(end.u) ** 2 * WEIGHT).sum()) for end in ends]
    return (change[0] - change[1]) / (2 * step)


@pytest.mark.fast_cases(3)
@pytest.mark.parametrize("name", INPUTS)
def test_gradients_are_differences(name):
    """The error of a derivative along a random direction, relative to the gradient's size, is below the tolerance."""
    direction = np.random.default_rng(2).standard_normal(INPUTS[name][1].shape)
    direction /= np.linalg.norm(direction)
    expected = difference(name, direction)
    for tolerance in (1e-2,) if "tilt" in name else (1e-2, 1e-3):
        found = gradient(name, tolerance, "float32")
        assert np.sum(found * direction) == pytest.approx(expected, abs=tolerance * np.linalg.norm(found))


def test_the_phase_of_the_field_follows_the_distance():
    """Light on the axis behind a disk is e^{ikz} - z/s e^{iks} with s² = z² + R²."""
    import drjit as dr

    distance = precision("float64").Float64(300e-6)
    dr.enable_grad(distance)
    found = propagate_through(
        [Pupil(60e-6), FreeSpace(distance)], wavelength=WAVELENGTH, out_dx=1e-6, out_shape=(3, 3), dtype="float64"
    )
    dr.forward(distance)
    re, im = (dr.grad(part).numpy()[1, 1] for part in found.field_parts)
    rate = (re + 1j * im) / found.u[1, 1]
    change = dr.grad(found.tensor).numpy()[1, 1] / abs(found.u[1, 1]) ** 2
    k, s = 2 * np.pi / WAVELENGTH, np.hypot(300e-6, 60e-6)
    z = 300e-6
    u = np.exp(1j * k * z) - z / s * np.exp(1j * k * s)
    exact = (1j * k * np.exp(1j * k * z) - (1 / s - z * z / s**3 + 1j * k * z * z / s**2) * np.exp(1j * k * s)) / u
    assert rate == pytest.approx(exact, rel=2e-3)
    assert change == pytest.approx(2 * exact.real, abs=2e-3 * k)
    assert abs(change) < 0.1 * abs(rate)


@pytest.mark.parametrize("tilted", [False, True])
def test_the_map_of_a_step_has_an_adjoint(tilted):
    """For every step, Re<g, A u> = Re<Aᴴ g, u>. Samples around the source's are zero in the field of the step."""
    rng, types = np.random.default_rng(3), precision("float64")
    source, window = Grid((41, 39), 1e-6), Grid((31, 33), 1.3e-6, (4e-6, -3e-6))
    how = sampling(Passage(WAVELENGTH, 200e-6, False, EVERYTHING, 1e-6, window.centre), source, window, 10e-6)
    depths = None
    if tilted:
        ends = (Alignment((0.0, 0.0), (0.05, 0.02)), source, -1), (Alignment((0.0, 0.0), (-0.03, 0.04)), window, 1)
        nodes = np.array([-1e-6, 1e-6])
        weights = [(nodes, end.weights(nodes, grid, sign * 2e3, types)) for end, grid, sign in ends]
        depths = Depths(*weights, 2e3, (0.05, 0.02))
    step = linear_map(how, (43, 41), types, depths)
    u, g = (rng.standard_normal((*shape, 2)) @ [1, 1j] for shape in ((43, 41), window.shape))
    there, back = step.forward(u), step.adjoint(g)
    assert np.vdot(g, there) == pytest.approx(np.vdot(back, u), rel=1e-10)
    assert back.shape == u.shape
    assert not back[0].any()
    assert back[1:-1, 1:-1].all()


def test_misalignments_and_fields_carry_no_derivatives():
    import drjit as dr

    angle = precision("float64").Float64(0.01)
    dr.enable_grad(angle)
    for misaligned in ({"tilt": (angle, 0.0)}, {"decentre": (angle, 0.0)}):
        with pytest.raises(ValueError, match=f"{next(iter(misaligned))} requires a derivative, but none"):
            Misaligned(lens(), **misaligned)
    with pytest.raises(ValueError, match="u requires a derivative"):
        propagate_through([FreeSpace(1e-4)], precision("float64").Tensor64(angle, (1, 1)), wavelength=5e-7, dx=1e-6)
