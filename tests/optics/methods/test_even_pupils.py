"""Pupils that are mirror-symmetric in x and y: a quarter of the plane gives the result of the whole plane."""

import math
from dataclasses import replace

import drjit as dr
import numpy as np
import pytest

import optics
from optics.elements.beam import Beam
from optics.elements.source import PointSource
from optics.methods.angular_spectrum import split_spectrum, whole_spectrum
from optics.methods.problem import Problem
from optics.numerics.grid import Grid
from optics.numerics.precision import precision
from validation.reference import relative_l2

LAMBDA, Z = 550e-9, 240e-6


def on_both_sides(seed=0, side=4):
    heights = 4e-6 * np.random.default_rng(seed).random((side, side))
    heights = heights + heights[::-1]
    return heights + heights[:, ::-1]


def problem_of(pupil, shape=(65, 65), source=None, **window):
    beam = Beam(pupil, source or PointSource(), LAMBDA, Z)
    return beam, Problem.from_beam(beam, Grid(shape, 1.2e-6, **window), 1e-3)


EVEN = {
    "circle": optics.Pupil(30e-6, optics.BSplineRelief(on_both_sides())),
    "slit": optics.Pupil(40e-6, optics.BSplineRelief(on_both_sides(1)), aperture=optics.Slit(0.5, 1.5)),
    "map": optics.Pupil(30e-6, on_both_sides(2, 6), thin_lens_focal_length=200e-6),
}


@pytest.mark.fast_cases(2)
@pytest.mark.parametrize("shape", [(65, 65), (48, 77)])
@pytest.mark.parametrize("ways", [whole_spectrum, split_spectrum])
@pytest.mark.parametrize("name", EVEN)
def test_a_quarter_tells_the_whole_picture(name, ways, shape):
    beam, problem = problem_of(EVEN[name], shape)
    assert problem.even
    how = min(ways(problem), key=lambda sampling: sampling.seconds)
    assert how.even
    image = how.intensity(beam, problem).numpy().reshape(shape) / beam.pupil.area
    ask = {"method": "rayleigh_sommerfeld", "tolerance": 1e-5}
    exact = optics.psf(beam.pupil, [LAMBDA], Z, dx=1.2e-6, shape=shape, **ask).psf[0]
    assert relative_l2(image, exact) < 5e-4
    plain = min(ways(replace(problem, even=False)), key=lambda sampling: sampling.seconds)
    assert how.seconds < plain.seconds
    assert how.bytes < 0.4 * plain.bytes


TILTED = np.arange(16.0).reshape(4, 4) * 1e-7
ODD = {
    "aslant": (EVEN["circle"], {"source": PointSource(angle=(0.05, 0.0))}),
    "off the axis": (EVEN["circle"], {"centre": (1e-6, 0.0)}),
    "left is not right": (optics.Pupil(30e-6, optics.BSplineRelief(TILTED[:1] + 0 * TILTED)), {}),
    "above is not below": (optics.Pupil(30e-6, optics.BSplineRelief(TILTED[:, :1] + 0 * TILTED)), {}),
    "hexagon": (replace(EVEN["circle"], aperture=optics.Polygon.regular(3)), {}),
    "coma": (replace(EVEN["circle"], wavefront=optics.Zernike({(3, 1): 0.1})), {}),
    "pixels": (optics.Pupil(30e-6, optics.PixelRelief(on_both_sides(3, 8))), {}),
}


@pytest.mark.parametrize("name", ODD)
def test_what_is_not_even_is_not_taken_for_it(name):
    pupil, options = ODD[name]
    assert not problem_of(pupil, **options)[1].even


def test_derivatives_by_control_points_are_those_of_the_whole_pupil():
    """Changing one control point breaks the symmetry, so its derivative needs the whole pupil; the derivative with
    respect to the index does not.
    """
    heights = on_both_sides()
    points = precision("float64").Tensor64(heights)
    assert not optics.BSplineRelief(points).mirror_symmetric
    assert not optics.Pupil(30e-6, points).height.mirror_symmetric

    def total(n):
        pupil = optics.Pupil(30e-6, optics.BSplineRelief(heights), n=n)
        found = optics.psf(pupil, [LAMBDA], Z, dx=1.2e-6, shape=(33, 33), method="angular_spectrum", dtype="float64")
        weight = np.random.default_rng(5).random(33 * 33)
        return dr.sum(found.tensor.array * precision("float64").Float(weight)) * 1e-10

    n = precision("float64").Float64(1.5)
    dr.enable_grad(n)
    dr.backward(total(n))
    step = 1e-6
    near, far = (total(1.5 + k * step)[0] - total(1.5 - k * step)[0] for k in (1, 2))
    assert n.grad[0] == pytest.approx((8 * near - far) / (12 * step), rel=1e-5)
    assert math.isfinite(n.grad[0])
