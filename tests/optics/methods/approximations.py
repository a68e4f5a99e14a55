"""Random pupils, and the errors of the approximations on them."""

import numpy as np

import optics
from optics import BSplineRelief, Grid, PointSource, Pupil
from optics.elements.beam import Beam
from optics.methods.problem import Problem
from optics.point_spread.planner import choose
from validation.reference import relative_l2

KINDS = ("flat", "lens", "defocus", "relief")


def random_case(rng, fresnel_numbers=(0.01, 30.0)):
    """A pupil, wavelength, distance and window [m] that holds most of the light; NA 0.003 to 0.7."""
    while True:
        wavelength, radius = rng.uniform(400e-9, 700e-9), 10 ** rng.uniform(-6, -4.3)
        low, high = np.log10(fresnel_numbers)
        z = radius**2 / wavelength / 10 ** rng.uniform(low, high)
        if 1 < z / radius < 300:
            break
    kind, height, focal_length = rng.choice(KINDS), None, None
    if kind == "relief":
        height = BSplineRelief(rng.random((4, 4)) * rng.uniform(0, min(20e-6, radius)))
    elif kind != "flat":
        focal_length = z * (1 if kind == "lens" else rng.choice([-1, 1]) * rng.uniform(0.3, 3))
    pupil = Pupil(radius, height, thin_lens_focal_length=focal_length)
    x, _ = pupil.slopes(wavelength, PointSource()).rays(z, 1.0)
    half = rng.uniform(1, 2) * (np.quantile(np.abs(x), 0.9) + 0.6 * wavelength * z / radius)
    return pupil, wavelength, z, Grid.square(33, 2 * half / 33)


def predicted_and_actual(case, method):
    """Return the planner's predicted error of a method, its actual error, and the error that the PSF's plan predicts.

    The actual error is relative to the exact integral. The method is requested by its name.
    """
    pupil, wavelength, z, window = case
    task = Problem.from_beam(Beam(pupil, PointSource(), wavelength, z), window, 1e-3)
    settings = {"dx": window.dx, "shape": window.shape}
    found = optics.psf(pupil, [wavelength], z, **settings, method=method)
    exact = optics.psf(pupil, [wavelength], z, **settings, method="exact", tolerance=1e-4)
    return choose(task, method)[0].predicted_error, relative_l2(found.psf, exact.psf), found.plan.predicted_error
