"""The mask is right to first order in the slope; optics.psf is that mask; the page's limits are the computed ones."""

from dataclasses import replace
from pathlib import Path

import pytest

from validation import B5_thin_element as B5
from validation.page import blanked


@pytest.fixture(scope="module")
def measured():
    prisms = [B5.prism(angle) for angle in B5.ANGLES_DEG]
    return prisms, [B5._lens(aperture) for aperture in B5.APERTURES], B5.limits()


def test_all_bounds_hold(measured):
    assert B5.broken_bounds(*measured) == []


def test_a_psf_that_refracts_is_caught(measured):
    """At 10 deg the real prism already deviates 7e-4 rad more than the mask."""
    prisms, lenses, limits = measured
    broken = B5.broken_bounds([replace(p, psf=p.real) for p in prisms], lenses, limits)
    assert len(broken) >= 6


def test_a_mask_that_is_off_at_first_order_and_a_wrong_limit_are_caught(measured):
    prisms, lenses, limits = measured
    linear = [replace(p, thin=0.99 * p.real, psf=float("nan")) for p in prisms]
    assert any("right to first order" in words for words in B5.broken_bounds(linear, lenses, limits))
    wrong = {**limits, "NA of total reflection": 0.6}
    assert B5.broken_bounds(prisms, lenses, wrong) == ["NA of total reflection: 0.6, the page says 0.45"]


def test_figure_and_page(tmp_path, measured, monkeypatch):
    monkeypatch.setattr(B5, "prism", dict(zip(B5.ANGLES_DEG, measured[0], strict=True)).get)
    monkeypatch.setattr(B5, "limits", lambda: measured[2])
    assert B5.main(["--out", str(tmp_path), "--docs", str(tmp_path)]) == 0
    assert (tmp_path / "B5_thin_element.png").stat().st_size > 10_000
    fresh, stored = ((path / "B5.md").read_text(encoding="utf-8") for path in (tmp_path, Path("docs/validation")))
    assert blanked(fresh) == blanked(stored)
