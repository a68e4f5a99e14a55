"""PSFs of designs agree with a direct sum. The table selects the plain transforms by their errors."""

import sys

import numpy as np
import pytest
import torch

from validation.peers import design_cases, optimisation_costs
from validation.peers.design_cases import EVERY, designs, direct_sum, matrix_transform
from validation.peers.optimisation_costs import Point, broken_bounds, table
from validation.reference import relative_l2


@pytest.fixture
def few_samples(monkeypatch):
    monkeypatch.setattr(design_cases, "FINE", 128)


@pytest.mark.parametrize("name", ["32 x 32 heights, 20 nm of noise", "15 Zernike modes", "32 x 32 pixels"])
def test_matrix_transform_agrees_with_the_direct_sum(name, few_samples):
    design = next(design for design in designs() if design.name == name)
    numbers = design.numbers(np.random.default_rng(2))
    exact = direct_sum(design, numbers, np.inf)
    found = matrix_transform(design, 96)(torch.tensor(numbers))[0].numpy()
    assert relative_l2(found[:, ::EVERY, ::EVERY], exact) < 0.01
    assert relative_l2(found[:, ::EVERY, ::-EVERY], exact) > 0.04, "the PSF is not symmetric"


def test_page_of_a_design(few_samples, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(optimisation_costs, "designs", lambda: [next(designs())])
    monkeypatch.setattr(optimisation_costs, "SAMPLES", (32, 48))
    options = ["--repeated", "1", "--out", str(tmp_path), "--docs", str(tmp_path)]
    monkeypatch.setattr(sys, "argv", ["optimisation_costs", *options])
    assert optimisation_costs.main() == 0
    assert "all bounds hold" in capsys.readouterr().out
    assert "\n32 x 32 heights, 0 nm of noise" in (tmp_path / "optimisation_costs.md").read_text()
    assert (tmp_path / "optimisation_costs.png").stat().st_size > 10_000


def test_table_states_the_fewest_sufficient_samples():
    plain = [Point(False, 24, 1, 2, 2e-2), Point(False, 32, 2, 3, 9e-3), Point(False, 64, 4, 8, 1e-3)]
    row = table({"smooth": [Point(True, 1e-2, 5, 10, 2e-3), *plain]}).splitlines()[-1]
    assert row.split() == ["smooth", "5.0", "10.0", "2.0e-03", "8.0", "3.0"]
    row = table({"smooth": [Point(True, 1e-2, 5, 10, 1e-4), *plain]}).splitlines()[-1]
    assert row.split() == ["smooth", "5.0", "10.0", "1.0e-04", "-", "3.0"]


def test_errors_above_the_tolerance_break_a_bound():
    points = [Point(True, 1e-2, 1, 1, 2e-2), Point(True, 3e-2, 1, 1, 2e-2), Point(False, 24, 1, 1, 1)]
    assert broken_bounds({"smooth": points}) == ["smooth: error 2.0e-02 at a tolerance of 0.01"]
