"""The record is read back bit for bit, never overwritten, and complete after any crash; errors name file and line of
damage.
"""

import errno
import json
import math
import os
import resource
from dataclasses import replace

import pytest

from evolve.config.numbering import Place
from evolve.store.candidate import Candidate
from evolve.store.directory import Run, RunError
from evolve.store.evaluation import Evaluation
from evolve.store.record import _furthest
from tests.evolve.store.records import CONFIG, DIMENSION, candidate


def test_record_reads_back_bit_for_bit(run):
    written = [candidate(2, 0.1 + 0.2), candidate(0, -1e-300), candidate(1)]
    for entry in written:
        run.append(entry)
    again = Run.open(run.path)
    assert again.candidates == (written[1], written[2], written[0]) == run.candidates
    assert again.config == CONFIG


def test_failures_have_the_worst_fitness_and_valid_json(run):
    run.append(candidate(0, -5.0))
    run.append(candidate(1, math.nan))
    run.append(
        Candidate.from_evaluation(
            Place(2, 0, 2), (0.5,) * DIMENSION, run.candidates[0].phenotype, 1, Evaluation.failed("it\nbroke")
        )
    )
    lines = (run.path / "candidates.jsonl").read_text().splitlines()
    assert [json.loads(line, parse_constant=pytest.fail)["fitness"] for line in lines] == [-5.0, None, None]
    _, nan, broken = Run.open(run.path).candidates
    assert nan.fitness == broken.fitness == -math.inf
    assert (nan.failure, broken.failure) == ("fitness is nan", "it broke")
    assert Run.open(run.path).best.id == 0


def test_candidate_is_written_once(run):
    run.append(candidate(0))
    with pytest.raises(RunError, match="candidate 0 has been evaluated already"):
        run.append(candidate(0, 9.0))


@pytest.mark.parametrize("begun_anew", [True, False], ids=["begun anew", "deleted"])
def test_a_run_that_is_somebody_elses_by_now_gets_no_more_lines(run, begun_anew):
    """The run's directory was deleted during the run, and in one case another run was created in the same place."""
    run.append(candidate(0))
    record = run.path / "candidates.jsonl"
    record.unlink()
    if begun_anew:
        record.write_text(candidate(0).to_line() + candidate(1).to_line())
    with pytest.raises(RunError, match="was changed by another process"):
        run.append(candidate(2))
    assert (len(record.read_text().splitlines()) if record.exists() else 0) == 2 * begun_anew
    assert record.exists() == begun_anew, "deleted files stay deleted"


@pytest.mark.parametrize("kept", [1, 40, -2, -1])
def test_unfinished_last_line_is_dropped_with_a_notice_and_cut_off_on_repair(run, kept):
    """The last line is cut at any byte before the newline, which completes a line."""
    run.append(candidate(0))
    whole = (run.path / "candidates.jsonl").read_bytes()
    torn = candidate(1).to_line().encode()[:kept]
    (run.path / "candidates.jsonl").write_bytes(whole + torn)
    again = Run.open(run.path)
    assert [c.id for c in again.candidates] == [0]
    assert "line 2 is unfinished" in again.notice
    assert (run.path / "candidates.jsonl").read_bytes() == whole + torn, "reading must not write"
    again.repair()
    again.append(candidate(1))
    assert [c.id for c in Run.open(run.path).candidates] == [0, 1]
    assert Run.open(run.path).notice is None


def damaged(change):
    record = json.loads(candidate(1).to_line())
    change(record)
    return json.dumps(record) + "\n"


DAMAGE = {
    "no JSON": ("{]\n", "Expecting"),
    "not UTF-8": (b"\xff\xfe\n", "utf-8"),
    "zeros": (b"\0" * 64 + b"\n", "Expecting"),
    "no record": ("[1]\n", "must be exactly"),
    "missing": (damaged(lambda r: r.pop("genome")), "must be exactly"),
    "wrong type": (damaged(lambda r: r.update(genome=None)), "genome = None: must be a list"),
    "wrong phenotype": (damaged(lambda r: r["phenotype"].pop("n_eyes")), "n_eyes"),
    "wrong genome": (damaged(lambda r: r["genome"].pop()), f"{DIMENSION} genes are open"),
    "wrong place": (damaged(lambda r: r.update(index=3)), "can't be number 3 of generation 0"),
    "twice": (candidate(0).to_line(), "candidate 0 occurs twice"),
}


@pytest.mark.parametrize("kind", DAMAGE)
def test_damage_is_named_by_file_and_line(run, kind):
    line, reason = DAMAGE[kind]
    run.append(candidate(0))
    with (run.path / "candidates.jsonl").open("ab") as file:
        file.write(line if isinstance(line, bytes) else line.encode())
    with pytest.raises(RunError, match=r"candidates\.jsonl, line 2: is damaged") as caught:
        Run.open(run.path)
    assert reason in str(caught.value)
    assert "\n" not in str(caught.value)


def test_full_disk_is_named(run, monkeypatch):
    def full(descriptor):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(RunError, match=r"candidates\.jsonl: cannot be written: No space left"):
        run.append(candidate(0))
    assert run.candidates == (), "candidates that are not on disk are not on record"


def test_a_record_that_may_not_grow_loses_nothing(run):
    """A limit of the file's size stands in for a full disk."""
    run.append(candidate(0))
    record = run.path / "candidates.jsonl"
    kept = record.read_bytes()
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (len(kept), hard))
    try:
        with pytest.raises(RunError, match=r"candidates\.jsonl: cannot be written: File too large"):
            run.append(candidate(1))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert record.read_bytes() == kept
    assert [c.id for c in run.candidates] == [0], "candidates that are not on disk are not on record"


def test_one_line_more_looks_at_few_others(run, monkeypatch):
    """The result of `append` equals that of a new reader, for lines with ids in any order."""
    monkeypatch.setattr("evolve.store.record._furthest", None)
    for identity in (5, 0, 7, 3, 11, 4):
        run.append(candidate(identity))
        assert [c.id for c in run.candidates] == sorted(c.id for c in run.record.lines.values())
    run.append(replace(candidate(5), rung=1))
    run.append(replace(candidate(0), rung=2))
    run.append(replace(candidate(0), rung=1))
    monkeypatch.undo()
    assert run.candidates == _furthest(run.record.lines)
    assert [c.rung for c in run.candidates] == [2, 0, 0, 1, 0, 0]


def test_a_line_is_on_the_disk_when_it_is_on_record_and_what_is_cut_off_is_gone_from_it(run, monkeypatch):
    sizes, sync = [], os.fsync
    monkeypatch.setattr(os, "fsync", lambda file: (sizes.append(os.fstat(file).st_size), sync(file)))
    record = run.path / "candidates.jsonl"
    run.append(candidate(0))
    whole = record.stat().st_size
    assert sizes == [whole]
    with record.open("ab") as file:
        file.write(b'{"half')
    again = Run.open(run.path)
    again.record.cut_off_unused()
    assert record.stat().st_size == whole
    assert sizes == [whole, whole]
