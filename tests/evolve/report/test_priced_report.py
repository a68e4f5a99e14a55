"""Task fitness, costs and the two acuities in status, comparison, report, tables and TensorBoard."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

import evolve
from evolve.analysis.acuity import acuity_cpd, acuity_vertical_cpd
from evolve.analysis.fitness_parts import fitness_interval, fitness_text
from evolve.analysis.statistics import bootstrap_interval
from evolve.config.numbering import Place
from evolve.genome.genotype import Genotype
from evolve.report import figures
from evolve.report.fitness_section import fitness_section
from evolve.report.lineup import lineup
from evolve.report.tables import acuity_text, all_candidates, headline
from evolve.store.candidate import Candidate
from evolve.store.directory import Run
from evolve.store.evaluation import Evaluation
from tests.evolve.closed_form import tiny
from tests.evolve.report.reported import Page
from tests.evolve.small_run import PHENOTYPE

TASK_FITNESS = (10.0, 30.0, 28.0, 12.0)
EYES = (1, 8, 2, 1)  # of 4 x 5 x 3 receptors, at a price of 2 per eye and 1/32 per receptor
COSTS = tuple(eyes * (2 + 60 / 32) for eyes in EYES)
HIGH = replace(PHENOTYPE, fov_deg=50.0, vertical_fov_deg=80.0)  # acuities of 1 / 20 and 1 / 40


def recorded(path, *settings):
    """Return a run with two generations of two candidates, of which one failed, and the third is the best."""
    config = tiny("search.population=2", "search.generations=3", *settings)
    run = Run.create(path, config)
    genome = tuple(Genotype(config.genome).start.tolist())
    for i, (value, eyes) in enumerate(zip(TASK_FITNESS, EYES, strict=True)):
        animal = replace(HIGH, n_eyes=eyes, placement_range_deg=90.0)
        outcome = Evaluation(value, (value - 2, value, value + 2), 0.5, 1000, 60.0, ((1000, value),))
        candidate = Candidate.from_evaluation(Place.from_id(i, 2), genome, animal, i, outcome)
        run.append(candidate.charged(config.costs.total(animal, config.eye)))
    failed = Candidate.from_evaluation(Place(4, 2, 0), genome, HIGH, 4, Evaluation.failed("it broke"))
    run.append(failed.charged(config.costs.total(HIGH, config.eye)))
    return Run.open(run.path)


@pytest.fixture(scope="module")
def priced(tmp_path_factory):
    settings = ("costs.per_eye=2", "costs.per_receptor=0.03125")
    return recorded(tmp_path_factory.mktemp("priced") / "run", *settings)


@pytest.fixture(scope="module")
def free(tmp_path_factory):
    return recorded(tmp_path_factory.mktemp("free") / "run")


def test_costs_decide_which_animal_is_the_best(priced, free):
    assert [one.costs for one in priced.candidates] == [*COSTS, 0]
    assert priced.best.id == 2
    assert free.best.id == 1


def test_status_shows_both_parts(call, priced, free):
    text = call("status", priced.path)[1]
    assert "best: candidate 2, fitness 20.25 (task fitness 28, costs 7.75)" in text
    assert "generation 0: best 6.125 (task fitness 10, costs 3.875), median 2.562" in text
    told = json.loads(call("status", priced.path, "--json")[1])
    assert {name: told["best"][name] for name in ("fitness", "task_fitness", "costs")} == {
        "fitness": 20.25,
        "task_fitness": 28.0,
        "costs": 7.75,
    }
    assert told["generations"][1] | {"median": None} == {
        "evaluated": 2,
        "best": 20.25,
        "task_fitness": 28.0,
        "costs": 7.75,
        "median": None,
    }
    assert told["generations"][2]["costs"] is None
    assert "costs" not in call("status", free.path)[1]


def test_list_and_compare_show_both_parts(call, priced, free):
    listed = call("list", priced.path.parent)[1]
    assert listed.rstrip().endswith("best fitness 20.25 (task fitness 28, costs 7.75)")
    lines = call("compare", priced.path, free.path)[1].splitlines()
    rows = {line.split("  ")[0]: line.split()[-2:] for line in lines}
    assert rows["fitness"] == ["20.25", "30"]
    assert rows["task fitness"] == ["28", "30"]
    assert rows["costs"] == ["7.75", "0"]
    assert rows["costs.per_eye"] == ["2", "0"]
    assert "task fitness" not in call("compare", free.path)[1]
    (told,) = json.loads(call("compare", priced.path, "--json")[1])["runs"]
    assert (told["task_fitness"], told["costs"]) == (28.0, 7.75)
    assert told["fitness_interval"] == pytest.approx([26 - 7.75, 30 - 7.75])


def test_intervals_are_those_of_returns_minus_costs(priced):
    low, high = bootstrap_interval(priced.best.returns)
    assert fitness_interval(priced.best) == (low - 7.75, high - 7.75)
    assert "95 % interval 18.2 to 22.2" in headline(priced).markup
    assert "task fitness 28.00, costs 7.750; " in headline(priced).markup


def test_the_table_has_both_parts(priced, free):
    header, *rows = Page(all_candidates(priced).markup).rows["all-candidates"]
    assert header[2:7] == ["fitness", "task fitness", "costs", "lowest return", "highest return"]
    assert rows[2][2:7] == ["20.2", "28.0", "7.75", "26.0", "30.0"]
    assert rows[4][2:7] == ["failed", "–", "–", "–", "–"]
    assert len({len(row) for row in (header, *rows)}) == 1
    plain, *rows = Page(all_candidates(free).markup).rows["all-candidates"]
    assert plain[2:5] == ["fitness", "lowest", "highest"]
    assert {len(row) for row in (plain, *rows)} == {len(header) - 2}


def test_the_figure_has_both_parts(priced, free, monkeypatch):
    drawn = {}
    monkeypatch.setattr(figures, "inline", lambda figure, name, alt: drawn.update({name: (figure, alt)}) or Page)
    figures.costs_figure(priced.candidates)
    figure, alt = drawn["costs"]
    upper, lower = figure.axes
    assert (upper.get_ylabel(), lower.get_ylabel()) == ("task fitness", "costs")
    for axes, values, best in ((upper, TASK_FITNESS, [10, 28, 28]), (lower, COSTS, [3.875, 7.75, 7.75])):
        dots, _, line = axes.lines
        np.testing.assert_allclose(dots.get_ydata(), values)
        np.testing.assert_allclose(line.get_ydata(), best)
    assert alt == "Parts of the best fitness: task fitness 28, costs 7.75."
    with pytest.raises(ValueError, match="no candidate has succeeded: one is needed"):
        figures.costs_figure(priced.candidates[-1:])


def test_the_section_explains_the_parts_only_if_there_are_costs(priced, free):
    shown = fitness_section(priced).markup
    assert "costs are 0.03125 per receptor, 2 per eye, 0 per neuron" in shown
    assert "evaluation episodes after training, minus costs" in shown
    assert "fitness (mean return − costs)" in shown
    plain = fitness_section(free).markup
    assert "costs" not in plain.replace(", minus costs, if any; ", "")
    assert "20.2 (task fitness 28.0, costs 7.75)" in lineup(priced).markup


def test_python_shows_both_parts(priced, free):
    run = evolve.Run.open(priced.path)
    table = run.to_dataframe()
    np.testing.assert_allclose(table.task_fitness, [*TASK_FITNESS, np.nan])
    np.testing.assert_allclose(table.costs, [*COSTS, np.nan])
    np.testing.assert_allclose(table.fitness, table.task_fitness - table.costs)
    assert run.plot_fitness().get_ylabel() == "fitness (mean return − costs)"
    assert "20.2 (task fitness 28.0, costs 7.75)" in run.best._repr_html_()
    assert evolve.Run.open(free.path).plot_fitness().get_ylabel() == "fitness (mean return)"


def test_fitness_without_costs_has_no_parts():
    assert fitness_text(3.25, 0.0) == "3.25"
    assert fitness_text(-1.0, 0.5) == "-1 (task fitness -0.5, costs 0.5)"


# --- acuity in each direction


@pytest.mark.parametrize(
    ("changes", "across", "up"),
    [
        ({"resolution": (4, 5), "n_eyes": 1}, 1 / 20, 1 / 40),
        ({"resolution": (16, 5), "n_eyes": 1}, 1 / 20, 1 / 10),
        ({"resolution": (4, 5), "n_eyes": 91, "placement_range_deg": 90.0}, 1 / 2, 1 / 40),
        # The spacing of square receptors is that of the columns, 10 degrees, whatever the number of rows.
        ({"resolution": (1, 5), "n_eyes": 1, "vertical_fov_deg": None}, 1 / 20, 1 / 20),
        ({"resolution": (1, 5), "n_eyes": 91, "placement_range_deg": 90.0, "vertical_fov_deg": None}, 1 / 2, 1 / 20),
    ],
)
def test_acuity_has_two_directions(changes, across, up):
    animal = replace(HIGH, **changes)
    assert acuity_cpd(animal) == pytest.approx(across, rel=1e-12)
    assert acuity_vertical_cpd(animal) == pytest.approx(up, rel=1e-12)


def test_acuity_of_the_eye_itself_agrees():
    """Close to the axis, the two sampling limits of `optics` have the ratio of the two acuities."""
    narrow = replace(HIGH, n_eyes=1, fov_deg=5.0, vertical_fov_deg=8.0)
    seen = narrow.eyes(tiny().eye).eye().describe()
    assert math.isclose(seen.sampling_cpd, acuity_cpd(narrow), rel_tol=2e-3)
    assert math.isclose(seen.sampling_vertical_cpd, acuity_vertical_cpd(narrow), rel_tol=2e-3)


def test_reports_show_both_where_they_differ(priced, call):
    square = replace(HIGH, vertical_fov_deg=None, n_eyes=1)
    assert acuity_text(square, "cycles/degree") == "0.0500 cycles/degree"
    assert acuity_text(replace(HIGH, n_eyes=1), "cpd") == "0.0500 cpd horizontally, 0.0250 vertically"
    header, *rows = Page(all_candidates(priced).markup).rows["all-candidates"]
    assert rows[0][header.index("acuity, horizontal × vertical [cpd]")] == "0.0500 × 0.0250"
    assert "cycles per degree, horizontal × vertical; limit by receptor spacing alone" in headline(priced).markup
    rows = {line.split("  ")[0]: line.split()[-1] for line in call("compare", priced.path)[1].splitlines()}
    assert (rows["acuity [cpd]"], rows["vertical acuity [cpd]"]) == ("0.05", "0.025")
    table = evolve.Run.open(priced.path).to_dataframe()
    assert table.acuity_vertical_cpd[0] == pytest.approx(1 / 40)
