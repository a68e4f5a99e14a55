"""Simulated searches: the fit recovers a fitness landscape from synthetic training runs, and searches climb it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from evolve.config.run_config import EyeConfig
from evolve.store.directory import Run
from experiments import imitated_lenses
from experiments.designed import Design
from experiments.fitness_landscape import SPREAD, Landscape, Life, behind_glass, fitted, holes, opening
from experiments.imitated_lenses import Check, Contents, page, searched
from experiments.store import RECORDS, Origin

TRUE = Landscape(5.0, 300.0, 0.3, 2.5, 1.2, 1.5)
RECORD = RECORDS / imitated_lenses.RECORD


@pytest.fixture
def lives():
    """Three noisy training runs for each of many eyes."""
    random = np.random.default_rng(0)
    eyes = [(a, b) for a in np.linspace(0.1, 0.7, 13) for b in np.linspace(0, 3, 11) for _ in range(3)]
    fitness = [float(TRUE.fitness(a, b)) for a, b in eyes]
    return [
        Life(a, b, f + random.normal() * (SPREAD[0] + SPREAD[1] * f)) for (a, b), f in zip(eyes, fitness, strict=True)
    ]


def test_a_landscape_is_found_again(lives):
    found = fitted(lives)
    assert found.misfit == pytest.approx(1, abs=0.1), (
        "with 429 training runs, the standard deviation is accurate to 3 %"
    )
    for aperture, blur in ((0.2, 0.0), (0.45, 0.0), (0.45, 1.0), (0.6, 2.5)):
        expected = TRUE.fitness(aperture, blur)
        assert abs(found.fitness(aperture, blur) - expected) < SPREAD[0] + 0.05 * expected
    assert Check.from_runs(lives, found).correlation > 0.9
    shuffled = [replace(life, fitness=other.fitness) for life, other in zip(lives, lives[::-1], strict=True)]
    assert Check.from_runs(shuffled, found).correlation < 0.3


@pytest.mark.slow
def test_lives_differ_by_chance_alone():
    animals = [Design("detection", 2, 15, 15, 45.0, 0.003, 0, relative_aperture=0.45, glass_power=1.0).animal] * 4000
    drawn = TRUE.lived(animals, EyeConfig(), np.random.default_rng(0))
    expected = float(TRUE.fitness(0.45, 0.0))
    deviation = SPREAD[0] + SPREAD[1] * expected
    assert drawn.mean() == pytest.approx(expected, abs=0.01 * expected)  # blur is 0 up to the pixels' width
    assert drawn.std() == pytest.approx(deviation, rel=0.05)


def test_lives_of_a_record_are_those_of_its_phases():
    run = Run.open(RECORD)
    before, after = holes(run), behind_glass(run)
    assert len(before) == opening(run.config) * run.config.search.population
    assert len(before) + len(after) == len(run.candidates)
    for life in before:
        assert life.blur == pytest.approx(life.aperture * 15 / math.sqrt(8), rel=0.01), "blur of a pinhole"
    assert any(abs(life.blur / (life.aperture * 15 / math.sqrt(8)) - 1) > 0.3 for life in after)


@pytest.mark.slow
def test_searches_climb_what_there_is_to_climb(monkeypatch):
    """The search finds nothing on a flat landscape. If light and sharpness increase fitness, it finds wider pupils with
    glass near focus."""
    monkeypatch.setitem(imitated_lenses.CASES, "short", ("search.generations=24",))
    ended = [searched("short", 0, land) for land in (TRUE, replace(TRUE, high=0.0))]
    assert ended == [searched("short", 0, land) for land in (TRUE, replace(TRUE, high=0.0))]
    found, lost = ended
    assert 0.7 < found.power < 1.3
    assert found.blur < 1 < lost.blur  # 0.2 to 0.5, and 1.7 to 5, in six searches
    assert found.fitness > 100
    assert found.strehl > lost.strehl or math.isnan(lost.strehl)


@pytest.mark.slow
def test_page(tmp_path, lives):
    rows = [searched("3 genes, 18 generations", seed, TRUE) for seed in (0, 1)]
    land = fitted(lives)
    lived = [*lives, Life(0.3, 0.5, 50.0)]
    contents = Contents(rows, lived, land, Check.from_runs(lives, land), Origin.here(1.0), "Yes.")
    page(contents).publish(tmp_path)
    text = (tmp_path / "imitated_lenses.md").read_text()
    assert "| 3 genes, 18 generations |" in text
    assert "r = " in text
    assert (tmp_path / "figures" / "imitated_lenses.png").stat().st_size > 10_000
