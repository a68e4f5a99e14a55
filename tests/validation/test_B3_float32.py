"""float32 phases lose their digits with distance, optics.psf in float32 does not, and darkness is refused."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from validation import B3_float32 as B3


@pytest.fixture(scope="module")
def measured():
    return [B3.far(z) for z in B3.DISTANCES], [B3.dark(angle) for angle in B3.ANGLES]


def test_all_bounds_hold(measured):
    assert B3.broken_bounds(*measured) == []


def test_naive_phases_in_place_of_ours_are_caught(measured):
    rows, windows = measured
    broken = B3.broken_bounds([replace(row, ours=row.naive) for row in rows], windows)
    assert len(broken) >= 7  # from 3 mm on


def test_darkness_that_float32_claims_to_see_is_caught(measured):
    rows, windows = measured
    boastful = [replace(w, errors=(1e-4, 1e-4, 1e-4, 1e-7), predicted=(1e-6,) * 4) for w in windows]
    broken = B3.broken_bounds(rows, boastful)
    assert sum("predicted" in words for words in broken) >= 3
    assert any("should be refused" in words for words in broken)


def test_breaking_distances_grow_with_the_tolerance(measured):
    distances = B3.breaking_distances(measured[0])
    assert distances == sorted(distances)
    # kz 2^-24 reaches the tolerance at least that near.
    assert all(z >= b * 2**24 * B3.WAVELENGTH / (2 * np.pi) for z, b in zip(distances, B3.BREAKS, strict=True))


def test_figure_and_page(tmp_path, measured, monkeypatch):
    monkeypatch.setattr(B3, "far", dict(zip(B3.DISTANCES, measured[0], strict=True)).get)
    monkeypatch.setattr(B3, "dark", dict(zip(B3.ANGLES, measured[1], strict=True)).get)
    assert B3.main(["--out", str(tmp_path), "--docs", str(tmp_path)]) == 0
    assert (tmp_path / "B3_float32.png").stat().st_size > 10_000
    prose = (tmp_path / "B3.md").read_text(encoding="utf-8").split("```")[0]
    assert Path("docs/validation/B3.md").read_text(encoding="utf-8").startswith(prose)
