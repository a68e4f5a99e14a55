"""A lens found by gradient descent: from a flat relief to a focus, in seconds.

The relief is the one in the genome of rhabdom's eyes: 4 x 4 control points of one bicubic B-spline patch. The objective
is the light within a spot on the axis, which shrinks from stage to stage. Dr.Jit computes the derivative of the PSF
with respect to every control point.

    python examples/02_lens_by_gradient.py
"""

from __future__ import annotations

import sys
import time

import numpy as np
from scipy.optimize import minimize

from rhabdom import optics

WAVELENGTH, FOCAL_LENGTH, F_NUMBER, INDEX = 550e-9, 240e-6, 4, 1.5
RADIUS = FOCAL_LENGTH / (2 * F_NUMBER)
SPOTS = (16e-6, 6e-6, 2e-6)  # standard deviations of the target spot [m]
UNIT = 1e-6  # the optimiser works in µm


def gathered(points: np.ndarray, spot: float) -> tuple[float, np.ndarray]:
    """Return the negative logarithm of the light within a Gaussian spot, and its gradient [1/µm] by control point."""
    import drjit as dr
    from drjit.llvm.ad import Float64, TensorXf64

    heights = TensorXf64(points.reshape(4, 4) * UNIT)
    dr.enable_grad(heights)
    pupil = optics.Pupil(RADIUS, optics.BSplineRelief(heights), n=INDEX)
    dx = spot / 4
    side = 2 * int(np.ceil(min(3 * spot, 1.2 * RADIUS) / dx)) + 1
    result = optics.psf(pupil, [WAVELENGTH], FOCAL_LENGTH, dx=dx, shape=(side, side), tolerance=1e-3)
    weight = np.exp(-(result.x[None, :] ** 2 + result.y[:, None] ** 2) / (2 * spot**2)) * dx**2
    loss = -dr.log(dr.sum(Float64(result.tensor.array) * Float64(weight.ravel())))
    dr.backward(loss)
    return float(loss[0]), dr.grad(heights).numpy().ravel() * UNIT


def find() -> tuple[np.ndarray, list[tuple[float, float, int]]]:
    """Return control points [m], and (spot, Strehl ratio, evaluations) after each stage."""
    points, stages, calls = np.zeros(16), [], 0
    for spot in SPOTS:
        found = minimize(gathered, points, args=(spot,), jac=True, method="L-BFGS-B", options={"maxiter": 25})
        points, calls = found.x, calls + found.nfev
        stages.append((spot, strehl(points.reshape(4, 4) * UNIT), calls))
    return points.reshape(4, 4) * UNIT, stages


def strehl(control_points: np.ndarray) -> float:
    pupil = optics.Pupil(RADIUS, optics.BSplineRelief(control_points), n=INDEX)
    return float(optics.strehl_ratio(optics.psf(pupil, [WAVELENGTH], FOCAL_LENGTH))[0])


def paraboloid() -> np.ndarray:
    """Return the control points of a thin lens of the same focal length, whose curvature is 1 / ((n - 1) f)."""
    return optics.BSplineRelief.paraboloid(0.0, 1 / ((INDEX - 1) * FOCAL_LENGTH), RADIUS).control_points


if __name__ == "__main__":
    start = time.perf_counter()
    relief, stages = find()
    print(f"f/{F_NUMBER}, f = {FOCAL_LENGTH * 1e6:g} µm, {WAVELENGTH * 1e9:g} nm, n = {INDEX}")
    print(f"flat relief               Strehl ratio {strehl(np.zeros((4, 4))):.4f}")
    for spot, ratio, calls in stages:
        print(f"spot {spot * 1e6:4g} µm  {calls:4d} PSFs  Strehl ratio {ratio:.4f}")
    print(f"paraboloid, for comparison  Strehl ratio {strehl(paraboloid()):.4f}")
    print(f"{time.perf_counter() - start:.1f} s")
    if stages[-1][1] < 0.8:
        sys.exit("the search did not find a lens")
