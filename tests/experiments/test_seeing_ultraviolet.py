"""Pigments that distinguish goal and adversary, from runs to page."""

from dataclasses import replace

import numpy as np
import pytest

import optics
from evolve.config.assemble import assemble
from evolve.genome.genotype import Genotype
from evolve.genome.phenotype import develop
from experiments import seeing_ultraviolet
from experiments.candidates import Row
from experiments.seeing_ultraviolet import contrast, difference, peaks
from experiments.store import Origin, write_rows
from optics.spectra.pigment import pigment_absorptance
from sim.worlds.foraging import ULTRAVIOLET, petal

ROW = Row(*("foraging", 0, 0, 0, 0, 0, 1.0, 0.5, 4, 2, 45.0, 45.0, 6, 8, 0.1, 5, 64, 1000), peaks_nm="600.0 350.0")


@pytest.mark.parametrize("peak", [350.0, 420.0, 600.0])
def test_difference_is_an_integral_over_all_light(peak):
    """The expected value is the difference of the spectra, weighted with pigment, daylight and photon number, over the
    same sum for white. The spectra differ over about 50 nm, for which sixteen bands agree with the fine sum to 10 %.
    """
    metres = np.arange(300.0, 780.0, 0.25) * 1e-9
    weight = pigment_absorptance(metres, peak * 1e-9) * optics.illuminant("D65").at(metres) * metres
    goal, adversary = (petal(share).at(metres) for share in ULTRAVIOLET.values())
    expected = np.sum(weight * (goal - adversary)) / np.sum(weight)
    assert difference(peak) == pytest.approx(expected, rel=0.1)


def test_the_best_type_counts():
    assert peaks(ROW) == [350.0, 600.0]
    assert contrast(ROW) == difference(350.0)
    assert contrast(replace(ROW, peaks_nm="600.0 520.0")) < contrast(ROW) / 10


def test_nothing_but_three_peaks_evolves():
    config = assemble(preset="ultraviolet")
    genotype = Genotype(config.genome)
    start = develop(genotype.start, config)
    assert start.lambda_max_nm == pytest.approx((600.0, 520.0, 460.0))
    for end in (np.zeros_like(genotype.start), np.ones_like(genotype.start)):
        other = develop(end, config)
        assert replace(other, lambda_max_nm=start.lambda_max_nm) == start
        assert other.lambda_max_nm != start.lambda_max_nm


@pytest.mark.slow
def test_page_of_stored_runs(tmp_path):
    rows = [
        replace(
            ROW,
            seed=seed,
            generation=g,
            index=i,
            peaks_nm=f"600.0 {520 - 30 * g}.0",
            success_rate=0.3 + 0.1 * g,
            fitness=g,
        )
        for seed in (0, 1)
        for g in range(5)
        for i in range(3)
    ]
    write_rows(rows, tmp_path / "data" / "seeing_ultraviolet.csv")
    Origin.here(1.0).write(tmp_path / "data" / "seeing_ultraviolet.json")
    assert seeing_ultraviolet.main(["--docs", str(tmp_path), "--answer", "They do."]) == 0
    text = (tmp_path / "seeing_ultraviolet.md").read_text()
    assert "They do." in text
    assert "| shortest peak [nm] | 520 [520, 520] | 430 [4" in text
    assert "(rank correlation of shortest peak and fitness: -1.00)" in text
    assert "| 400 to 435 nm | 12 | 0.65 | 3.5 |" in text  # the last two generations of both seeds
    assert (tmp_path / "figures" / "seeing_ultraviolet.png").stat().st_size > 10_000
