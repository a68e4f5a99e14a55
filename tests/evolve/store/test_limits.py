"""Limits of records and files: a value at the limit is accepted, and the next one is refused."""

import json
import math
from collections import Counter
from dataclasses import replace

import pytest

from evolve.store import candidate as candidates
from evolve.store import lock, record
from evolve.store.candidate import Candidate
from evolve.store.directory import Run, RunError
from evolve.store.evaluation import KINDS, LONGEST, LONGEST_FAILURE, Evaluation, most_frequent, shortened
from evolve.store.regular_files import read
from tests.evolve.store.records import CONFIG, candidate

COUNTS = {"id": 10**9, "generation": 10**5, "index": 10**4, "seed": 2**64 - 1, "steps": 10**12, "rung": 9}
LINE = json.loads(candidate(0).to_line())


def read_back(**changes):
    return Candidate.from_line(json.dumps({**LINE, **changes}))


@pytest.mark.parametrize("name", COUNTS)
def test_counts(name):
    assert candidates._COUNTS[name] == COUNTS[name]
    for value in (0, COUNTS[name]):
        assert getattr(read_back(**{name: value}), name) == value
    for value in (-1, COUNTS[name] + 1, 1.5, "1", None, True):
        with pytest.raises(ValueError, match=name):
            read_back(**{name: value})


@pytest.mark.parametrize("name", ["fitness", "genome", "returns", "curve"])
def test_numbers(name):
    """A place in a list may hold null in returns and curves only."""

    def with_value(value):
        return read_back(**{name: {"genome": [value], "returns": [value], "curve": [[1, value]]}.get(name, value)})

    for value in (-1e300, 0, 1e300):
        with_value(value)
    for value in (-1.1e300, 1.1e300, "1", True):
        with pytest.raises(ValueError, match=name):
            with_value(value)


def test_costs_times_and_rates():
    assert read_back(costs=0).costs == 0
    assert read_back(costs=0.5, task_fitness=1.5).task_fitness == 1.5
    for value in (-1e-9, 1.1e300):
        with pytest.raises(ValueError, match="costs"):
            read_back(costs=value, task_fitness=LINE["fitness"] + value)
    for name, most, below in (("seconds", 1e300, -1e-9), ("success_rate", 1, -1e-8)):
        for value in (0, most):
            assert getattr(read_back(**{name: value}), name) == value
        for value in (below, 1.1 * most):
            with pytest.raises(ValueError, match=name):
                read_back(**{name: value})


@pytest.mark.parametrize("name", ["curve", "returns", "mishaps", "parents"])
def test_lengths_of_lists(monkeypatch, name):
    assert (candidates._LONGEST, candidates._MOST_RETURNS) == (1_000_000, 10_000)
    monkeypatch.setattr(candidates, "_LONGEST", 3)
    most = candidates._MOST_RETURNS if name == "returns" else 3
    entry = {"curve": [1, 0.5], "mishaps": ["fell", 2], "parents": 4}.get(name, 0.5)
    read_back(**{name: [entry] * most})
    with pytest.raises(ValueError, match=f"{name} has {most + 1} entries: must have 0 to {most}"):
        read_back(**{name: [entry] * (most + 1)})


def test_the_length_of_a_genome():
    assert len(candidates._reals({"genome": [0] * 1_000_000}, "genome")) == 1_000_000
    with pytest.raises(ValueError, match="genome has 1000001 entries: must have 0 to 1000000"):
        candidates._reals({"genome": [0] * 1_000_001}, "genome")


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"failure": 5}, "failure: must be text or null"),
        ({"policy": 5}, "policy: must be a SHA-256 in 64 lower-case hexadecimal digits, or null"),
        ({"policy": "A" * 64}, "policy: must be a SHA-256"),
        ({"policy": "a" * 63}, "policy: must be a SHA-256"),
        ({"mishaps": [[None, 2]]}, "mishaps: must contain a message"),
        ({"mishaps": [["fell", 0]]}, "mishaps"),
        ({"mishaps": [["fell"]]}, "mishaps"),
        ({"curve": [[1]]}, "curve"),
        ({"curve": [[1, 2, 3]]}, "curve"),
        ({"fitness": None}, "fitness = null: must be a number, or failure must state the reason"),
        ({"returns": []}, "returns, success_rate: must be numbers if failure is null"),
        ({"returns": [None]}, "returns, success_rate: must be numbers if failure is null"),
        ({"success_rate": None}, "returns, success_rate: must be numbers if failure is null"),
        ({"failure": "it fell", "costs": 1, "task_fitness": 2}, "costs: must be 0 or absent if the candidate failed"),
        ({"task_fitness": 1.0}, r"task_fitness: must be fitness \+ costs if there are costs, else absent"),
        ({"costs": 0.5}, r"task_fitness: must be fitness \+ costs"),
        ({"other": 1}, "wrong fields: must be exactly id, generation, index"),
    ],
)
def test_contradictions(changes, reason):
    with pytest.raises(ValueError, match=f"^{reason}"):
        read_back(**changes)


