"""The predicted error holds on random cases, and the bounds detect cases in which it does not."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from validation.optics import psf_error_prediction
from validation.optics.random_cases import (
    APERTURES,
    FRESNEL_NUMBERS,
    KINDS,
    OPENINGS,
    TALLEST_RELIEF,
    WAVELENGTH,
    draw_case,
)

CASES = 25


@pytest.fixture(scope="module")
def measured():
    return psf_error_prediction.measure(CASES, seed=5)


def test_bounds_that_so_few_cases_carry(measured):
    rows, _ = measured
    assert len(rows) == CASES
    assert psf_error_prediction.broken_bounds(rows, percentages=False) == []
    assert sum(bool(row.runs) for row in rows) > CASES / 2
    assert psf_error_prediction.shares(rows)["holds"] >= 0.9


def test_a_prediction_four_times_too_low_is_caught(measured):
    rows, _ = measured
    flattering = [replace(row, runs=(replace(row.chosen, predicted=row.chosen.error / 4),)) for row in rows if row.runs]
    complaints = psf_error_prediction.broken_bounds(flattering)
    assert sum("predicted" in words for words in complaints) > CASES / 2
    assert any("actual <= predicted in" in words for words in complaints)


def test_cowardly_predictions_and_slow_choices_are_caught(measured):
    rows, _ = measured
    answered = [row for row in rows if row.runs]
    cowardly = [replace(r, runs=(replace(r.chosen, predicted=1e3 * r.chosen.error),)) for r in answered]
    assert any("predicted <= 30 actual in 0.0%" in words for words in psf_error_prediction.broken_bounds(cowardly))
    slow = [
        replace(r, runs=(replace(r.chosen, seconds=3.0, error=0.0), replace(r.chosen, seconds=1.0, error=0.0)))
        for r in answered
    ]
    assert any("of the fastest in 0.0%" in words for words in psf_error_prediction.broken_bounds(slow))


def test_unknown_refusals_are_caught(measured):
    rows, _ = measured
    lost = replace(rows[0], runs=(), refusal="the cat ate it")
    assert any("the cat" in words for words in psf_error_prediction.broken_bounds([*rows, lost], percentages=False))


def test_cases_span_the_domain():
    cases = [draw_case(np.random.default_rng(seed)) for seed in range(300)]
    for values, (low, high) in (
        ([case.fresnel_number for case in cases], FRESNEL_NUMBERS),
        ([case.aperture for case in cases], APERTURES),
    ):
        assert low <= min(values) < 1.1 * low
        assert high / 1.1 < max(values) <= high
    assert TALLEST_RELIEF / 1.2 < max(case.relief for case in cases) <= TALLEST_RELIEF
    assert {case.kind for case in cases} == set(KINDS)
    assert {case.opening for case in cases} == set(OPENINGS)
    assert max(max(case.window["shape"]) for case in cases) > 250
    apart = [case.window["dx"] * 2 * case.pupil.radius / (WAVELENGTH * case.distance) for case in cases]
    assert np.mean(np.array(apart) > 1) > 0.03
    radii = [case.pupil.radius for case in cases]
    numbers = [radius**2 / (550e-9 * case.distance) for radius, case in zip(radii, cases, strict=True)]
    assert numbers == pytest.approx([case.fresnel_number for case in cases])


def test_figure_and_page(tmp_path, measured, monkeypatch):
    monkeypatch.setattr(psf_error_prediction, "measure", lambda *_: measured)
    assert psf_error_prediction.main(["--cases", str(CASES), "--out", str(tmp_path), "--docs", str(tmp_path)]) == 0
    assert (tmp_path / "psf_error_prediction.png").stat().st_size > 10_000
    prose = (tmp_path / "psf_error_prediction.md").read_text(encoding="utf-8").split("```")[0]
    assert Path("docs/validation/psf_error_prediction.md").read_text(encoding="utf-8").startswith(prose)
