"""Derivatives with respect to all inputs, against exact adjoints in NumPy (`exact_gradients`).

The error of a gradient is its relative L2 error for a random functional of the PSF. It must be below five times the
tolerance; at most the tolerance is stated.
"""

from functools import lru_cache

import numpy as np
import pytest

import optics
from optics import AccuracyError, BSplineRelief, HeightMap, MaskMap, PixelRelief, Pupil, WavefrontMap, Zernike
from optics.elements.wavefront import mode
from optics.methods.derivative_cells import SPLINE
from optics.numerics.precision import precision
from tests.optics.point_spread.exact_gradients import (
    Scene,
    disk_nodes,
    lines_of_knots,
    lines_of_pixels,
    pixel,
    psf_and_adjoint,
    spline,
)
from tests.slow_part import slow

SCENE = Scene()
WEIGHT = np.random.default_rng(1).standard_normal(SCENE.shape)
# Path [m] per unit of the samples, and a sample whose path is a fraction of a wave.
PATHS = {"height": (SCENE.n - 1, 0.2e-6), "pixels": (SCENE.n - 1, 0.2e-6), "wavefront": (-1.0, 0.1e-6)}
MAPS = {"height": HeightMap, "pixels": PixelRelief, "wavefront": WavefrontMap, "mask": MaskMap}


def asking(values):
    import drjit as dr

    types = precision("float64")
    found = types.Tensor64(values) if np.ndim(values) else types.Float64(values)
    dr.enable_grad(found)
    return found


def view(tolerance, scene=SCENE, **more):
    dtype = "float32" if tolerance >= 1e-4 else "float64"
    window = {"dx": scene.dx, "shape": scene.shape, "centre": scene.centre}
    return {"sensor_distance": scene.distance, "tolerance": tolerance, "dtype": dtype, **window, **more}


def gradient(values, pupil, tolerance, **more):
    """Return the gradient of a random functional of the PSF, and the plan of the PSF."""
    import drjit as dr

    inputs = asking(values)
    result = optics.psf(pupil(inputs), [SCENE.wavelength], **view(tolerance, **more))
    types = precision(str(result.psf.dtype))
    dr.backward(dr.sum(types.Float(dr.ravel(result.tensor)) * types.Float(WEIGHT.ravel().astype(result.psf.dtype))))
    return dr.grad(inputs).numpy(), result.plan


def pupil_with(name):
    argument = "height" if name == "pixels" else name
    return lambda samples: Pupil(
        SCENE.radius, **{argument: MAPS[name](samples)}, n=SCENE.n, thin_lens_focal_length=SCENE.focal_length
    )


@lru_cache(maxsize=4)
def samples(name, values, n):
    x, y = np.meshgrid(lines_of_knots(n), lines_of_knots(n))
    unit = 0.7 if name == "mask" else PATHS[name][1]
    least = 0.7 if name == "mask" else 0.0  # a jumping mask would exceed 1 between samples
    return {
        "zeros": np.zeros((n, n)),
        "constant": np.full((n, n), 0.7 * unit),
        "smooth": unit * np.exp(-((x - 0.2) ** 2) - y**2),
        "random": unit * (least + (1 - least) * np.random.default_rng(n).random((n, n))),
    }[values]


@lru_cache(maxsize=4)
def exact_gradient(name, values, n):
    lines, basis = (lines_of_pixels(n), pixel) if name == "pixels" else (lines_of_knots(n), spline)
    nodes = disk_nodes(lines, {8: 9, 32: 7, 64: 6}[n])
    across, along = basis(n, nodes[0]), basis(n, nodes[1])
    here = np.einsum("pi,ij,pj->p", along, samples(name, values, n), across, optimize=True)
    factor = PATHS[name][0] if name in PATHS else 0.0
    path, amplitude = (0 * here, here) if name == "mask" else (factor * here, np.ones_like(here))
    _, q = psf_and_adjoint(SCENE, nodes, path, amplitude, WEIGHT.ravel())
    slope = q.real if name == "mask" else (1j * SCENE.wavenumber * factor * q).real
    return along.T @ (slope[:, None] * across)


