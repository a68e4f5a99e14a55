"""Costs in a record: they read back, contradictions are refused, and lines without costs keep their keys."""

import json

import pytest

from evolve.store.candidate import Candidate
from evolve.store.directory import Run, RunError
from tests.evolve.store.records import candidate

PRICED = candidate(1, 0.1 + 0.2).charged(0.7)


def changed(**values):
    record = json.loads(PRICED.to_line())
    return json.dumps({name: value for name, value in {**record, **values}.items() if value != "absent"}) + "\n"


def test_both_parts_are_recorded(run):
    record = json.loads(PRICED.to_line())
    assert record["costs"] == 0.7
    assert record["fitness"] == (0.1 + 0.2) - 0.7
    assert record["task_fitness"] == record["fitness"] + 0.7
    run.append(PRICED)
    (again,) = Run.open(run.path).candidates
    assert again == PRICED
    assert again.task_fitness == pytest.approx(0.1 + 0.2, rel=1e-15)
    assert again.returns == candidate(1, 0.1 + 0.2).returns


def test_without_costs_a_line_has_the_former_keys():
    """Equal lines give equal checksums, so former records and new ones without costs do not differ."""
    line = candidate(1, -0.0).to_line()
    assert not {"costs", "task_fitness"} & set(json.loads(line))
    assert candidate(1, -0.0).charged(0.0).to_line() == line
    assert Candidate.from_line(line).costs == 0
    assert Candidate.from_line(line).task_fitness == Candidate.from_line(line).fitness


def test_a_failed_candidate_has_no_costs():
    failed = candidate(1, failure="it broke")
    assert failed.charged(3.0) == failed
    assert "costs" not in json.loads(failed.to_line())


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({"costs": -1.0}, "costs = -1.0: must"),
        ({"costs": "0.7"}, "costs = '0.7': must"),
        ({"costs": None}, "costs = None: must"),
        ({"costs": 0.8}, "task_fitness: must be fitness"),
        ({"task_fitness": 9.0}, "task_fitness: must be fitness"),
        ({"task_fitness": "absent"}, "task_fitness: must be fitness"),
        ({"costs": "absent"}, "task_fitness: must be fitness"),
        ({"failure": "it broke", "fitness": None}, "costs: must be 0 or absent"),
    ],
)
def test_contradictions_are_damage(run, values, says):
    (run.path / "candidates.jsonl").write_text(changed(**values))
    with pytest.raises(RunError, match="line 1: is damaged") as error:
        Run.open(run.path)
    assert says in str(error.value)
