"""Windows around the light on a retina, from given numbers."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

import optics
from optics.eye import visual_kernel
from optics.eye.retina import CellsError, Retina
from optics.eye.visual_kernel import Spot, _cells_within, _pitch_for_cells, _WindowNeeds, spot_of
from optics.numerics.accuracy import AccuracyError

WAVE = 500e-9


def a_retina(**changes):
    given = {"distance": 2.0, "wavelengths": np.array([WAVE]), "cell": (0.5, 0.25), "tolerance": 1e-2}
    return Retina(**(given | {"size": (6.0, 4.0), "samples": 3} | changes))


@pytest.mark.parametrize(
    ("half", "count"), [(0.0, 1), (0.5, 1), (0.5 + 5e-7, 1), (0.5 + 2e-6, 3), (1.5, 3), (1.6, 5), (2.5, 5)]
)
def test_odd_numbers_of_cells(half, count):
    assert _cells_within(half, 1.0) == count
    assert _cells_within(2 * half, 2.0) == count


def test_windows_of_spots():
    needs = tuple(_WindowNeeds(9.0, 1.0, 1.0, rays) for rays in (0.5, 2.0, 1.0))
    spot = Spot((3.0, -4.0), 2.5, 1.0, needs)
    assert spot.half_of_rays == 2.0
    assert Spot((3.0, -4.0), 1.5, 1.0, needs).half_of_rays == 1.5
    for pitch, beside, side in ((1.0, 0, 7), (1.0, 4, 15), (1.25, 0, 5), (0.5, 1, 13)):
        window = spot.window(pitch, beside)
        assert (window.shape, window.dx, window.centre) == ((side, side), pitch, (3.0, -4.0))
    assert spot.window(1.0) == spot.window(1.0, 0)
    assert not spot.on_retina
    assert [spot.cells(size) for size in (1.0, 7.0, 2.3)] == [7, 1, 5]  # 7 samples, 3.5 on either side


def test_samples_for_cells():
    """A tolerance of 0.01 needs 2.25 samples per cycle, and 2 or 1.75 if a cell is at least one or two cycles wide."""
    pitch = 1 / 2.25
    for cell, samples in (((2.0, 2.5), 1.75), ((3.0, 1.0), 2.0), ((0.9, 3.0), 2.25)):
        assert _pitch_for_cells(pitch, a_retina(cell=cell)) == pytest.approx(1 / samples)
        assert _pitch_for_cells(2 * pitch, a_retina(cell=tuple(2 * side for side in cell))) == pytest.approx(
            2 / samples
        )


def a_beam(angle=(0.0, 0.0), **pupil):
    return SimpleNamespace(
        pupil=SimpleNamespace(**({"object_n": None, "height": None} | pupil)),
        source=SimpleNamespace(angle=angle),
        wavelength=WAVE,
        index=1.5,
    )


@pytest.mark.parametrize("before", [None, 1.2])
def test_the_image_of_a_direction_obeys_snells_law(before):
    angle = 0.4, -0.3
    beam = a_beam(angle, object_n=before, index_before=lambda wavelength: before)
    x, y = visual_kernel._image(beam, 2.0)
    across = np.tan(angle)
    if before is None:
        np.testing.assert_allclose((x, y), 2 * across)
        return
    sine = math.sin(math.atan(math.hypot(*across))) * before / 1.5
    assert math.hypot(x, y) == pytest.approx(2 * math.tan(math.asin(sine)))
    assert x / y == pytest.approx(across[0] / across[1])


def test_light_that_is_reflected_totally_lands_far_away():
    beam = a_beam((1.2, 0.0), object_n=2.0, index_before=lambda wavelength: 2.0)
    assert visual_kernel._image(beam, 1.0) == (pytest.approx(1000 * 2 / 1.5 * math.sin(1.2)), 0.0)


def spot_from(monkeypatch, needs, most=math.inf, retina=None, height=None):
    beams = [SimpleNamespace(pupil=SimpleNamespace(height=height), number=n) for n in range(len(needs))]
    asked = []

    def needed(beam, retina, centre):
        asked.append(centre)
        return needs[beam.number]

    monkeypatch.setattr(visual_kernel, "_image", lambda beam, distance: (beam.number * distance, -distance))
    monkeypatch.setattr(visual_kernel, "_needs", needed)
    spot = spot_of(beams, retina or a_retina(), most)
    assert asked == [spot.centre] * len(needs)
    return spot


def test_spots_hold_the_light_of_all_wavelengths(monkeypatch):
    """The square extends half a cell beyond the cells that hold the light. For 2.6, these are 11 cells of 0.5, and for
    1.3 they are 7 cells.
    """
    needs = tuple(_WindowNeeds(half, pitch, 1.0, 1.0) for half, pitch in ((1.0, 0.3), (2.6, 0.2), (2.0, 0.1)))
    spot = spot_from(monkeypatch, needs)
    assert (spot.centre, spot.pitch, spot.needs, spot.on_retina) == ((2.0, -2.0), 0.1, needs, False)
    assert spot.half == 3.0
    limited = spot_from(monkeypatch, needs, 1.3)
    assert (limited.half, limited.on_retina) == (2.0, True)
    assert spot_from(monkeypatch, needs[:1]).half == 1.5
    assert spot_from(monkeypatch, needs[:2]).centre == (2.0, -2.0)


def test_the_largest_number_of_cells(monkeypatch):
    """2049 cells of 0.25 cover 256.125 on either side of the image."""
    spot_from(monkeypatch, (_WindowNeeds(256.125, 1.0, 1.0, 1.0),))
    far = (_WindowNeeds(256.2, 1.0, 1.0, 1.0),)
    for height, advice in ((None, "the cells$"), (1, "the cells, or flatten the relief$")):
        with pytest.raises(CellsError, match=rf"over 512 m, 2050 cells of 0\.25 m: at most 2049; .*{advice}"):
            spot_from(monkeypatch, far, height=height)


@pytest.mark.parametrize(
    ("failing", "samples", "steep", "cells", "tried"),
    [
        (0, 3, True, False, [math.inf]),
        (1, 3, True, False, [math.inf, 6.0]),
        (2, 3, True, False, [math.inf, 6.0, 4.0]),
        (3, 3, True, False, [math.inf, 6.0, 4.0]),
        (3, 3, False, False, [math.inf]),
        (3, 2, True, True, [math.inf]),
        (3, 1, True, True, [math.inf, 6.0, 4.0]),
    ],
)
def test_areas_that_are_tried_for_steep_reliefs(monkeypatch, failing, samples, steep, cells, tried):
    """The error of the first area is raised if all areas fail."""
    asked = []
    monkeypatch.setattr(visual_kernel, "spot_of", lambda beams, retina, most: most)
    monkeypatch.setattr(visual_kernel, "may_be_steep", lambda beam: steep)

    def compute(most):
        asked.append(most)
        if len(asked) <= failing:
            raise (CellsError if cells else AccuracyError)(f"number {len(asked)}")
        return f"result {most}"

    if not steep:  # all wavelengths must be steep
        monkeypatch.setattr(visual_kernel, "may_be_steep", lambda beam: beam == 1)
    retina = a_retina(samples=samples)
    if failing < 3:
        assert visual_kernel._on_spot(compute, [1, 2], retina) == f"result {tried[-1]}"
    else:
        with pytest.raises(AccuracyError, match=r"^number 1$"):
            visual_kernel._on_spot(compute, [1, 2], retina)
    assert asked == tried


@pytest.mark.parametrize("scattered", [0.0, 3e4])
@pytest.mark.parametrize("shadow", [0.1, 1.5, math.inf])
def test_needs_of_a_wavelength(monkeypatch, scattered, shadow):
    """Diffraction adds the frequency f to the ray from the outermost point to the axis: z tan(asin(sin θ + λ f))."""
    asked = []
    monkeypatch.setattr(visual_kernel, "_beyond_edge", lambda pupil, fraction: asked.append(fraction) or 2e4)
    monkeypatch.setattr(visual_kernel, "_half_side", lambda *given: asked.append(given) or shadow)
    pupil = SimpleNamespace(
        radius=0.25,
        transmission=0.5,
        scatter=lambda wavelength, fraction: asked.append((wavelength, fraction)) or scattered,
        slopes=lambda wavelength, source: SimpleNamespace(steepest_inside=0.25),
    )
    beam = SimpleNamespace(pupil=pupil, wavelength=6e-7, index=1.5, source=None)
    needs = visual_kernel._needs(beam, a_retina(tolerance=0.04), (0.25, -0.5))
    assert asked[:2] == [(6e-7, 0.01), 0.02]
    _, behind, centre, fraction = asked[2]
    assert (behind, centre) == ((2.0, 1.5), (0.25, -0.5))
    assert fraction == pytest.approx(1 - 0.04 * 0.5 / (4 if scattered else 2))
    widest = math.tan(math.radians(50)) * 2 + 0.25
    sine = math.sin(math.atan((0.5 + shadow) / 2)) + (2e4 + scattered) * 4e-7
    half = 2 * math.tan(math.asin(sine)) - 0.5 if math.isfinite(shadow) else math.inf
    assert needs.half_window == pytest.approx(min(half, widest))
    assert needs.half_of_rays == shadow
    assert needs.band == pytest.approx(0.25 / 6e-7 + 2e4 + scattered)
    samples = visual_kernel.samples_per_cycle(0.04)
    assert needs.pitch == pytest.approx(1 / (samples * 2 * 0.25 / (4e-7 * 2)))


def test_needs_of_diffraction_to_all_sides(monkeypatch):
    """Beyond a sine of 1, the window is the widest. Flat pupils that are close have a spectrum of twice their band."""
    monkeypatch.setattr(visual_kernel, "_beyond_edge", lambda pupil, fraction: 3e6)
    monkeypatch.setattr(visual_kernel, "_half_side", lambda *given: 0.1)
    pupil = SimpleNamespace(
        radius=0.25,
        transmission=1.0,
        scatter=lambda wavelength, fraction: 0.0,
        slopes=lambda wavelength, source: SimpleNamespace(steepest_inside=0.0),
    )
    beam = SimpleNamespace(pupil=pupil, wavelength=6e-7, index=1.0, source=None)
    needs = visual_kernel._needs(beam, a_retina(distance=0.001), (0.0, 0.0))
    assert needs.half_window == pytest.approx(math.tan(math.radians(50)) * 0.001 + 0.25)
    assert needs.pitch == pytest.approx(1 / (2.25 * 2 * 3e6))


def test_the_brightness_of_a_mask_along_its_edge():
    """Amplitudes of 0.2 and 0.6 have a mean intensity of 0.2."""
    points = np.array([[0.2, 9.0], [0.6, 9.0]])
    aperture = SimpleNamespace(outline=SimpleNamespace(points=lambda: points))
    for mask, transmission, expected in ((1, 0.05, 4.0), (1, 0.5, 1.0), (1, 0.0, 1.0), (None, 0.05, 1.0)):
        pupil = SimpleNamespace(mask=mask, transmission=transmission, aperture=aperture, amplitude=lambda x, y: x)
        assert visual_kernel._rim.__wrapped__(pupil) == pytest.approx(expected)


@pytest.mark.parametrize("on_retina", [False, True])
def test_requests_for_a_spot(on_retina):
    beam = optics.eye.visual_kernel.Beam(optics.Pupil(20e-6), optics.PointSource(), WAVE, 2e-4)
    need = _WindowNeeds(1e-4, 1e-6, 1.5e6, 2e-5)
    spot = Spot((3e-5, -4e-5), 1e-4, 1e-6, (need,), on_retina)
    retina = a_retina(distance=2e-4, tolerance=3e-3, dtype="float64", most_seconds=7.0)
    request = visual_kernel._request(beam, spot, need, spot.window(1e-6), retina)
    problem = request.problem
    assert (request.beam, request.most_seconds, request.method) == (beam, 7.0, "auto")
    assert (problem.window, problem.tolerance, problem.dtype) == (spot.window(1e-6), 3e-3, "float64")
    assert problem.reach == pytest.approx(1.5e-4)
    assert problem.widest_band == (math.inf if on_retina else 1.5e6)
    assert problem.steep == on_retina


def test_the_psf_of_a_perfect_lens():
    """All power is in one cell; the area of a sample is the square of a cell's width."""
    found = visual_kernel.perfect_psf(a_retina(wavelengths=np.array([4e-7, 6e-7])), 0.25)
    np.testing.assert_array_equal(found.psf, np.full((2, 1, 1), 16.0))
    assert (found.dx, found.sensor_distance, found.pupil.radius) == (0.25, 2.0, 0.25)
    [plan] = found.plans
    assert (plan.method, plan.samples, plan.predicted_error) == ("perfect_lens", (1, 1), 0.0)


@pytest.mark.parametrize(("turned", "expected"), [(False, (0.3, -0.2)), (True, (-0.3, 0.2))])
def test_directions_across_the_pupil(turned, expected):
    assert a_retina(pupil_turned=turned).across_pupil((0.3, -0.2)) == expected


def test_directions_of_beams():
    beams = visual_kernel.beams_to(optics.Pupil(20e-6), a_retina(wavelengths=np.array([4e-7, 6e-7])), 3.0, (0.5, -2.0))
    assert [beam.wavelength for beam in beams] == [4e-7, 6e-7]
    for beam in beams:
        assert (beam.distance, beam.source.distance) == (2.0, 3.0)
        np.testing.assert_allclose(np.tan(beam.source.angle), (0.5, -2.0))
