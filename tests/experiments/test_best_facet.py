"""The best facet: both criteria against closed forms, one ommatidium for all diameters, and the page."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from experiments.best_facet import (
    COARSEST,
    GRATING,
    LAW,
    OCTAVE,
    RADIUS,
    WAVELENGTH,
    Row,
    Seen,
    information,
    least_parameter,
    page,
    resolved,
    seen,
)
from experiments.store import Origin, read_rows

RESULTS = Path(__file__).parents[2] / "docs/results"
CYCLES = np.linspace(0, 1.25, 200)


def test_grating_of_a_gaussian_ommatidium():
    """The closed form for M = exp(-q u²) is c M √N = 1 at u² = ln(c² N) / 2q, with u = λ/(√3 p)."""
    one = Seen(CYCLES, np.exp(-2.0 * CYCLES**2), 50.0)
    for light in (1.0, 10.0):
        u = math.sqrt(math.log(GRATING**2 * 50 * light) / 4)
        assert least_parameter(one, light) == pytest.approx(LAW / u, rel=0.01)
    assert math.isnan(least_parameter(one, 0.2)), "0.3 √10 < 1"
    spacing = math.sqrt(2.0 * WAVELENGTH / RADIUS)
    assert resolved(2.0) == pytest.approx(1 / (math.sqrt(3) * spacing))


def test_information_without_aliases():
    """Frequencies up to f₁, all of them below the lattice's finest frequency, are transferred completely: the integral
    of ½ log2(1 + a/f²) over a ring has a closed form."""
    u = 0.25
    one = Seen(np.array([0, u, u + 1e-9, 1.0]), np.array([1, 1, 0, 0.0]), 40.0)
    parameter, light = LAW / 0.5, 3.0
    diameter = math.sqrt(parameter * WAVELENGTH * RADIUS)
    last, cell = u * diameter / WAVELENGTH, math.sqrt(3) / 2 * (diameter / RADIUS) ** 2
    a = OCTAVE**2 / (2 * math.pi * math.log(2)) * 40 * light / cell

    def below(f):
        return math.pi / 2 / math.log(2) * (f * f * math.log1p(a / f**2) + a * math.log(f * f + a))

    assert information(one, parameter, light) == pytest.approx(below(last) - below(COARSEST), rel=0.05)


def test_information_with_aliases():
    """A rectangular grid of frequencies, with the aliases added one by one, gives the same."""
    one, parameter, light = Seen(CYCLES, np.maximum(1 - CYCLES, 0), 40.0), 2.0, 100.0
    diameter = math.sqrt(parameter * WAVELENGTH * RADIUS)
    spacing = diameter / RADIUS
    b = 2 / (math.sqrt(3) * spacing)
    steps = (np.arange(300) + 0.5) / 300 - 0.5
    u, v = np.meshgrid(steps, steps)
    x, y = b * (u + v / 2), b * math.sqrt(3) / 2 * v
    total = np.zeros_like(x)
    for i in range(-6, 7):
        for j in range(-6, 7):
            f = np.hypot(x + b * (i + j / 2), y + b * math.sqrt(3) / 2 * j)
            m = np.maximum(1 - f * WAVELENGTH / diameter, 0)
            total += OCTAVE**2 / (2 * math.pi * math.log(2)) * m**2 / f**2
    cell = math.sqrt(3) / 2 * spacing**2
    bits = 0.5 * np.log2(1 + total * 40 * light / cell)
    expected = float(bits[np.hypot(x, y) > COARSEST].sum()) * (b * b * math.sqrt(3) / 2 / 300**2)
    assert information(one, parameter, light) == pytest.approx(expected, rel=0.01)


def test_one_ommatidium_serves_all_diameters():
    """Contrast per λ/D and photons are those of a facet of another size."""
    small, large = (seen(1e-6, 2.0, diameter) for diameter in (18e-6, 50e-6))
    assert large.photons == pytest.approx(small.photons, rel=0.01)
    np.testing.assert_allclose(large.contrast, small.contrast, atol=0.01)


def test_page_is_what_its_store_says():
    rows, origin = read_rows(Row, RESULTS / "data/best_facet.csv"), Origin.read(RESULTS / "data/best_facet.json")
    assert page(rows, origin).markdown == (RESULTS / "best_facet.md").read_text(encoding="utf-8")
    best = {(row.illuminance, row.criterion): row.parameter for row in rows if row.eye == "best"}
    lights = sorted({light for light, _ in best})
    acuity = np.array([best[light, "acuity"] for light in lights])
    assert (np.diff(acuity[np.isfinite(acuity)]) < 0).all(), "p falls as light increases"
    assert acuity[-1] == pytest.approx(LAW, rel=0.05), "λ/√3 in bright light"


def test_less_light_or_contrast_needs_wider_facets():
    one = Seen(CYCLES, np.exp(-2.0 * CYCLES**2), 50.0)
    assert least_parameter(replace(one, photons=25.0), 2.0) == least_parameter(one, 1.0)
    assert information(replace(one, photons=25.0), 1.5, 2.0) == pytest.approx(information(one, 1.5, 1.0))
    assert least_parameter(one, 1.0) > least_parameter(one, 10.0)
