"""Parts of a population's common plan, from given numbers, against formulas in double precision."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

import optics
from optics import Grid
from optics.numerics.accuracy import Plan
from optics.point_spread import population
from optics.point_spread.population import RINGS, _Samples, _Stack
from optics.point_spread.population_members import Member, powers
from tests.optics.device_types import Float64

RNG = np.random.default_rng(5)
WINDOW = Grid((5, 7), 2e-6, (0.0, 0.0))
WAVE, Z = 500e-9, 200e-6
RELIEF = optics.BSplineRelief(1e-6 * RNG.random((4, 4)))
PUPILS = [
    optics.Pupil(20e-6, RELIEF, thin_lens_focal_length=150e-6, medium_n=1.25, object_n=1.5),
    optics.Pupil(30e-6, thin_lens_focal_length=-300e-6, mask=optics.GaussianMask(15e-6)),
    optics.Pupil(
        25e-6,
        mask=optics.MaskMap(np.add.outer(np.linspace(0.2, 0.5, 5), np.linspace(0.3, 0.1, 5))),
        wavefront=optics.Zernike({(2, 0): 0.3, (3, 1): 0.2}),
    ),
]
MEMBERS = [Member(pupil, WAVE, Z, source) for pupil, source in zip(PUPILS, (4e-4, math.inf, 3e-4), strict=True)]
AT = np.linspace(-1.1, 1.1, 23).astype(np.float32)
SAMPLES = _Samples(
    AT,
    0.1,
    np.clip(1.2 - np.hypot(AT, AT[:, None]), 0, 1).astype(np.float32),
    np.stack(population.cubic_bsplines((AT.astype(float) + 1) / 2), axis=1).astype(np.float32),
)


def test_numbers_of_members():
    radius, wave, distance, source, focal, before, waist = MEMBERS[0].numbers
    assert (radius, distance, source, focal, waist) == (20e-6, Z, 4e-4, 150e-6, math.inf)
    assert (wave, before) == (pytest.approx(400e-9), pytest.approx(1.2))
    assert MEMBERS[1].numbers[4:] == (-300e-6, 1.0, 15e-6)
    assert MEMBERS[2].numbers[4] == math.inf
    step = PUPILS[0].index_step(WAVE)
    heights = RELIEF.control_points - np.mean(RELIEF.control_points)
    np.testing.assert_allclose(MEMBERS[0].relief, heights * step / WAVE)
    assert not MEMBERS[1].relief.any()
    assert [member.order for member in MEMBERS] == [0, 0, 3]


def test_coefficients_of_wavefronts():
    """Z(2, 0) is √3 (2ρ² - 1), and Z(3, 1) is √8 (3ρ³ - 2ρ) cos θ. A wavefront delays light, in µm. Its constant term
    is left out.
    """
    x, y = RNG.uniform(-0.7, 0.7, (2, 9))
    square = x * x + y * y
    expected = -(0.3 * math.sqrt(3) * 2 * square + 0.2 * math.sqrt(8) * (3 * square - 2) * x) / 0.5
    np.testing.assert_allclose(MEMBERS[2].powers @ powers(x, y, 12), expected)
    wide = optics.Pupil(25e-6, wavefront=optics.Zernike({(2, 0): 0.3}, 50e-6))
    found = Member(wide, WAVE, Z, math.inf).powers @ powers(x, y, 12)
    np.testing.assert_allclose(found, -0.3 * math.sqrt(3) * 2 * square / 4 / 0.5)
    assert not MEMBERS[0].powers.any()
    assert powers(x, y, 1).shape == (3, 9)


def test_details_of_wavefronts_and_masks():
    """Frequencies are in cycles per radius."""
    wavefront, mask = optics.Zernike({(3, 1): 0.2}), optics.GaussianMask(15e-6)
    alone = Member(optics.Pupil(25e-6, wavefront=wavefront), WAVE, Z, math.inf).detail
    assert alone == pytest.approx(wavefront.bandwidth(0.0))
    wider = optics.Zernike({(3, 1): 0.2}, 50e-6)
    assert Member(optics.Pupil(25e-6, wavefront=wider), WAVE, Z, math.inf).detail == pytest.approx(alone / 2)
    masked = Member(optics.Pupil(25e-6, mask=mask), WAVE, Z, math.inf).detail
    assert masked == pytest.approx(mask.bandwidth(1e-3, 25e-6) * 25e-6)
    both = Member(optics.Pupil(25e-6, mask=mask, wavefront=wavefront), WAVE, Z, math.inf).detail
    assert both == pytest.approx(alone + masked)
    assert Member(optics.Pupil(25e-6), WAVE, Z, math.inf).detail == 0
    assert MEMBERS[1].mask(AT) is None
    np.testing.assert_array_equal(MEMBERS[2].mask(AT), PUPILS[2].mask.on_grid(AT.astype(float), 25e-6))


@pytest.mark.parametrize(
    ("pupil", "plain"),
    [
        (optics.Pupil(10e-6, optics.BSplineRelief(np.zeros((4, 4)))), True),
        (optics.Pupil(10e-6, mask=optics.MaskMap(np.ones((4, 4)))), True),
        (optics.Pupil(10e-6, wavefront=optics.Zernike({(12, 0): 0.1})), True),
        (optics.Pupil(10e-6, wavefront=optics.Zernike({(13, 1): 0.1})), False),
        (optics.Pupil(Float64(10e-6)), False),
        (optics.Pupil(10e-6, thin_lens_focal_length=Float64(1e-3)), False),
        (optics.Pupil(10e-6, np.zeros((5, 5))), False),
    ],
)
def test_members_that_the_plan_supports(pupil, plain):
    assert Member(pupil, WAVE, Z, math.inf).plain is plain
    assert not Member(pupil, WAVE, Float64(Z), math.inf).plain
    assert not Member(pupil, WAVE, Z, Float64(1.0)).plain


def test_stacks_hold_the_numbers_of_their_members():
    stack = _Stack.from_members(MEMBERS)
    for name, column in zip(
        ("radius", "wavelength", "distance", "source", "focal", "before", "waist"), range(7), strict=True
    ):
        expected = np.array([member.numbers[column] for member in MEMBERS], np.float32).reshape(3, 1, 1)
        np.testing.assert_array_equal(getattr(stack, name), expected)
    assert stack.order == 3
    np.testing.assert_array_equal(stack.powers, [member.powers[:10] for member in MEMBERS])
    plain = _Stack.from_members(MEMBERS[:2])
    assert (plain.order, plain.powers.shape) == (0, (2, 1))
    assert stack.relief.dtype == np.float32


def test_samples_of_a_soft_aperture(monkeypatch):
    """The pitch resolves the turns of the phase and the stop band of the edge."""
    asked = []

    class Soft:
        stopband, reach = 3.0, 1.25

        def transmittance(self, x, y, types):
            return x * 0 + y

    aperture = SimpleNamespace(soften=lambda *given: asked.append(given) or Soft())
    found = population._samples.__wrapped__(aperture, 5.0, 1e-2)
    assert asked == [(5.0, 1e-2, population.EDGE_REACH)]
    assert found.pitch == 1 / 8
    np.testing.assert_allclose(found.at, (np.arange(37) - 18) / 8)  # 2.25 radii on either side
    np.testing.assert_allclose(found.soft, np.repeat(found.at[:, None], 37, axis=1), rtol=1e-6)
    splines = population.cubic_bsplines((found.at.astype(float) + 1) / 2)
    np.testing.assert_allclose(found.splines, np.stack(splines, axis=1), rtol=1e-5, atol=1e-6)
    assert {part.dtype for part in (found.at, found.soft, found.splines)} == {np.dtype(np.float32)}


def test_amplitudes_of_masks():
    stack = _Stack.from_members(MEMBERS)
    found = population._masks(stack, SAMPLES)
    at = AT.astype(float)
    gaussian = np.exp(-((30 / 15) ** 2) * (at**2 + at[:, None] ** 2))
    for amplitudes, expected in zip(found, (np.ones((23, 23)), gaussian, MEMBERS[2].mask(AT)), strict=True):
        np.testing.assert_allclose(amplitudes, expected, rtol=1e-4, atol=1e-6)
    assert population._masks(_Stack.from_members(MEMBERS[:1]), SAMPLES).tolist() == np.ones((1, 23, 23)).tolist()


def test_light_that_masks_transmit():
    """It is relative to the brightest light where the soft edge transmits less than half."""
    masks = RNG.random((2, 23, 23)).astype(np.float32)
    masks[1][SAMPLES.soft < 0.5] = 0
    found = population._light(SAMPLES, masks)
    power, soft = masks[0].astype(float) ** 2, SAMPLES.soft.astype(float)
    passed = (power * soft**2).sum() / (soft**2).sum()
    assert found[0] == pytest.approx(passed / power[soft < 0.5].max(), rel=1e-5)
    assert found[1] > 1e20


def test_kernels_along_an_axis():
    stack = _Stack.from_members(MEMBERS[:1])
    xi = 20e-6 * AT.astype(float)
    sines = xi / np.sqrt(Z**2 + xi**2 + (20e-6) ** 2 / 4 + (0.4 * WINDOW.own_half_width) ** 2)
    np.testing.assert_allclose(population._sine(stack, WINDOW, xi)[0, 0], sines, rtol=1e-5)
    x = WINDOW.x[:, None]
    expected = (1 + 2 * xi * x / Z**2) * np.exp(-2j * np.pi * sines * x / 400e-9)
    np.testing.assert_allclose(population._fourier(stack, AT, WINDOW, WINDOW.x)[0], expected, atol=2e-5)


@pytest.mark.parametrize("shape", [(5, 7), (5, 5)])
@pytest.mark.parametrize("chosen", [[0], [1], [2], [0, 1, 2]])
def test_images_are_sums_over_samples(shape, chosen):
    """The oracle adds up the samples in double precision, with paths as differences of square roots."""
    window, members = Grid(shape, 2e-6, (0.0, 0.0)), [MEMBERS[k] for k in chosen]
    stack = _Stack.from_members(members)
    masks = RNG.random((len(members), 23, 23)).astype(np.float32)
    found = population._images(stack, SAMPLES, masks, window)
    u, v = np.meshgrid(AT.astype(float), AT.astype(float))
    splines = SAMPLES.splines.astype(float)
    for member, mask, image in zip(members, masks, found, strict=True):
        radius, wave, z, source, focal, before, _ = member.numbers
        r = radius * np.hypot(u, v)
        path = np.hypot(r, z) - z
        if math.isfinite(source):
            path += before * (np.hypot(r, source) - source)
        if math.isfinite(focal):
            path -= math.copysign(1, focal) * (np.hypot(r, focal) - abs(focal))
        turns = path / wave + splines @ member.relief @ splines.T + np.tensordot(member.powers, powers(u, v, 12), 1)
        light = SAMPLES.soft * mask * z**2 / (r**2 + z**2) * 0.01 * radius / (z * wave) * np.exp(2j * np.pi * turns)
        own = _Stack.from_members([member])
        down, across = (population._fourier(own, AT, window, at)[0].astype(complex) for at in (window.y, window.x))
        exact = np.abs(down @ light @ across.T) ** 2
        exact *= (z**2 / (z**2 + window.x**2 + window.y[:, None] ** 2)) ** 2
        assert np.linalg.norm(image - exact) < 1e-3 * np.linalg.norm(exact)


def test_rings_of_a_window():
    """The outermost ring contains the corners. Empty rings count one sample, against a division by 0."""
    ring, count = population._rings.__wrapped__(WINDOW)
    radius = np.hypot(WINDOW.x, WINDOW.y[:, None]).ravel()
    expected = np.minimum(np.floor(radius / WINDOW.half_diagonal * 12), 11).astype(int)
    np.testing.assert_array_equal(ring, expected)
    np.testing.assert_array_equal(count, [max(1, (expected == k).sum()) for k in range(12)])
    assert RINGS == 12
    alone, one = population._rings.__wrapped__(Grid((1, 1), 2e-6, (0.0, 0.0)))
    assert (alone.tolist(), one.tolist()) == ([0], [1] * 12)


def test_errors_of_the_constant_phase(monkeypatch):
    """Light is weighted with the spread of the phase in its ring, once by itself and once by its mean."""
    ring = np.arange(35) % 12
    count = np.bincount(ring, minlength=12)
    spread, images = RNG.random((2, 12)), RNG.random((2, 5, 7)).astype(np.float32)
    monkeypatch.setattr(population, "_rings", lambda window: (ring, count))
    monkeypatch.setattr(population, "_spread", lambda stack, window: spread)
    found = population._model_errors(None, images, WINDOW)
    for k in range(2):
        image, wrong, total = images[k].ravel().astype(float), 0.0, 0.0
        for number in range(12):
            own = image[ring == number]
            wrong += (1.4 * spread[k, number]) ** 2 * ((own**2).sum() + own.size * own.mean() ** 2)
            total += (own**2).sum()
        assert found[k] == pytest.approx(math.sqrt(wrong / total))


def test_the_spread_of_the_phase():
    """Differences of paths to the end of a ring and to the middle, without the part that is linear in the sines."""
    stack = _Stack.from_members(MEMBERS)
    found = population._spread(stack, WINDOW)
    k = np.arange(40) + 0.5
    spiral = np.sqrt(k / 40) * np.exp(2j * np.pi * k * (math.sqrt(5) - 1) / 2)
    for member, spreads in zip(MEMBERS, found, strict=True):
        radius, wave, z, *_ = member.numbers
        xi = radius * spiral
        own = _Stack.from_members([member])
        sines = [population._sine(own, WINDOW, part)[0, 0].astype(float) for part in (xi.real, xi.imag)]
        for ring, spread in enumerate(spreads):
            out, worst = (ring + 1) / 12 * WINDOW.half_diagonal, 0.0
            for x, y in ((out, 0.0), (out / math.sqrt(2), out / math.sqrt(2))):
                there = np.sqrt((x - xi.real) ** 2 + (y - xi.imag) ** 2 + z**2) - math.sqrt(out**2 + z**2)
                there += x * sines[0] + y * sines[1] - (np.sqrt(abs(xi) ** 2 + z**2) - z)
                worst = max(worst, 2 * math.pi * (there / wave).std())
            assert spread == pytest.approx(worst, rel=1e-3)


def test_plans_of_members(monkeypatch):
    monkeypatch.setattr(population, "steepest_sine", lambda radius, distance, leaving: radius / distance + leaving)
    monkeypatch.setattr(population, "scalar_theory_error", lambda sine, spread: sine * spread)
    monkeypatch.setattr(population, "light_spread", lambda pupil: 2.0)
    monkeypatch.setattr(population, "population_seconds", lambda side, window: side * window.dx)
    found = population._plan(MEMBERS[0], SAMPLES, WINDOW, 5e-3, 0.3)
    assert found == Plan(
        "low_rank",
        (23, 23),
        "float32",
        5e-3,
        "shared plan of a population: rank 1, no spot check",
        23 * 2e-6,
        scalar_error=pytest.approx(2 * (0.1 + 0.3)),
    )
