"""float32 phases lose digits with distance, optics.psf in float32 does not, and dark windows are refused."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from validation.optics import float32_precision


@pytest.fixture(scope="module")
def measured():
    return [float32_precision.far(z) for z in float32_precision.DISTANCES], [
        float32_precision.dark(angle) for angle in float32_precision.ANGLES
    ]


def test_all_bounds_hold(measured):
    assert float32_precision.broken_bounds(*measured) == []


def test_naive_phases_in_place_of_ours_are_caught(measured):
    rows, windows = measured
    broken = float32_precision.broken_bounds([replace(row, ours=row.naive) for row in rows], windows)
    assert len(broken) >= 7  # from 3 mm on


def test_darkness_that_float32_claims_to_see_is_caught(measured):
    rows, windows = measured
    boastful = [replace(w, errors=(1e-4, 1e-4, 1e-4, 1e-7), predicted=(1e-6,) * 4) for w in windows]
    broken = float32_precision.broken_bounds(rows, boastful)
    assert sum("predicted" in words for words in broken) >= 3
    assert any("should be refused" in words for words in broken)


def test_breaking_distances_grow_with_the_tolerance(measured):
    distances = float32_precision.breaking_distances(measured[0])
    assert distances == sorted(distances)
    # The breaking distance is at least the distance at which kz 2^-24 reaches the tolerance.
    assert all(
        z >= b * 2**24 * float32_precision.WAVELENGTH / (2 * np.pi)
        for z, b in zip(distances, float32_precision.BREAKS, strict=True)
    )


def test_figure_and_page(tmp_path, measured, monkeypatch):
    monkeypatch.setattr(float32_precision, "far", dict(zip(float32_precision.DISTANCES, measured[0], strict=True)).get)
    monkeypatch.setattr(float32_precision, "dark", dict(zip(float32_precision.ANGLES, measured[1], strict=True)).get)
    assert float32_precision.main(["--out", str(tmp_path), "--docs", str(tmp_path)]) == 0
    assert (tmp_path / "float32_precision.png").stat().st_size > 10_000
    prose = (tmp_path / "float32_precision.md").read_text(encoding="utf-8").split("```")[0]
    assert Path("docs/validation/float32_precision.md").read_text(encoding="utf-8").startswith(prose)
