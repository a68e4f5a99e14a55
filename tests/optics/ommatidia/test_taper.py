"""Tapered waveguides: against stairs of cylinders, closed forms and a beam propagation of the wave equation."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.linalg import solve_banded

from optics import Ommatidium, Pupil, Waveguide

WAVE = 500e-9
FLY = Waveguide(2e-6, length=250e-6, absorption=6.7e3, proximal_diameter=1e-6)  # Stavenga 2004; V = 3.1 to 1.6
WIDE = Waveguide(10e-6, length=5e-3, absorption=200.0, proximal_diameter=8e-6)  # V = 16 to 13


def mode(guide, name):
    """Return the mode with cos lφ of this name, for example "LP11"; None if the guide has none."""
    return next((one for one in guide.modes(WAVE) if f"LP{one.l}{one.m}" == name and not one.sine), None)


def stairs(guide, name, steps):
    """Return the fraction absorbed in short cylinders, up to the first that does not guide the mode."""
    depth = 0.0
    for step in range(steps):
        diameter = guide.diameter + (guide.proximal_diameter - guide.diameter) * (step + 0.5) / steps
        local = mode(Waveguide(diameter), name)
        if local is None:
            break
        depth += guide.absorption * local.core_share * guide.length / steps
    return 1 - math.exp(-depth)


def propagated(guide, start, steps=1000, cells=400, end=8e-6):
    """Return the fraction that the core absorbs, by the paraxial wave equation in r and z (Crank-Nicolson)."""
    k, clad, h, dz = 2 * math.pi / WAVE, guide.n_clad, end / cells, guide.length / steps
    r = (np.arange(cells) + 0.5) * h
    outward, inward = (np.arange(1, cells + 1) / (r * h))[:-1], (np.arange(cells) / (r * h))[1:]
    rate, wall = 1j * dz / (4 * k * clad), 2e5 * np.clip(r / end / 0.4 - 1.5, 0, 1) ** 2
    field = start.field(r, 0.0).astype(complex)
    field /= math.sqrt((np.abs(field) ** 2 * r).sum() * h)
    taken = 0.0
    for step in range(steps):
        radius = (guide.diameter + (guide.proximal_diameter - guide.diameter) * (step + 0.5) / steps) / 2
        core = np.clip(radius / h - np.arange(cells), 0, 1)
        loss = 1j * k * clad * (guide.absorption * core + wall)
        middle = k**2 * (guide.n_core**2 - clad**2) * core + loss - 2 / h**2 - start.l**2 / r**2
        right = (1 + rate * middle) * field
        right[:-1] += rate * outward * field[1:]
        right[1:] += rate * inward * field[:-1]
        before, bands = field, np.zeros((3, cells), complex)
        bands[0, 1:], bands[1], bands[2, :-1] = -rate * outward, 1 - rate * middle, -rate * inward
        field = solve_banded((1, 1), bands, right)
        taken += guide.absorption * (np.abs((before + field) / 2) ** 2 * core * r).sum() * h * dz
    return taken


@pytest.mark.parametrize("name", ["LP01", "LP11"])
def test_without_a_taper_it_is_the_cylinder(name):
    cylinder = replace(FLY, proximal_diameter=None)
    found = mode(cylinder, name)
    straight = 1 - math.exp(-cylinder.absorption * found.core_share * cylinder.length)
    assert cylinder.absorbed(found) == straight
    assert replace(FLY, proximal_diameter=2e-6).absorbed(found) == pytest.approx(straight, rel=1e-12)
    assert replace(FLY, proximal_diameter=2e-6 - 1e-14).absorbed(found) == pytest.approx(straight, rel=1e-7)
    assert cylinder.guided_length(found) == replace(FLY, proximal_diameter=2e-6).guided_length(found) == FLY.length


def test_stairs_of_cylinders_converge_to_the_taper():
    """The midpoint rule has second order. At the cut-off of LP11, the share in the core falls steeply to 0."""
    errors = [abs(stairs(FLY, "LP01", n) - FLY.absorbed(mode(FLY, "LP01"))) for n in (4, 8, 16, 32)]
    assert np.log2(np.divide(errors[:-1], errors[1:])) == pytest.approx(2, abs=0.1)
    last = [abs(stairs(FLY, "LP11", n) - FLY.absorbed(mode(FLY, "LP11"))) for n in (25, 100, 400)]
    assert last[2] < 1e-4 < last[0] < 0.02


@pytest.mark.parametrize(
    ("guide", "name"), [(FLY, "LP01"), (FLY, "LP11"), (WIDE, "LP01"), (WIDE, "LP51"), (WIDE, "LP05"), (WIDE, "LP14")]
)
def test_the_mean_share_is_that_of_propagation_constants(guide, name):
    """η = (b + d(Vb)/dV)/2 with b = W²/V² (Gloge 1971). Its integral is (Vb)/2 at the ends, plus ∫b dV / 2."""
    first = mode(guide, name)
    v = guide.v_number(WAVE)
    low = max(v * guide.proximal_diameter / guide.diameter, first.cut_off)

    def constant(at):
        local = mode(replace(guide, diameter=guide.diameter * at / v, proximal_diameter=None), name)
        return 0.0 if local is None else (local.w / at) ** 2

    integral = quad(constant, low, v, epsabs=1e-5, epsrel=1e-5, limit=8)[0]
    share = (v * constant(v) - low * constant(low) + integral) / 2 / (v - low)
    depth = guide.absorption * share * guide.guided_length(first)
    assert guide.absorbed(first) == pytest.approx(1 - math.exp(-depth), rel=2e-5)


def test_far_above_cut_off_it_is_beer_lamberts_law():
    """The share outside the core is U²/V³ with U = 2.405 (1 - 1/V), so that its mean over a taper is known."""
    v = WIDE.v_number(WAVE)
    at = np.linspace(0.8 * v, v, 1001)
    outside = np.mean((2.4048 * (1 - 1 / at)) ** 2 / at**3)
    absorbed = WIDE.absorbed(mode(WIDE, "LP01"))
    assert absorbed == pytest.approx(1 - math.exp(-1), rel=2e-3)
    assert 1 + math.log(1 - absorbed) == pytest.approx(outside, rel=0.05)


def test_a_mode_is_lost_where_the_guide_is_too_thin_for_it():
    first = mode(FLY, "LP11")
    at = FLY.guided_length(first)
    there = FLY.diameter - (FLY.diameter - FLY.proximal_diameter) * at / FLY.length
    assert mode(Waveguide(there * 1.002), "LP11") is not None
    assert mode(Waveguide(there * 0.998), "LP11") is None
    assert first.cut_off == pytest.approx(2.404826)
    assert FLY.guided_length(mode(FLY, "LP01")) == FLY.length
    assert Waveguide(2e-6).guided_length(first) == math.inf
    # The remaining guide makes no difference: this one has the same slope and ends earlier.
    shorter = replace(FLY, length=150e-6, proximal_diameter=1.4e-6)
    assert shorter.absorbed(first) == pytest.approx(FLY.absorbed(first), rel=1e-9)
    assert FLY.absorbed(first) < 0.5 * replace(FLY, proximal_diameter=None).absorbed(first)


@pytest.mark.parametrize("name", ["LP01", "LP11"])
def test_light_of_two_tapers_in_series_is_that_of_one(name):
    """The light that leaves the first part enters the second."""
    parts = replace(FLY, length=75e-6, proximal_diameter=1.7e-6), Waveguide(1.7e-6, 1.363, 1.340, 175e-6, 6.7e3, 1e-6)
    left = [1 - part.absorbed(mode(part, name)) for part in parts]
    assert left[0] * left[1] == pytest.approx(1 - FLY.absorbed(mode(FLY, name)), rel=1e-5)
    assert sum(part.guided_length(mode(part, name)) for part in parts) == pytest.approx(
        FLY.guided_length(mode(FLY, name))
    )


def test_a_beam_propagation_absorbs_the_same():
    """LP01 stays in its mode. LP11 is not lost at once: the core absorbs 6 % more of its light, and less in a slower
    taper.
    """
    first, second = mode(FLY, "LP01"), mode(FLY, "LP11")
    assert propagated(FLY, first) == pytest.approx(FLY.absorbed(first), abs=5e-4)
    assert propagated(FLY, second) - FLY.absorbed(second) == pytest.approx(0.06, abs=0.005)
    slow = replace(FLY, length=2e-3, absorption=FLY.absorption / 8)
    assert slow.absorbed(second) == pytest.approx(FLY.absorbed(second))
    assert 0 < propagated(slow, second) - slow.absorbed(second) < 0.025


def test_an_ommatidium_loses_higher_modes_in_a_taper():
    lens = Pupil(12.5e-6, thin_lens_focal_length=74e-6, medium_n=1.34, object_n=1.0)
    tapered, straight = (Ommatidium(lens, replace(FLY, proximal_diameter=end)) for end in (1e-6, None))
    power = tapered.mode_power(0.01, 0.0, WAVE)
    taken = [FLY.absorbed(one) for one in tapered.modes(WAVE)]
    assert tapered.sensitivity(0.01, 0.0, WAVE) == pytest.approx(float(power @ taken))
    assert tapered.acceptance_angle(WAVE) < 0.85 * straight.acceptance_angle(WAVE)


def test_a_taper_must_be_slow_for_the_first_mode():
    """The radius may shrink by itself per beat length 2π/(β₁ - k n_clad), with β₁² = k² n_core² - U²/b²."""
    k, first = 2 * math.pi / WAVE, mode(FLY, "LP01")
    beta = math.sqrt((k * FLY.n_core) ** 2 - (first.u / first.radius) ** 2)
    least = 0.5e-6 / (first.radius * (beta - k * FLY.n_clad) / (2 * math.pi))
    assert replace(FLY, length=1.02 * least).modes(WAVE) == FLY.modes(WAVE)
    with pytest.raises(ValueError, match=r"length = 1\.57\S+ m: must be at least 1\.6\S+ m at a wavelength of 5e-07 m"):
        replace(FLY, length=0.98 * least).modes(WAVE)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"proximal_diameter": 0.0}, "proximal_diameter = 0"),
        ({"proximal_diameter": math.nan}, "proximal_diameter = nan"),
        ({"proximal_diameter": 2.1e-6}, r"proximal_diameter = 2\.1e-06 m: must be at most diameter = 2e-06 m"),
        ({"length": None}, "length = None: must be a length in m, because proximal_diameter"),
    ],
)
def test_bad_input_names_itself(given, message):
    with pytest.raises(ValueError, match=message):
        replace(FLY, **given)
