"""Pupils with steep reliefs: their light convolved with a Gaussian, and PSFs from its samples."""

from dataclasses import replace

import numpy as np
import pytest

import optics
from optics.apertures.aperture import Aperture
from optics.elements.beam import Beam
from optics.elements.source import PointSource
from optics.methods.problem import Problem
from optics.methods.smooth_pupil import SmoothPupil, sides_of
from optics.methods.smooth_spectrum import may_be_steep, smooth_spectrum
from optics.numerics.grid import Grid

LIGHT = PointSource(np.inf, (0.0, 0.0))


def rough(points: int, height: float, seed: int = 3) -> np.ndarray:
    return height * np.random.default_rng(seed).random((points, points))


@pytest.mark.parametrize(
    ("aperture", "known"),
    [
        (optics.Circle(), True),
        (optics.Annulus(0.5), True),
        (optics.Slit(0.5, 1.5), True),
        *((optics.Polygon.regular(n, 90.0), True) for n in range(3, 7)),
        (optics.Rings((0.0, 0.3, 0.6, 1.0)), False),
        (optics.union(optics.Disk(0.4, (0.4, 0.0)), optics.Disk(0.4, (-0.4, 0.0))), False),
        (optics.Polygon([(0.9, 0.0), (0.0, 0.1), (-0.9, 0.0), (0.0, 0.9)]), False),
    ],
)
def test_apertures_of_genomes_are_intersections_of_sides(aperture: Aperture, known: bool):
    assert (sides_of(aperture) is not None) == known


@pytest.mark.parametrize("slope", [0.2, 3.0])
@pytest.mark.parametrize(("aperture", "error"), [(optics.Slit(1.0, 1.6), 1e-8), (optics.Circle(), 4e-3)])
def test_light_is_the_convolution_with_a_gaussian(aperture, error, slope):
    """The convolution is exact for a quadratic phase within straight sides, also at corners. Circles are nearly
    straight over the Gaussian's width.
    """
    radius, width = 10e-6, 0.2e-6
    wavefront = optics.Zernike({(1, 1): 2.5 * slope, (1, -1): 1.5 * slope, (2, 0): 0.8}, radius)
    beam = Beam(optics.Pupil(radius, aperture=aperture, wavefront=wavefront), LIGHT, 0.5e-6, 1e-3)
    corner = (5e-6, 8e-6) if isinstance(aperture, optics.Slit) else (6e-6, 8e-6)
    x, y = (at + 0.1e-6 * np.arange(-6, 7) for at in corner)
    found = SmoothPupil(sides_of(aperture), radius, width).light(beam, x, y, np.float64)
    nodes, weights = np.polynomial.legendre.leggauss(160)
    for i, j in ((6, 3), (3, 5), (5, 4)):
        top = min(y[i] + 7 * width, corner[1] if isinstance(aperture, optics.Slit) else radius)
        low, left = y[i] - 7 * width, x[j] - 7 * width
        v = (top + low) / 2 + (top - low) / 2 * nodes
        edge = np.full(v.shape, corner[0]) if isinstance(aperture, optics.Slit) else np.sqrt(radius**2 - v**2)
        half = (np.minimum(x[j] + 7 * width, edge) - left)[:, None] / 2
        u, v = left + half * (1 + nodes), v[:, None]
        bell = np.exp(-((u - x[j]) ** 2 + (v - y[i]) ** 2) / (2 * width**2)) / (2 * np.pi * width**2)
        light = bell * np.exp(2j * np.pi * beam.waves(u, np.broadcast_to(v, u.shape)))
        exact = weights @ (half * light) @ weights * (top - low) / 2
        assert abs(found[i, j] - exact) < error


@pytest.mark.parametrize("aperture", [optics.Circle(), optics.Polygon.regular(3, 90.0)])
def test_psf_of_a_steep_relief_equals_the_direct_sum(aperture):
    """Slopes of the relief correspond to sines above 2.5, and much of the light misses the window."""
    pupil = optics.Pupil(2.5e-6, height=rough(6, 5.6e-6), aperture=aperture)
    beam, window = Beam(pupil, LIGHT, 0.5e-6, 15e-6), Grid.square(11, 1.6e-6)
    problem = replace(Problem.from_beam(beam, window, 1e-2), steep=True, reach=window.half_width)
    assert problem.slopes.steepest_inside > 2.5
    sampling = min(smooth_spectrum(problem), key=lambda each: each.seconds)
    found = sampling.intensity(beam, problem).numpy() / pupil.area
    where = {"dx": window.dx, "shape": window.shape, "sensor_distance": beam.distance}
    result = optics.psf(pupil, beam.wavelength, **where, method="rayleigh_sommerfeld", tolerance=1e-2)
    exact = result.psf.ravel()
    inside = (np.add.outer(window.y**2, window.x**2) <= problem.reach**2).ravel()
    assert (found[~inside] == 0).all()
    assert np.linalg.norm((found - exact)[inside]) < problem.tolerance / 2 * np.linalg.norm(exact[inside])


@pytest.mark.parametrize(
    ("change", "suited"),
    [
        ({}, True),
        ({"height": None}, False),
        ({"height": None, "wavefront": optics.Zernike({(4, 0): 3.0})}, True),
        ({"n": 1.0}, False),
        ({"mask": optics.GaussianMask(20e-6)}, False),
        ({"height": optics.PixelRelief(rough(6, 1e-6))}, False),
        ({"aperture": optics.union(optics.Disk(0.4, (0.4, 0.0)), optics.Disk(0.4, (-0.4, 0.0)))}, False),
    ],
)
def test_smooth_samples_are_for_bare_reliefs_and_wavefronts(change, suited):
    pupil = replace(optics.Pupil(20e-6, height=rough(6, 14e-6)), **change)
    assert may_be_steep(Beam(pupil, LIGHT, 0.5e-6, 1e-3)) is suited
