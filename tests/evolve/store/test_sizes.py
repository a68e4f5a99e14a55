"""Sizes are limited before anything is read, and work grows linearly."""

import json
import os
import random
import time
from dataclasses import replace

import numpy as np
import pytest

from evolve.analysis import statistics
from evolve.config.assemble import assemble, from_text
from evolve.config.run_config import ConfigError
from evolve.report import gene_drift
from evolve.search.successive_halving import finished
from evolve.store import record
from evolve.store.directory import Run, RunError
from evolve.store.evaluation import LONGEST_FAILURE, Evaluation
from evolve.store.record import Record
from tests.evolve.store.handwriting import records_of, write_records
from tests.evolve.store.records import CONFIG, candidate

HUGE = 6 * 2**30  # bytes of a sparse file
KEY = ".".join("abcdefgh"[i % 8] for i in range(20_001))
QUOTED = " . ".join("'a'" for _ in range(20_001))


@pytest.fixture
def written(run):
    """Return the path of a record with two lines."""
    for number in range(2):
        run.append(candidate(number))
    return run.path / "candidates.jsonl"


@pytest.mark.parametrize("name", ["config.toml", "candidates.jsonl"])
def test_a_huge_sparse_file_is_refused_and_list_shows_the_other_runs(written, call, name):
    other = Run.create(written.parent.with_name("other"), CONFIG)
    os.truncate(written.parent / name, HUGE)
    code, out, err = call("status", written.parent)
    assert (code, out) == (2, "")
    assert f"{written.parent / name}: " in err
    assert "has 6,442,450,944 bytes: must have at most " in err
    code, out, err = call("list", written.parent.parent)
    assert (code, err) == (0, "")
    lines = {line.split()[0]: line.split()[1] for line in out.splitlines()}
    assert lines == {str(other.path): "detection", str(written.parent): "unreadable:"}


def test_list_survives_any_error_of_one_directory(written, call, monkeypatch):
    errors = iter([MemoryError(), RecursionError("deep"), KeyError("x")])

    def failing(*_, **__):
        raise next(errors)

    monkeypatch.setattr(Run, "open", failing)
    for reason in ("MemoryError", "deep", "'x'"):
        code, out, _ = call("list", written.parent.parent)
        assert code == 0
        assert out.rstrip().endswith(f"unreadable: {reason}")


def test_a_large_settings_file_is_refused(tmp_path, call):
    path = tmp_path / "mine.toml"
    path.touch()
    os.truncate(path, HUGE)
    code, _, err = call("run", "detection", "--config", path, "--dry-run")
    assert code == 2
    assert f"{path}: has more than 262,144 bytes: must be a TOML file of settings" in err
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    "text",
    [f"{KEY} = 1", f"[{KEY}]", f"seed = {{{KEY} = 1}}", f"seed = 1\n{QUOTED} = 1"],
    ids=["key", "table", "inline table", "quoted"],
)
def test_a_key_of_20_000_parts_is_refused_at_once(text):
    began = time.process_time()
    with pytest.raises(ConfigError, match=r"mine\.toml, line \d: a key has more than 10 parts"):
        from_text(text, "mine.toml")
    for setting in (f"{KEY}=1", f"seed={{{KEY}=1}}"):
        with pytest.raises(ConfigError, match=r"must look like section\.key=value") as error:
            assemble("detection", assignments=[setting])
        assert len(str(error.value)) < 1000
    assert time.process_time() - began < 2


def test_long_lines_are_searched_for_keys_in_linear_time():
    for unit in ("a", '"', "'", "a ", "a\t.\n", '"a" "'):
        began = time.process_time()
        with pytest.raises(ConfigError):
            from_text(f"# {unit * (200_000 // len(unit))}\n=", "mine.toml")
        assert time.process_time() - began < 1, unit


def test_too_many_returns_and_too_long_lines_are_damage(written, monkeypatch):
    first, second = records_of(written)
    write_records(written, [first, {**second, "returns": [0.5] * 1_000_000}])
    with pytest.raises(RunError, match="line 2: is damaged: returns has 1000000 entries: must have 0 to 10000"):
        Run.open(written.parent)
    longest = len(json.dumps(first)) + 100
    monkeypatch.setattr(record, "LONGEST_LINE", longest)
    write_records(written, [first, {**second, "failure": "x" * longest}])
    with pytest.raises(RunError, match=f"line 2: is damaged: it has more than {longest:,} bytes"):
        Run.open(written.parent)


def test_intervals_of_many_samples_need_little_memory_and_stay_the_same(monkeypatch):
    samples = np.random.default_rng(random.randrange(1000)).random(50)
    whole = statistics.bootstrap_interval(samples)
    for at_once in (1, 777, 50 * 99):
        monkeypatch.setattr(statistics, "RESAMPLED_AT_ONCE", at_once)
        assert statistics.bootstrap_interval(samples) == whole


def test_long_failures_are_shortened_when_they_are_written_and_read(written, call):
    long = "begin " + "x" * 20_000_000 + " end"
    for failure in (Evaluation.failed(long).failure, Evaluation.failed("\n".join(long[:5000])).failure):
        assert failure.startswith("b")
        assert LONGEST_FAILURE - 2 <= len(failure) <= LONGEST_FAILURE
    first, second = records_of(written)
    write_records(written, [first, {**second, "failure": long, "fitness": None}])
    out = call("status", written.parent)[1]
    assert "last failure: begin xxx" in out
    assert out.splitlines()[2].endswith("xxx end")
    assert len(out) < 2 * LONGEST_FAILURE


@pytest.mark.parametrize("searches", ["1000000000", "100001", "9" * 5000])
def test_too_many_searches_are_refused(written, call, searches):
    code, out, err = call("drift", written.parent, "--searches", searches)
    assert (code, out) == (2, "")
    assert "must be a whole number from 2 to 100,000" in err
    assert err.count("\n") == 1
    assert len(err) < 1000
    with pytest.raises(ValueError, match="must be from 2 to 100,000"):
        gene_drift.drift_of([], 10**9)


def in_memory(generations):
    """Return a finished run with the same candidate in every place."""
    config = replace(CONFIG, search=replace(CONFIG.search, generations=generations))
    size, one = config.search.population, candidate(0)
    places = [(number, *divmod(number, size)) for number in range(size * generations)]
    found = tuple(replace(one, id=number, generation=g, index=index) for number, g, index in places)
    return Run(None, config, Record(None, {(c.id, 0): c for c in found}, found))


def test_drift_and_generations_of_long_runs_take_linear_time():
    def seconds(run):
        began = time.process_time()
        generations = run.config.search.generations
        assert finished(run)
        assert gene_drift._complete(run) == generations
        assert sum(len(run.generation(number)) for number in range(generations)) == len(run.candidates)
        gene_drift._ends(run, range(generations - 3, generations))
        return time.process_time() - began

    short, long = in_memory(300), in_memory(3000)
    assert min(seconds(long) for _ in range(2)) < 40 * min(seconds(short) for _ in range(3))  # quadratic: 100
