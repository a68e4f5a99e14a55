"""Beyond the critical distance the textbook method stops converging and optics.propagate does not; the bounds detect
either failure."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from validation.optics import aliasing

FEW = (0.2, 2.0, 20.0)


@pytest.fixture(scope="module")
def measured():
    return [aliasing.measure(f) for f in FEW], [aliasing.wrap_around(period) for period in aliasing.PERIODS]


def test_all_bounds_hold(measured):
    assert aliasing.broken_bounds(*measured) == []


def test_a_propagator_that_wraps_around_is_caught(measured):
    rows, wrapped = measured
    broken = aliasing.broken_bounds([replace(row, propagate=row.textbook) for row in rows], wrapped)
    assert any("optics.propagate converges like" in words for words in broken)
    broken = aliasing.broken_bounds(rows, [(naive, naive) for naive, _ in wrapped])
    assert any("optics.propagate has an error" in words for words in broken)


def test_a_textbook_that_does_not_fail_is_caught(measured):
    """The chart must show that the textbook method fails. A padded or band-limited version of it would converge."""
    rows, wrapped = measured
    broken = aliasing.broken_bounds(
        [replace(row, textbook=row.propagate) for row in rows], [(0.0, o) for _, o in wrapped]
    )
    assert any("the textbook converges" in words for words in broken)
    assert any("cannot be right" in words for words in broken)


def test_wrap_around_falls_like_the_beam_on_the_periods_edge(measured):
    """The amplitude of the repeated beam of waist w is exp(-(P/2w)²) at the edge of the period P. The logarithm of the
    integrated error is therefore a linear function of (P/w)², with a slope of -1/4 to -1/2.
    """
    p = np.array(aliasing.PERIODS[1:6])
    slope = np.polyfit(p**2, np.log([naive for naive, _ in measured[1][1:6]]), 1)[0]
    assert -0.55 < slope < -0.25


def test_figure_and_page(tmp_path, measured, monkeypatch):
    rows = dict(zip(FEW, measured[0], strict=True))
    monkeypatch.setattr(aliasing, "FRESNEL_NUMBERS", FEW)
    monkeypatch.setattr(aliasing, "measure", rows.get)
    monkeypatch.setattr(aliasing, "wrap_around", dict(zip(aliasing.PERIODS, measured[1], strict=True)).get)
    assert aliasing.main(["--out", str(tmp_path), "--docs", str(tmp_path)]) == 0
    assert (tmp_path / "aliasing.png").stat().st_size > 10_000
    prose = (tmp_path / "aliasing.md").read_text(encoding="utf-8").split("```")[0]
    assert Path("docs/validation/aliasing.md").read_text(encoding="utf-8").startswith(prose)