def error(found, exact):
    return np.linalg.norm(found - exact) / np.linalg.norm(exact)


@pytest.mark.fast_cases(6)
@pytest.mark.parametrize("tolerance", [1e-2, 1e-4, 1e-6])
@pytest.mark.parametrize(
    ("name", "values", "n"),
    [
        (name, values, n)
        for name in MAPS
        for values in ("zeros", "constant", "smooth", "random")
        for n in (8, 32)
        if (name, values) != ("mask", "zeros")  # behind a mask of zeros there is no light
    ]
    + [slow(name, "random", 64) for name in MAPS]
    + [slow("height", "zeros", 64)],
)
def test_gradients_by_the_samples_of_maps(name, values, n, tolerance):
    found, plan = gradient(samples(name, values, n), pupil_with(name), tolerance)
    assert error(found, exact_gradient(name, values, n)) < min(5 * tolerance, 1.5 * plan.derivative_error)
    assert plan.derivative_error in (tolerance, 3 * tolerance)


def test_a_flat_map_of_every_user_s_first_step():
    """The PSF alone needs 119 nodes. For 1,024 unknowns, they would give a gradient of the wrong sign, so the plan has
    more, and states the reason.
    """
    found, plan = gradient(np.zeros((32, 32)), pupil_with("height"), 1e-2)
    assert np.corrcoef(found.ravel(), exact_gradient("height", "zeros", 32).ravel())[0, 1] > 0.9995
    assert "derivatives with respect to samples of maps need more samples (height: 32 x 32)" in plan.why
    assert "derivatives      error up to 3.0e-02" in str(plan)


@pytest.mark.fast_cases(2)
@pytest.mark.parametrize("tolerance", [1e-2, 1e-4, 1e-6])
@pytest.mark.parametrize("flat", [True, False])
@pytest.mark.parametrize("name", ["control points", "zernike 4", "zernike 9"])
def test_gradients_by_smooth_coefficients(name, flat, tolerance):
    # With 7 borders and 9 nodes between them, the exact gradient by modes of order 9 has an error of 4e-5.
    borders, across = (21, 11) if name == "zernike 9" else (7, 9)
    nodes = disk_nodes(np.linspace(-0.75, 0.75, borders), across)
    if name == "control points":
        basis = np.einsum("ip,jp->ijp", cubic((nodes[1] + 1) / 2), cubic((nodes[0] + 1) / 2)).reshape(16, -1)
        scale, unit, factor = (4, 4), 0.5e-6, SCENE.n - 1
    else:
        order = int(name.split()[1])
        basis = np.stack([mode(n, m, *nodes[:2]) for n in range(order + 1) for m in range(-n, n + 1, 2)])
        scale, unit, factor = (len(basis),), 0.02, -1e-6

    def make(values):
        bent = {"wavefront": Zernike(values)} if "zernike" in name else {"height": BSplineRelief(values), "n": SCENE.n}
        return Pupil(SCENE.radius, thin_lens_focal_length=240e-6, **bent)

    values = np.zeros(scale) if flat else unit * np.random.default_rng(3).standard_normal(scale)
    _, q = psf_and_adjoint(SCENE, nodes, factor * (values.ravel() @ basis), np.ones_like(nodes[0]), WEIGHT.ravel())
    exact = basis @ (1j * SCENE.wavenumber * factor * q).real
    found, plan = gradient(values, make, tolerance)
    assert error(found.ravel(), exact) < 5 * tolerance
    assert plan.derivative_error in (tolerance, 3 * tolerance)


