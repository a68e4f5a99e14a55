"""Each row of the page lies in its range, wrong values are caught, and the page shows the computed table."""

from dataclasses import replace
from pathlib import Path

import pytest

from validation.optics import real_eyes
from validation.pages.page import blanked


@pytest.fixture(scope="module")
def measured():
    return real_eyes.all_rows(), real_eyes.ideal_sensitivities()


def test_every_row_lies_in_its_range(measured):
    rows, ideal = measured
    assert len({row.name for row in rows}) == len(rows) > 25
    outside = [row.name for row in rows if not row.low <= row.computed / row.published <= row.high]
    assert outside == real_eyes.broken_bounds(rows, ideal) == []


def test_wrong_values_are_caught(measured):
    rows, ideal = measured
    doubled = [replace(row, computed=2 * row.computed) for row in rows]
    assert len(real_eyes.broken_bounds(doubled, ideal)) == len(rows)
    assert len(real_eyes.broken_bounds(rows, ideal / 10)) == 1


def test_figure_and_page(tmp_path, measured, monkeypatch):
    monkeypatch.setattr(real_eyes, "all_rows", lambda: measured[0])
    assert real_eyes.main(["--out", str(tmp_path), "--docs", str(tmp_path)]) == 0
    assert (tmp_path / "real_eyes.png").stat().st_size > 10_000
    fresh, stored = (path / "real_eyes.md" for path in (tmp_path, Path("docs/validation")))
    assert blanked(fresh.read_text(encoding="utf-8")) == blanked(stored.read_text(encoding="utf-8"))
