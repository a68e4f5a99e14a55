"""Searches for compound eyes in two lights: synthetic records with a known answer, and the rules of the plan."""

import math
from dataclasses import replace

import numpy as np
import pytest

from evolve.genome.phenotype import develop
from evolve.search.search import Search
from evolve.store.candidate import Candidate
from evolve.store.directory import Run
from evolve.store.evaluation import Evaluation
from experiments import evolved_facets, facet_searches
from experiments.drift import Drift
from experiments.evolved import RunMetadata, Store
from experiments.evolved_facets import PRIMARY, QUANTITIES, compared, looks, main, outcome, page
from experiments.facet_searches import FIRST_SEEDS, LIGHTS, searches
from experiments.store import Origin
from tests.experiments.test_evolved import ROW

ORIGIN = Origin(1.0, "m", {"commit": "a", "python": "3"})
SPREAD = 0.25  # standard deviation of ln p in searches with random fitness


def animal(parameter):
    """A row with this eye parameter: ommatidia 10° apart and facets of the corresponding width."""
    width = 1e6 * parameter * 500e-9 / math.radians(10.0)
    return replace(ROW, fov_deg=60.0, width=6, height=6, facet_diameter_um=width, rhabdom_diameter_um=2.0)


def store_of(logs):
    """Searches of one generation with one candidate, whose ln p are these values, by light and pair."""
    chance = np.random.default_rng(3)
    rows = [
        replace(animal(math.exp(value)), group=light, seed=FIRST_SEEDS[light] + pair)
        for light in LIGHTS
        for pair, value in enumerate(logs[light])
    ]
    drift = []
    for name in QUANTITIES:
        ends = " ".join(f"{one:.6g}" for one in chance.normal(0.8, SPREAD, 1000))
        drift += [Drift(light, name, 0, 0.3, 0.8, 1.3, ends) for light in LIGHTS]
    runs = [RunMetadata(light, 0, 1, 1, 1, 1.0, "abc", 0.002, 1e-4) for light in LIGHTS]
    return Store(rows, runs, drift, ORIGIN, "Yes.")


def shifted(pairs, shift):
    return store_of({"bright": [0.8] * pairs, "dim": [0.8 + shift] * pairs})


def test_the_eye_parameter_is_diameter_times_angle_in_wavelengths():
    assert QUANTITIES[PRIMARY](animal(2.5)) == pytest.approx(math.log(2.5))


def test_the_difference_has_the_p_of_the_normal_distribution():
    """The difference of two means of three searches has a standard deviation of SPREAD √(2/3)."""
    test = compared(shifted(3, 1.96 * SPREAD * math.sqrt(2 / 3)), 3)
    assert test.p == pytest.approx(0.05, abs=0.01)
    assert test.low == pytest.approx(-1.96 * SPREAD * math.sqrt(2 / 3), abs=0.04)


@pytest.mark.parametrize(
    ("pairs", "shift", "conclusion"),
    [
        (3, 1.0, "larger in dim light"),
        (3, -1.0, "smaller in dim light"),
        (3, 0.0, "open"),
        (6, 0.0, "open"),
        (9, 0.0, "no difference found"),
        (9, 0.4, "larger in dim light"),
    ],
)
def test_conclusions_follow_the_plan(pairs, shift, conclusion):
    store = shifted(pairs, shift)
    assert outcome(store) == conclusion
    assert f"**{conclusion}**" in page(store).markdown


def test_tests_use_only_their_own_pairs_and_end_with_the_first_significant_one():
    store = store_of({"bright": [0.8] * 9, "dim": [0.8] * 3 + [3.0] * 6})
    assert [look for look, _ in looks(store)] == [3, 6]
    assert [test.value for _, test in looks(store)] == pytest.approx([0.0, 1.1])


@pytest.mark.slow
def test_without_a_difference_the_planned_tests_rarely_find_one(monkeypatch):
    """The three tests together have a level of 0.05, so 20 of 400 experiments without an effect should find one.

    With a probability of 0.99, the number is between 10 and 31. Three tests at a level of 0.05 each would have a common
    level of 0.107 (Armitage 1969), and 43 would be expected.
    """
    monkeypatch.setattr("experiments.contrast.SEVERAL", 2000)
    chance = np.random.default_rng(7)
    several = store_of({light: [0.8] * 9 for light in LIGHTS})
    found = 0
    for _ in range(400):
        values = chance.normal(0.8, SPREAD, len(several.rows))
        rows = [
            replace(row, facet_diameter_um=animal(math.exp(value)).facet_diameter_um)
            for row, value in zip(several.rows, values, strict=True)
        ]
        found += outcome(replace(several, rows=rows)) != "no difference found"
    assert 10 <= found <= 31


def record(folder, planned, fitness):
    """A finished search whose candidates were not trained, but have this fitness."""
    config = planned.config
    run, search = Run.create(folder / planned.name, config), Search(config)
    for _ in range(config.search.generations):
        proposals = search.propose_generation()
        told = []
        for proposal in proposals:
            phenotype = develop(proposal.vector, config)
            value = fitness(phenotype)
            outcome = Evaluation(value, (value,) * 4, 0.5, 10, 1.0)
            run.append(Candidate.from_evaluation(proposal.place, tuple(proposal.vector), phenotype, 0, outcome))
            told.append((proposal.id, value))
        search.tell(told)


@pytest.mark.slow
def test_records_with_selection_for_wide_facets_in_dim_light_give_a_page(tmp_path, monkeypatch, capsys):
    """Fitness rises with p in dim light and falls with it in bright light; 50 random searches per light."""
    monkeypatch.setattr("experiments.drift.SEEDS", 50)
    monkeypatch.setattr(evolved_facets, "LEVEL", 0.05)  # 50 random searches have no smaller p-value than 0.039
    arguments = ["--docs", str(tmp_path / "docs"), "--records", str(tmp_path)]
    for one in searches()[:7]:
        if one.name == "facets-bright-2":
            assert main(arguments) == 2
            assert (
                "facets-bright-2 is missing or unfinished; complete pairs of searches: 2, must be at least 3"
                in capsys.readouterr().err
            )
        sign = 1 if "dim" in one.name else -1
        record(tmp_path, one, lambda a, s=sign: s * a.facet_diameter_um / a.resolution[1])
    assert main(arguments) == 0
    text = (tmp_path / "docs/evolved_facets.md").read_text()
    assert "**larger in dim light**" in text
    assert "| bright, seed 2 | 40 | 5 of 5 |" in text
    assert "bright, seed 3" not in text, "the seventh search belongs to an incomplete pair"
    assert (tmp_path / "docs/figures/evolved_facets.png").stat().st_size > 5000
    monkeypatch.setattr(facet_searches, "SETTINGS", (*facet_searches.SETTINGS, "learning.gamma=0.95"))
    assert main(arguments) == 2
    assert "has other settings than the plan: learning.gamma" in capsys.readouterr().err
