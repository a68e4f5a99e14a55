"""Selection or drift: runs in which one gene is under selection and the others are not."""

import json
from dataclasses import replace

import numpy as np
import pytest

import evolve
from evolve.report.gene_drift import drift_of
from evolve.search.null_model import null_model
from evolve.store.directory import Run, RunError
from evolve.store.evaluation import Evaluation
from tests.evolve.closed_form import tiny
from tests.evolve.search.test_null_model import Nobody, measured

LONG = ("search.population=6", "search.generations=12")


class WidestFirst:
    """An executor whose fitness is the field of view; it interrupts the run after `limit` evaluations."""

    def __init__(self, limit=72):
        self.left = limit

    def run(self, jobs, progress=None):
        while jobs:
            if not self.left:
                raise KeyboardInterrupt
            self.left -= 1
            job = jobs.popleft()
            fitness = job.phenotype.fov_deg
            yield job, Evaluation(fitness, (fitness,) * job.config.evaluation.episodes)


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Return runs of two seeds."""
    found = []
    for seed in (1, 2):
        run = Run.create(tmp_path_factory.mktemp("drift") / str(seed), tiny(f"seed={seed}", *LONG))
        evolve.search.loop.evolve(run, WidestFirst(), Nobody())
        found.append(Run.open(run.path))
    return found


@pytest.mark.slow
def test_the_gene_that_is_selected_is_told_from_those_that_are_not(runs):
    drift = drift_of(runs, 40)
    moved = {one.quantity: one for one in drift.moved}
    assert drift.generations == range(9, 12)
    genes = {name for name, use in runs[0].config.genome.items() if use.open}
    assert set(moved) == genes | {"acuity_cpd", "receptors"}
    fov = moved["fov_deg"]
    assert fov.high < fov.mean
    assert fov.p == pytest.approx(2 / 41, rel=0.1)
    assert np.mean([one.p > 0.05 for one in drift.moved]) > 0.5
    late = [c.phenotype.fov_deg for c in runs[1].candidates if c.generation >= 9]
    assert fov.runs[1] == pytest.approx(np.mean(late))
    model = null_model(runs[0].config, measured, 12, 40)
    ends = model.means["fov_deg"][:, 9:].mean(axis=1)
    assert (fov.low, fov.median, fov.high) == pytest.approx(tuple(np.quantile(ends, [0.025, 0.5, 0.975])))


def test_runs_are_compared_as_far_as_all_of_them_have_come(runs, tmp_path):
    short = Run.create(tmp_path / "short", replace(runs[0].config, seed=7))
    with pytest.raises(KeyboardInterrupt):
        evolve.search.loop.evolve(short, WidestFirst(6 * 4 + 5), Nobody())
    assert drift_of([runs[0], Run.open(short.path)], 5).generations == range(1, 4)


def test_what_cannot_be_compared_is_refused_in_a_line(runs, tmp_path):
    other = Run.create(tmp_path / "other", tiny("seed=5", *LONG, "search.sigma=0.1"))
    with pytest.raises(RunError, match=r"differ in search\.sigma: runs .* may differ only in their seeds"):
        drift_of([runs[0], other])
    with pytest.raises(RunError, match="two of these runs have seed 1: they are the same search"):
        drift_of([runs[0], runs[0]])
    begun = Run.create(tmp_path / "begun", tiny("seed=0", *LONG))
    with pytest.raises(RunError, match="begun: no generation is complete yet"):
        drift_of([begun])
    with pytest.raises(ValueError, match="searches = 1: must be from 2 to 100,000"):
        drift_of(runs, 1)


@pytest.mark.slow
def test_the_command_says_it_to_people_and_machines(call, runs):
    code, out, _ = call("drift", *(run.path for run in runs), "--searches", 5)
    assert code == 0
    rows = {line.split()[0]: line.split() for line in out.splitlines()}
    assert float(rows["fov_deg"][-1]) == pytest.approx(2 / 6, rel=0.01)
    assert "generations 9 to 11" in out
    told = json.loads(call("drift", runs[0].path, "--searches", 5, "--json")[1])
    assert (told["generations"], told["searches"]) == ([9, 11], 5)
    found = {one["quantity"]: one for one in told["moved"]}
    table = evolve.Run.open(runs[0].path).drift(5)
    assert table.p["fov_deg"] == found["fov_deg"]["p"]
    assert table.run["receptors"] == found["receptors"]["runs"][0]
    assert list(table.columns) == ["run", "median", "low", "high", "p"]


@pytest.mark.parametrize("searches", ["1", "0", "-3", "few"])
def test_too_few_searches_are_refused_by_the_command(call, runs, searches):
    code, _, err = call("drift", runs[0].path, f"--searches={searches}")
    assert code == 2
    assert f"argument --searches: {searches!r}: must be a whole number from 2 to 100,000" in err