def test_a_record_without_later_fields_has_their_defaults():
    old = {name: value for name, value in LINE.items() if name not in ("parents", "rung", "policy", "mishaps", "costs")}
    found = Candidate.from_line(json.dumps(old))
    assert (found.parents, found.rung, found.policy, found.episode_failures, found.costs) == ((), 0, None, (), 0.0)
    with pytest.raises(ValueError, match="wrong fields"):
        Candidate.from_line("[]")


def test_a_fitness_that_is_not_finite_fails_the_candidate():
    for value in (math.nan, math.inf, -math.inf):
        outcome = Evaluation(value, (1.0,), 0.5, 10, 2.5)
        one = candidate(0)
        found = Candidate.from_evaluation(one.place, one.genome, one.phenotype, 3, outcome, (1, 2))
        assert found.failure == f"fitness is {value}"
        assert (found.seconds, found.steps, found.parents, found.fitness) == (2.5, 0, (1, 2), -math.inf)
        assert found.charged(1.0) is found
    assert (one.charged(0.25).fitness, one.charged(0.25).charged(0.5).costs) == (0.75, 0.75)
    assert one.charged(0) is one


@pytest.mark.parametrize("length", [LONGEST_FAILURE - 1, LONGEST_FAILURE, LONGEST_FAILURE + 1, 5000])
def test_failures(length):
    assert (LONGEST_FAILURE, KINDS, LONGEST) == (1000, 4, 300)
    text = "".join(chr(33 + k % 90) for k in range(length))
    found = shortened(text)
    assert Evaluation.failed(f" {text}\n ").failure == found
    if length <= LONGEST_FAILURE:
        assert found == text
        return
    first, last = found.split(" [...] ")
    assert (len(first), len(last)) == (496, 496)
    assert text.startswith(first)
    assert text.endswith(last)


@pytest.mark.parametrize("kinds", [KINDS - 1, KINDS, KINDS + 1, KINDS + 3])
def test_most_frequent_failures(kinds):
    counts = Counter({f"{k} " + "x" * LONGEST: 10 - k for k in range(kinds)})
    found = most_frequent(counts)
    assert found[:KINDS] == tuple((f"{k} " + "x" * (LONGEST - 2), 10 - k) for k in range(min(kinds, KINDS)))
    assert found[KINDS:] == ((("others", sum(10 - k for k in range(KINDS, kinds))),) if kinds > KINDS else ())
    assert most_frequent(Counter(dict(found))) == found, "a second summary changes nothing"
    assert most_frequent(Counter(b=1, a=1)) == (("a", 1), ("b", 1))


def test_sizes_of_records_and_lines(tmp_path, monkeypatch):
    run = Run.create(tmp_path / "run", CONFIG)
    run.append(candidate(0))
    size = run.record.path.stat().st_size
    for name, reason in (("LARGEST_RECORD", f"has {size:,} bytes"), ("LONGEST_LINE", "line 1: is damaged: it")):
        with monkeypatch.context() as patch:
            patch.setattr(record, name, size)
            assert Run.open(run.path).candidates == run.candidates
            patch.setattr(record, name, size - 1)
            with pytest.raises(RunError, match=reason):
                Run.open(run.path)
    assert read(run.record.path, size) == run.record.path.read_bytes()
    with pytest.raises(OSError, match=f"has {size:,} bytes: must have at most {size - 1:,}"):
        read(run.record.path, size - 1)


@pytest.mark.parametrize("more", [0, 1])
def test_a_lock_file_of_another_program_is_not_emptied(tmp_path, more):
    """The file of a process that was killed while it created the run is not longer than a name of process and host."""
    (tmp_path / "lock").write_bytes(b"x" * (lock.LONGEST + more))
    if not more:
        Run.create(tmp_path, CONFIG)
        return
    with pytest.raises(RunError, match="is not empty"):
        Run.create(tmp_path, CONFIG)
    assert (tmp_path / "lock").stat().st_size == lock.LONGEST + 1


def test_copies_of_damaged_records_are_numbered(tmp_path):
    run = Run.create(tmp_path / "run", CONFIG)
    for identity in range(2):
        run.append(candidate(identity))
    whole = run.record.path.read_bytes()
    end = whole.index(b"\n") + 1
    for number in (1, 2):
        damaged = whole[:end] + whole[end:].replace(b"0", b"1", 1)
        run.record.path.write_bytes(damaged)
        opened = Run.open(run.path, before_damage=True)
        assert opened.notice.endswith("this line and all after it are left out")
        opened.repair()
        assert run.record.path.read_bytes() == whole[:end]
        assert run.record.path.with_name(f"candidates.jsonl.damaged-{number}").read_bytes() == damaged
    assert sorted(path.name for path in run.path.glob("*damaged*")) == [
        "candidates.jsonl.damaged-1",
        "candidates.jsonl.damaged-2",
    ]


def test_a_candidate_that_is_written_twice_or_cannot_be_read_is_refused(tmp_path):
    run = Run.create(tmp_path / "run", CONFIG)
    run.append(candidate(0))
    with pytest.raises(RunError, match=r"run: candidate 0 has been evaluated already$"):
        run.append(candidate(0))
    with pytest.raises(RunError, match=r"jsonl: candidate 1 cannot be written: .*seed.*; nothing is added"):
        run.append(replace(candidate(1), seed=2**64))
    assert len(Run.open(run.path).candidates) == 1