def cubic(t):
    """Return the four cubic B-splines of a uniform patch at t in [0, 1]."""
    return np.stack([(1 - t) ** 3, 3 * t**3 - 6 * t**2 + 4, -3 * t**3 + 3 * t**2 + 3 * t + 1, t**3]) / 6


NUMBERS = {"radius": 25e-6, "distance": 240e-6, "n": 1.5, "focal_length": 240e-6, "source_distance": 5e-3}


@pytest.mark.fast_cases(5)
@pytest.mark.parametrize(
    ("height", "tolerance"), [(0.0, 1e-2), (0.0, 1e-6), (1e-9, 1e-4), (0.3e-6, 1e-2), (0.3e-6, 1e-6)]
)
@pytest.mark.parametrize("name", sorted(NUMBERS))
def test_derivatives_by_single_numbers(name, height, tolerance):
    """The derivative of every sample of the PSF is compared. Without derivatives, a height of 1 nm would be
    neglected.
    """
    import drjit as dr

    relief = np.random.default_rng(4).random((12, 12)) * height

    def psf(value, tolerance):
        at = {**NUMBERS, name: value}
        lens = Pupil(at["radius"], HeightMap(relief), n=at["n"], thin_lens_focal_length=at["focal_length"])
        return optics.psf(
            lens,
            [SCENE.wavelength],
            source_distance=at["source_distance"],
            **view(tolerance, sensor_distance=at["distance"]),
        )

    x = asking(NUMBERS[name])
    result = psf(x, tolerance)
    dr.forward(x)
    found, step = dr.grad(result.tensor).numpy(), 1e-5 * NUMBERS[name]
    exact = (psf(NUMBERS[name] + step, 1e-9).psf - psf(NUMBERS[name] - step, 1e-9).psf) / (2 * step)
    if name == "n" and height == 0:
        np.testing.assert_array_equal(found, 0)
    else:
        assert error(found, exact) < 5 * tolerance + (1e-4 if height == 1e-9 and name == "n" else 1e-6)


@pytest.mark.parametrize("reach", [None, 31e-6])
def test_maps_with_different_knots(reach):
    """Relief, wavefront and mask have different knots, and the amplitude is a product of two splines."""
    height, wavefront, mask = (samples(name, "smooth", n) for name, n in (("height", 9), ("wavefront", 6), ("mask", 7)))
    half = 1.0 if reach is None else reach / SCENE.radius
    nodes = disk_nodes(np.unique(np.concatenate([lines_of_knots(9), lines_of_knots(6) * half, lines_of_knots(7)])), 7)
    of_height, of_wavefront, of_mask = (
        (spline(n, nodes[1] / side), spline(n, nodes[0] / side)) for n, side in ((9, 1.0), (6, half), (7, 1.0))
    )

    def at_nodes(values, basis):
        return np.einsum("pi,ij,pj->p", basis[0], values, basis[1], optimize=True)

    path = (SCENE.n - 1) * at_nodes(height, of_height) - at_nodes(wavefront, of_wavefront)
    amplitude = at_nodes(mask, of_mask)
    _, q = psf_and_adjoint(SCENE, nodes, path, amplitude, WEIGHT.ravel())
    waves = (1j * SCENE.wavenumber * amplitude * q).real

    def pupil(height=height, wavefront=wavefront, mask=mask):
        maps = {"height": HeightMap(height), "wavefront": WavefrontMap(wavefront, reach), "mask": MaskMap(mask)}
        return Pupil(SCENE.radius, n=SCENE.n, thin_lens_focal_length=SCENE.focal_length, **maps)

    for name, values, basis, slope in (
        ("height", height, of_height, (SCENE.n - 1) * waves),
        ("wavefront", wavefront, of_wavefront, -waves),
        ("mask", mask, of_mask, q.real),
    ):
        found, _ = gradient(values, lambda given, name=name: pupil(**{name: given}), 1e-3)
        assert error(found, basis[0].T @ (slope[:, None] * basis[1])) < 2e-3, name


