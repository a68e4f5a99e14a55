"""All commands, reports and notebooks count generations as the record does, from 0."""

import io
import json
import random
import re

import pytest

import evolve
from evolve.report.figures import fitness_figure
from evolve.report.lineup import lineup
from evolve.report.tables import headline
from evolve.runs.progress import Lines
from evolve.search.loop import evolve as carry_on
from evolve.store.directory import Run
from evolve.store.evaluation import Evaluation
from tests.evolve.closed_form import tiny

NUMBERS = re.compile(r"\bgenerations? (?:<output>)?(\d+)(?: (?:of|to) (\d+))?(?: to (\d+))?", re.IGNORECASE)


def numbers(text):
    """Return the numbers of all generations that a text names."""
    return {int(number) for named in NUMBERS.findall(text) for number in named if number}


class Acute:
    """An executor whose fitness is the field of view."""

    def run(self, jobs, progress):
        while jobs:
            job = jobs.popleft()
            fitness = job.phenotype.fov_deg
            yield job, Evaluation(fitness, (fitness,) * job.config.evaluation.episodes, 0.5)


@pytest.fixture(params=range(2))
def recorded(request, tmp_path):
    """Return a finished run with a random number of generations, and the lines that it printed."""
    draw, said = random.Random(request.param), io.StringIO()
    sizes = (f"search.generations={draw.randint(2, 6)}", f"search.population={draw.randint(2, 4)}")
    run = Run.create(tmp_path / "run", tiny(*sizes, f"seed={draw.randint(0, 99)}"))
    carry_on(run, Acute(), Lines(run, said, 1))
    return evolve.Run.open(run.path), said.getvalue()


def test_every_command_counts_from_0(recorded, call):
    run, said = recorded
    counted, path, population = range(run.config.search.generations), run.path, run.config.search.population
    assert [candidate.generation for candidate in run.candidates] == [
        i // population for i in range(len(run.candidates))
    ]
    shown = [int(NUMBERS.search(line)[1]) for line in said.splitlines()]
    assert shown == [min(i // population, counted[-1]) for i in range(1, len(run.candidates) + 1)]
    assert numbers(said) == set(counted)
    assert numbers(call("status", path)[1]) == set(counted)
    assert len(json.loads(call("status", path, "--json")[1])["generations"]) == len(counted)
    assert numbers(call("compare", path)[1]) == {run.best.generation}
    assert json.loads(call("compare", path, "--json")[1])["runs"][0]["generation"] == run.best.generation
    span = json.loads(call("drift", path, "--searches", 2, "--json")[1])["generations"]
    assert span[1] == counted[-1]
    assert numbers(call("drift", path, "--searches", 2)[1]) == set(span)


def test_reports_and_notebooks_count_from_0(recorded):
    run, _ = recorded
    counted = range(run.config.search.generations)
    assert numbers(str(lineup(run))) == {0, counted[-1]}
    assert numbers(str(headline(run))) == numbers(run.best._repr_html_()) == {run.best.generation}
    assert list(run.to_dataframe()["generation"].unique()) == [*counted]
    assert list(run.plot_fitness().lines[-1].get_xdata()) == [*counted]
    rows = evolve.analysis.statistics.generation_statistics(run.candidates)
    ticks = re.findall(r">(\d)</text>", str(fitness_figure(rows, run.candidates)))
    assert min(map(int, ticks)) == 0
