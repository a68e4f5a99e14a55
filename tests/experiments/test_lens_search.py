"""The search for a lens: gradients against finite differences, searches that improve, and their page."""

from pathlib import Path

import numpy as np
import pytest

import experiments.lens_optimizers as lens_optimizers
from experiments.lens_optimizers import RELIEF_HEIGHT, Row, gradient, loss, searched, strehl
from experiments.lens_search import found_after, page
from experiments.store import Origin, read_rows
from optics import BSplineRelief
from optics.numerics import backend

RESULTS = Path(__file__).parents[2] / "docs/results"


@pytest.fixture(autouse=True, scope="module")
def dr_jit():
    backend.require()


def blurred():
    """Genes of a lens with 0.8 times the power needed for focus."""
    points = BSplineRelief.paraboloid(0.0, 0.8 / (0.5 * lens_optimizers.RETINA), lens_optimizers.RADIUS).control_points
    return np.append(points.ravel() / RELIEF_HEIGHT + 0.8, 0.5)


@pytest.mark.parametrize("spot", [None, 6e-6])
def test_gradient_is_that_of_the_loss(spot):
    """The reference is a central difference over 1e-4 of the genes' range, for some relief genes and the index; the
    accuracy is that of the search's PSFs."""
    genome = np.clip(blurred() + 0.005 * np.random.default_rng(0).standard_normal(17), 0, 1)
    _, slope = gradient(genome, spot)
    for place in (5, 10, 16):
        step = np.zeros(17)
        step[place] = 1e-4
        difference = (loss(genome + step, spot) - loss(genome - step, spot)) / 2e-4
        assert slope[place] == pytest.approx(difference, rel=0.05, abs=0.02 * np.abs(slope).max())


@pytest.mark.fast_cases(1)
@pytest.mark.parametrize("method", ["gradient, shrinking spot", "CMA-ES, Strehl ratio"])
def test_searches_begin_at_the_start_and_improve(method, monkeypatch):
    monkeypatch.setattr(lens_optimizers, "start", lambda seed: blurred())
    monkeypatch.setattr(lens_optimizers, "GENERATIONS", 3)
    monkeypatch.setattr(lens_optimizers, "STEP", 0.01)
    monkeypatch.setattr(lens_optimizers, "MOST_GRADIENTS", 30)
    monkeypatch.setattr(lens_optimizers, "RECORDED", (1, 8))
    rows = searched(method, 0)
    assert [row.evaluations for row in rows[:2]] == [1, 8]
    assert rows[-1].strehl > 1.5 * strehl(blurred())
    assert 0 < rows[0].cpu_seconds < rows[-1].cpu_seconds


def test_a_lens_counts_from_where_it_is_kept():
    def search(*values):
        return [Row("m", 0, 10 * i, float(i), value) for i, value in enumerate(values)]

    assert found_after(search(0.1, 0.9, 0.5, 0.85, 0.9)).evaluations == 30
    assert found_after(search(0.1, 0.9, 0.5)) is None


def test_page_is_what_its_store_says():
    rows, origin = read_rows(Row, RESULTS / "data/lens_search.csv"), Origin.read(RESULTS / "data/lens_search.json")
    assert page(rows, origin).markdown == (RESULTS / "lens_search.md").read_text()
