"""Every edge of the domain ends in its value or its one line; the page sees a wrong value and a wrong error."""

from pathlib import Path

import numpy as np
import pytest

from validation import B6_edges as B6
from validation.page import blanked


@pytest.fixture(scope="module")
def edges():
    return B6.measure()


def test_all_edges_hold(edges):
    assert B6.broken_bounds(edges) == []
    assert len(edges) == len(B6.VALUES) + len(B6.REFUSALS)


def test_wrong_values_and_wrong_errors_are_caught():
    def fail():
        raise ZeroDivisionError("division by zero")

    def two_lines():
        raise ValueError("radius = 0\nand more")

    assert not B6._value("off", lambda: 0.1, 0.01).holds
    assert not B6._value("NaN", lambda: np.nan, 0.01).holds
    assert not B6._value("crash", fail, 0.01).holds
    assert not B6._refusal("answers", lambda: 1, "radius").holds
    assert not B6._refusal("crash", fail, "division").holds
    assert not B6._refusal("two lines", two_lines, "radius").holds
    assert not B6._refusal("names another", lambda: B6.Pupil(0.0), "wavelength = 0").holds


def test_a_lobe_without_obliquity_is_caught():
    """cos²θ is what tells Rayleigh-Sommerfeld's lobe from a spherical wave: far more than the page allows."""
    x = (np.arange(17) - 8) * 2e-4
    rho2 = x[None, :] ** 2 + x[:, None] ** 2 + 1e-6
    assert B6.relative_l2(1 / rho2, 1e-6 / rho2**2) > 0.1


def test_figure_and_page(tmp_path, edges, monkeypatch):
    monkeypatch.setattr(B6, "measure", lambda: edges)
    assert B6.main(["--out", str(tmp_path), "--docs", str(tmp_path)]) == 0
    assert (tmp_path / "B6_edges.png").stat().st_size > 10_000
    fresh, stored = ((path / "B6.md").read_text(encoding="utf-8") for path in (tmp_path, Path("docs/validation")))
    assert blanked(fresh) == blanked(stored)