def test_only_enabled_gradients_need_nodes():
    import drjit as dr

    flat = np.zeros((32, 32))
    plain, tensor = map(pupil_with("height"), (flat, precision("float64").Tensor64(flat)))
    plans = [optics.psf(pupil, [SCENE.wavelength], **view(1e-2)).plan for pupil in (plain, tensor)]
    assert plans[0].samples == plans[1].samples
    assert plans[0].derivative_error is None
    asked = pupil_with("height")(asking(np.zeros((32, 32))))
    with dr.suspend_grad():
        assert optics.psf(asked, [SCENE.wavelength], **view(1e-2)).plan.samples == plans[0].samples


def test_approximations_are_not_chosen_for_derivatives():
    """The density of rays approximates a wide shadow to 0.4, but the derivative at its edges is wrong."""
    seen = {"sensor_distance": 0.5e-3, "dx": 30e-6, "shape": (33, 33), "tolerance": 0.4}
    assert optics.psf(Pupil(1e-3), **seen).plan.method == "geometric"
    plan = optics.psf(Pupil(asking(1e-3)), **seen).plan
    assert plan.method == "hankel"
    assert plan.derivative_error in (0.4, 1.2)
    named = optics.psf(Pupil(asking(1e-3)), method="geometric", **seen).plan
    assert named.derivative_error is None
    assert "an approximation predicts no error of derivatives" in named.why


@pytest.mark.parametrize("method", ["geometric", "fresnel", "far_field", "hankel"])
def test_methods_without_nodes_between_knots_are_refused(method):
    with pytest.raises(AccuracyError, match=rf"'{method}': cannot compute derivatives with respect to samples of maps"):
        gradient(np.zeros((8, 8)), pupil_with("height"), 1e-2, method=method)


@pytest.mark.parametrize(
    ("radius", "message"),
    [
        (5e-3, r"derivatives with respect to samples of maps \(height: 8 x 8\) need too many nodes: widen"),
        (4e-4, r"for derivatives with respect to samples of maps \(height: 8 x 8\) needs \d+ samples across"),
    ],
)
def test_nodes_beyond_the_limits_are_refused(radius, message):
    pupil = Pupil(radius, HeightMap(asking(np.zeros((8, 8)))))
    with pytest.raises(AccuracyError, match=message):
        optics.psf(pupil, sensor_distance=radius, dx=radius / 500, shape=(2049, 2049))


@pytest.mark.parametrize("name", ["thin_lens_focal_length", "source_distance"])
def test_a_sensor_that_would_follow_the_lens_is_refused(name):
    """The default distance of the sensor carries no derivative, so it would stay fixed without a message."""
    distance = {"source_distance": asking(5e-3)} if name == "source_distance" else {}
    focal = asking(240e-6) if name == "thin_lens_focal_length" else 240e-6
    lens = Pupil(25e-6, thin_lens_focal_length=focal)
    message = f"sensor_distance is missing: {name} carries a derivative"
    with pytest.raises(ValueError, match=message):
        optics.psf(lens, shape=(9, 9), **distance)
    with pytest.raises(ValueError, match=message):
        optics.psf_batch([lens], shape=(9, 9), source_distances=list(distance.values()) or [np.inf])
    assert optics.psf(lens, sensor_distance=240e-6, shape=(9, 9), **distance).plan.derivative_error


def test_coefficients_of_a_spline_through_one_sample():
    n, t = 41, np.cos(np.pi * (np.arange(8) + 0.5) / 8)
    pieces = [spline(n, (2 * (cell + (t + 1) / 2) + 1) / n - 1)[:, n // 2] for cell in range(8, 32)]
    found = np.array([np.polynomial.chebyshev.chebfit(t, piece, 3) for piece in pieces])
    size = np.sqrt(np.square(found).sum(axis=0))
    np.testing.assert_allclose(size / size[0], SPLINE, atol=1e-3)
