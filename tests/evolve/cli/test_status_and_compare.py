"""`evolve status` and `evolve compare` print the contents of records, as text and as JSON."""

import json

import pytest

from evolve.cli.commands.status import standing, standing_lines
from evolve.config.numbering import Place
from evolve.genome.genotype import Genotype
from evolve.genome.phenotype import develop
from evolve.store.candidate import Candidate
from evolve.store.directory import Run
from evolve.store.evaluation import Evaluation
from tests.evolve.closed_form import tiny


def test_status_tells_what_the_record_holds(call, finished):
    run = Run.open(finished)
    told = json.loads(call("status", finished, "--json")[1])
    assert told["state"] == "finished"
    assert told["candidates"] == {"evaluated": 12, "failed": 0, "planned": 12}
    assert told["best"]["id"] == run.best.id
    assert told["steps"] == 12 * 4096
    fitness = sorted(candidate.fitness for candidate in run.generation(1))
    assert told["generations"][1]["median"] == pytest.approx((fitness[1] + fitness[2]) / 2)
    text = call("status", finished)[1]
    assert f"best: candidate {run.best.id}, fitness {run.best.fitness:.4g}" in text


def test_page_that_cannot_be_written_is_named(call, finished):
    code, _, err = call("compare", finished, "--html", "/proc/page.html")
    assert code == 2
    assert err == "evolve: error: /proc/page.html: No such file or directory\n"


def test_watch_ends_with_the_run(call, finished):
    code, out, _ = call("status", finished, "--watch", "--json")
    assert code == 0
    assert [json.loads(line)["state"] for line in out.splitlines()] == ["finished"]


def test_compare_puts_runs_side_by_side(call, finished, tmp_path):
    other = Run.create(tmp_path / "other", tiny("seed=3", "search.sigma=0.1"))
    code, out, _ = call("compare", finished, other.path, "--html", tmp_path / "page.html")
    assert code == 0
    rows = {line.split("  ")[0]: line.split()[-1] for line in out.splitlines()}
    assert rows["search.sigma"] == "0.1"
    assert rows["fitness"] == "-"
    assert "search.population" not in rows
    assert "best fitness so far" in (tmp_path / "page.html").read_text().lower()
    both = json.loads(call("compare", finished, finished, "--json")[1])
    assert both["settings"] == {}
    assert both["runs"][0]["best"] == Run.open(finished).best.id
    assert both["runs"][0]["best_so_far"] == sorted(both["runs"][0]["best_so_far"])


def test_compare_shows_settings_as_they_are_set(call, finished, tmp_path):
    """Names appear as text, and booleans in TOML's form."""
    other = Run.create(tmp_path / "other", tiny("search.optimizer=DE", "search.active=true"))
    rows = {line.split("  ")[0]: line.split()[-2:] for line in call("compare", finished, other.path)[1].splitlines()}
    assert rows["search.optimizer"] == ["CMA", "DE"]
    assert rows["search.active"] == ["false", "true"]


@pytest.fixture
def failed(tmp_path):
    """Return a run in which no candidate has succeeded."""
    run = Run.create(tmp_path / "failed", tiny())
    genome = Genotype(run.config.genome).start
    outcome = Evaluation.failed("no luck")
    run.append(Candidate.from_evaluation(Place(0, 0, 0), tuple(genome), develop(genome, run.config), 1, outcome))
    return run


def test_status_names_the_last_failure(call, finished, failed):
    assert "last failure: no luck" in call("status", failed.path)[1]
    assert json.loads(call("status", failed.path, "--json")[1])["last_failure"] == "no luck"
    assert json.loads(call("status", finished, "--json")[1])["last_failure"] is None


def test_what_is_no_number_is_null_for_machines(call, failed):
    def refuse(name):
        raise AssertionError(f"{name} is not JSON")

    out = call("compare", failed.path, "--json")[1]
    (row,) = json.loads(out, parse_constant=refuse)["runs"]
    assert row["best_so_far"] == [None]
    assert row["fitness_interval"] is None


def test_a_single_episode_has_no_interval(call, failed):
    genome = Genotype(failed.config.genome).start
    alone = Evaluation(1.5, (1.5,), 1.0)
    failed.append(Candidate.from_evaluation(Place(1, 0, 1), tuple(genome), develop(genome, failed.config), 1, alone))
    (line,) = (line for line in call("compare", failed.path)[1].splitlines() if line.startswith("95 % interval"))
    assert line.split() == ["95", "%", "interval", "-"]
    assert json.loads(call("compare", failed.path, "--json")[1])["runs"][0]["fitness_interval"] is None


def test_status_of_many_generations_looks_at_each_candidate_once(finished, monkeypatch):
    """A scan of all candidates for each of 100,000 generations would be too slow."""
    run, looks = Run.open(finished), []
    whole = Run.on_record
    monkeypatch.setattr(Run, "generation", None)
    monkeypatch.setattr(Run, "evaluated_at", None)
    monkeypatch.setattr(Run, "on_record", lambda run, *place: looks.append(place) or whole(run, *place))
    now = standing(run)
    assert [g["evaluated"] for g in now["generations"]] == [4, 4, 4]
    assert now["state"] == "finished"
    assert len(looks) == len(set(looks)) == 12


@pytest.mark.parametrize(("task", "option"), [("detection", ""), ("car.py:Car", " --task car.py:Car")])
def test_the_command_that_continues_a_run_names_a_user_task(finished, task, option):
    """`evolve resume` executes the code of a user task only if the command names it."""
    now = standing(Run.open(finished)) | {"state": "interrupted", "task": task}
    assert standing_lines(now)[-1] == f"continue: evolve resume {finished}{option}"
