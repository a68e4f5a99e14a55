"""Every limiting case of the domain gives its known value or a one-line error; the page detects a wrong value and a
wrong error."""

from pathlib import Path

import numpy as np
import pytest

from validation.optics import limiting_cases
from validation.pages.page import blanked


@pytest.fixture(scope="module")
def edges():
    return limiting_cases.measure()


def test_all_edges_hold(edges):
    assert limiting_cases.broken_bounds(edges) == []
    assert len(edges) == len(limiting_cases.VALUES) + len(limiting_cases.REFUSALS)


def test_wrong_values_and_wrong_errors_are_caught():
    def fail():
        raise ZeroDivisionError("division by zero")

    def two_lines():
        raise ValueError("radius = 0\nand more")

    assert not limiting_cases._value("off", lambda: 0.1, 0.01).holds
    assert not limiting_cases._value("NaN", lambda: np.nan, 0.01).holds
    assert not limiting_cases._value("crash", fail, 0.01).holds
    assert not limiting_cases._refusal("answers", lambda: 1, "radius").holds
    assert not limiting_cases._refusal("crash", fail, "division").holds
    assert not limiting_cases._refusal("two lines", two_lines, "radius").holds
    assert not limiting_cases._refusal("names another", lambda: limiting_cases.Pupil(0.0), "wavelength = 0").holds


def test_a_lobe_without_obliquity_is_caught():
    """Without the factor cos²θ of Rayleigh and Sommerfeld's integral, the light of a small hole differs by far more
    than the page's bound.
    """
    x = (np.arange(17) - 8) * 2e-4
    rho2 = x[None, :] ** 2 + x[:, None] ** 2 + 1e-6
    assert limiting_cases.relative_l2(1 / rho2, 1e-6 / rho2**2) > 0.1


def test_figure_and_page(tmp_path, edges, monkeypatch):
    monkeypatch.setattr(limiting_cases, "measure", lambda: edges)
    assert limiting_cases.main(["--out", str(tmp_path), "--docs", str(tmp_path)]) == 0
    assert (tmp_path / "limiting_cases.png").stat().st_size > 10_000
    fresh, stored = (
        (path / "limiting_cases.md").read_text(encoding="utf-8") for path in (tmp_path, Path("docs/validation"))
    )
    assert blanked(fresh) == blanked(stored)
