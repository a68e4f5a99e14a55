"""The mask is right to first order in the slope, optics.psf agrees with that mask, and the page shows the computed
limits."""

from dataclasses import replace
from pathlib import Path

import pytest

from validation.optics import thin_element
from validation.pages.page import blanked


@pytest.fixture(scope="module")
def measured():
    prisms = [thin_element.prism(angle) for angle in thin_element.ANGLES_DEG]
    return prisms, [thin_element._lens(aperture) for aperture in thin_element.APERTURES], thin_element.limits()


def test_all_bounds_hold(measured):
    assert thin_element.broken_bounds(*measured) == []


def test_a_psf_that_refracts_is_caught(measured):
    """The real prism deflects light by 7e-4 rad more than the mask at a slope of 10°."""
    prisms, lenses, limits = measured
    broken = thin_element.broken_bounds([replace(p, psf=p.real) for p in prisms], lenses, limits)
    assert len(broken) >= 6


def test_a_mask_that_is_off_at_first_order_and_a_wrong_limit_are_caught(measured):
    prisms, lenses, limits = measured
    linear = [replace(p, thin=0.99 * p.real, psf=float("nan")) for p in prisms]
    assert any("right to first order" in words for words in thin_element.broken_bounds(linear, lenses, limits))
    wrong = {**limits, "NA of total reflection": 0.6}
    assert thin_element.broken_bounds(prisms, lenses, wrong) == ["NA of total reflection: 0.6, the page says 0.45"]


def test_figure_and_page(tmp_path, measured, monkeypatch):
    monkeypatch.setattr(thin_element, "prism", dict(zip(thin_element.ANGLES_DEG, measured[0], strict=True)).get)
    monkeypatch.setattr(thin_element, "limits", lambda: measured[2])
    assert thin_element.main(["--out", str(tmp_path), "--docs", str(tmp_path)]) == 0
    assert (tmp_path / "thin_element.png").stat().st_size > 10_000
    fresh, stored = (
        (path / "thin_element.md").read_text(encoding="utf-8") for path in (tmp_path, Path("docs/validation"))
    )
    assert blanked(fresh) == blanked(stored)
