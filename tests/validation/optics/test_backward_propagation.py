"""Backward propagation does not amplify noise and loses only the evanescent share; the bounds detect the naive
inverse."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from validation.optics import backward_propagation
from validation.pages.page import blanked


@pytest.fixture(scope="module")
def measured():
    return [backward_propagation.bring_back(z) for z in backward_propagation.DISTANCES], [
        backward_propagation.recover(waist) for waist in backward_propagation.WAISTS
    ]


def test_all_bounds_hold(measured):
    assert backward_propagation.broken_bounds(*measured) == []


def test_the_naive_inverse_is_caught(measured):
    rows, spots = measured
    broken = backward_propagation.broken_bounds([replace(row, ours=row.float64) for row in rows], spots)
    assert sum("recovers the field" in words for words in broken) >= 6


def test_evanescent_waves_that_are_kept_or_left_unreported_are_caught(measured):
    rows, spots = measured
    assert len(backward_propagation.broken_bounds(rows, [replace(s, error=0.0) for s in spots])) == len(spots)
    assert len(backward_propagation.broken_bounds(rows, [replace(s, said=0.0) for s in spots])) == len(spots)


def test_growth_is_that_of_the_finest_wave(measured):
    """The finest wave has the frequency f = √2 / (2 dx) = 2.8/λ and grows like exp(2πz √(f²λ² - 1)), with z in
    wavelengths. The slope of the logarithm agrees to 10 % beyond 3 wavelengths.
    """
    rows = [row for row in measured[0] if 3 <= row.distance <= 20]
    slope = np.polyfit([row.distance for row in rows], np.log([row.float64 for row in rows]), 1)[0]
    assert slope == pytest.approx(2 * np.pi * np.sqrt(7), rel=0.1)


def test_figure_and_page(tmp_path, measured, monkeypatch):
    monkeypatch.setattr(
        backward_propagation, "bring_back", dict(zip(backward_propagation.DISTANCES, measured[0], strict=True)).get
    )
    monkeypatch.setattr(
        backward_propagation, "recover", dict(zip(backward_propagation.WAISTS, measured[1], strict=True)).get
    )
    assert backward_propagation.main(["--out", str(tmp_path), "--docs", str(tmp_path)]) == 0
    assert (tmp_path / "backward_propagation.png").stat().st_size > 10_000
    fresh, stored = (
        (path / "backward_propagation.md").read_text(encoding="utf-8") for path in (tmp_path, Path("docs/validation"))
    )
    assert blanked(fresh) == blanked(stored)
