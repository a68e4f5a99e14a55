"""The method of one wavelength is tried first for the next wavelength, unless it has become expensive."""

from dataclasses import replace

import optics
from optics.elements.source import PointSource
from optics.numerics.grid import Grid
from optics.point_spread.request import Setup

PUPIL = optics.Pupil(
    30e-6, optics.BSplineRelief(1e-9 * optics.BSplineRelief.paraboloid(0, 1, 1).control_points.cumsum(1))
)
SETUP = Setup(240e-6, PointSource(), Grid.square(65, 0.5e-6), 1e-2, "auto", "float32")


def test_what_did_for_one_wavelength_does_for_the_next():
    first, second = (SETUP.request(PUPIL, wavelength) for wavelength in (500e-9, 600e-9))
    plan, _ = first.planned()
    again, _ = second.after(first, plan).planned()
    assert again.method == plan.method
    assert len(again.options) == 1
    assert "same method as at the previous wavelength" in again.why


def test_what_takes_longer_is_weighed_anew():
    first, second = (SETUP.request(PUPIL, wavelength) for wavelength in (500e-9, 600e-9))
    plan, _ = first.planned()
    quicker = replace(plan, seconds=plan.seconds / 2)
    again, _ = second.after(first, quicker).planned()
    assert "same method" not in again.why
    assert again == second.planned()[0]


def test_other_pupils_and_approximations_are_weighed():
    first, other = (SETUP.request(pupil, 500e-9) for pupil in (PUPIL, optics.Pupil(30e-6)))
    plan, _ = first.planned()
    assert other.after(first, plan) is other
    assert first.after(first, replace(plan, method="fresnel")) is first
