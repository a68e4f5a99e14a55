"""Questions to a run directory, each with its answer and its error, and the descriptions of runs and candidates."""

import errno
import re
from dataclasses import replace

import pytest

from evolve.config.formats import OLDEST_CONTINUED
from evolve.store import checksums, directory, regular_files, versions
from evolve.store.candidate import Candidate
from evolve.store.checksums import LISTED, harmed, list_checksums
from evolve.store.directory import Run, RunError
from evolve.store.lock import holder
from evolve.store.policies import lost
from evolve.store.shipped_run import copy_shipped_run
from tests.evolve.closed_form import tiny
from tests.evolve.store.records import CONFIG, candidate

IN_RUNGS = tiny("search.rungs=3", "learning.total_steps=16384")


@pytest.fixture
def five(run):
    """Return a run whose candidates 0 to 4 finish in the order 4, 0, 1, 3, 2; candidate 3 fails."""
    for identity in (4, 0, 1, 3, 2):
        run.append(candidate(identity, float(identity), "it fell" if identity == 3 else None))
    return run


def test_descriptions(five, tmp_path):
    empty = Run.create(tmp_path / "empty", CONFIG)
    assert repr(empty) == f"<Run {str(empty.path)!r}: detection, 0 of 12 candidates evaluated>"
    assert repr(five) == f"<Run {str(five.path)!r}: detection, 5 of 12 candidates evaluated, best fitness 4>"
    assert repr(candidate(1, 12.3456)) == "<Candidate 1, generation 0, fitness 12.35>"
    assert repr(candidate(7, failure="it fell")) == "<Candidate 7, generation 1, failed: it fell>"


def test_candidates_by_id_generation_and_order(five):
    assert [one.id for one in five.candidates] == [0, 1, 2, 3, 4]
    assert [one.id for one in five.in_order_of_finish] == [4, 0, 1, 3, 2]
    assert [[one.id for one in five.generation(number)] for number in range(3)] == [[0, 1, 2, 3], [4], []]
    assert five.candidate() is five.best is five.candidate(4)
    assert [five.candidate(identity).id for identity in range(5)] == [0, 1, 2, 3, 4]
    with pytest.raises(RunError, match=r"run: there is no candidate 5; 5 have been evaluated$"):
        five.candidate(5)


def test_without_a_success_there_is_no_best_candidate(run):
    for failed in (False, True):
        if failed:
            run.append(candidate(0, failure="it fell"))
        with pytest.raises(RunError, match=r"run: no candidate has been evaluated successfully yet$"):
            run.candidate()


def test_rungs(tmp_path):
    run = Run.create(tmp_path / "run", IN_RUNGS)
    for identity, rung, steps in ((0, 0, 10), (1, 0, 20), (1, 1, 30), (1, 2, 40)):
        run.append(replace(candidate(identity), rung=rung, steps=steps))
    for found in (run, Run.open(run.path)):
        assert [found.evaluated_at(rung) for rung in range(4)] == [{0, 1}, {1}, {1}, set()]
        assert [found.on_record(1, rung).steps for rung in range(3)] == [20, 30, 40]
        assert found.on_record(0, 1) is found.on_record(2, 0) is None
        assert [found.steps_of(identity) for identity in range(3)] == [10, 40, 0]
        assert [(one.id, one.rung) for one in found.candidates] == [(0, 0), (1, 2)]


@pytest.mark.parametrize(
    ("identity", "rung", "reason"),
    [
        (0, 1, "rung = 1: must be at least 0 and below search.rungs = 1"),
        (0, 2, "candidate 0 is on rung 2, but the rung below is missing"),
        (1, 1, "candidate 1 is on rung 1, but the rung below is missing"),
    ],
)
def test_a_rung_that_cannot_be_is_damage(tmp_path, identity, rung, reason):
    run = Run.create(tmp_path / "run", CONFIG if "search.rungs = 1" in reason else IN_RUNGS)
    run.append(candidate(0))
    run.append(replace(candidate(identity), rung=rung))
    with pytest.raises(RunError, match=f"candidates.jsonl, line 2: is damaged: {re.escape(reason)}; --before-damage"):
        Run.open(run.path)


def test_a_genome_of_another_length_and_a_place_of_another_candidate_are_damage(run):
    for change, reason in (
        ({"genome": (*candidate(0).genome, 0.5)}, r"genome has \d+ values, \d+ genes are open"),
        ({"index": 1}, "candidate 0 can't be number 1 of generation 0 with a population of 4"),
    ):
        run.record.path.write_text(replace(candidate(0), **change).to_line())
        with pytest.raises(RunError, match=f"line 1: is damaged: {reason}"):
            Run.open(run.path)


def test_files_of_candidates(run):
    assert run.policy_path(12) == run.path / "policies" / "000012.safetensors"
    assert run.checkpoint_path(12, 3) == run.path / "trainings" / "000012-3.safetensors"
    (run.path / "trainings").mkdir()
    paths = {(identity, rung): run.checkpoint_path(identity, rung) for identity in (1, 2, 12) for rung in (0, 1)}
    for path in paths.values():
        path.touch()
    run.forget_trainings([2, 12, 99])
    assert [place for place, path in paths.items() if path.exists()] == [(1, 0), (1, 1)]


def test_a_run_of_a_former_format_is_read_but_not_continued(run):
    run.require_present_light()
    path = run.path / "config.toml"
    text = path.read_text()
    for number in (OLDEST_CONTINUED, OLDEST_CONTINUED - 1):
        path.write_text(re.sub(r"(?m)^format = \d+", f"format = {number}", text))
        assert f"format = {number}" in path.read_text()
        if number == OLDEST_CONTINUED:
            run.require_present_light()
            continue
        with pytest.raises(RunError, match=rf"has format {number}: must be {OLDEST_CONTINUED} to \d+ to be continued"):
            run.require_present_light()


def test_files_that_cannot_be_read_or_written_are_named(five, monkeypatch):
    def full(*_):
        raise OSError(errno.EIO, "Input/output error")

    for name, reason in (
        ("evolve.store.directory.sweep", r"jsonl: cannot be written: Input/output error"),
        ("evolve.store.directory.read", r"toml: cannot be read: Input/output error"),
        ("os.fsync", r"jsonl: cannot be written: Input/output error"),
    ):
        with monkeypatch.context() as patch:
            patch.setattr(name, full)
            with pytest.raises(RunError, match=reason):
                five.repair()
    five.record.path.unlink()
    with pytest.raises(RunError, match=r"candidates\.jsonl: was changed by another process; nothing is added"):
        five.append(candidate(5))
    with five.lock():
        (five.path / "lock").unlink()
        with pytest.raises(RunError, match=r"candidates\.jsonl: was changed by another process; nothing is added"):
            five.append(candidate(5))


def test_the_holder_of_a_lock(run, tmp_path):
    assert holder(tmp_path) is None
    assert holder(run.path) is None
    with run.lock():
        assert re.fullmatch(r"\d+ on \S.*", holder(run.path))
    assert holder(run.path) is None


@pytest.mark.parametrize("number", [1, 5, 6, 7])
def test_messages_about_many_files_name_five(tmp_path, number):
    candidates = [replace(candidate(identity), policy="0" * 64) for identity in range(number)]
    (tmp_path / "0").touch()
    assert lost(candidates[:1], lambda identity: tmp_path / str(identity)) is None
    names = ", ".join(map(str, range(min(number, 5)))) + ", ..." * (number > 5)
    (tmp_path / "0").unlink()
    said = lost([candidate(9), *candidates], lambda identity: tmp_path / str(identity))
    assert said.startswith(f"{tmp_path}: policies of {number} candidates are lost ({names}): restore")
    files = [tmp_path / f"{identity}.exr" for identity in range(number)]
    for path in files:
        path.write_bytes(b"right")
    list_checksums(tmp_path, files)
    assert harmed(tmp_path) is None
    for path in files:
        path.write_bytes(b"wrong")
    names = ", ".join(path.name for path in files[:5]) + ", ..." * (number > 5)
    assert harmed(tmp_path) == (
        f"{tmp_path}: {number} EXR files do not match their checksums ({names}): export them again"
    )


def test_checksums_of_too_much_data_or_of_unreadable_files_are_not_compared(tmp_path, monkeypatch):
    paths = [tmp_path / f"{name}.exr" for name in "abc"]
    for path in paths:
        path.write_bytes(bytes(100))
    list_checksums(tmp_path, paths)
    monkeypatch.setattr(checksums, "MOST_BYTES", 300)
    assert harmed(tmp_path) is None
    monkeypatch.setattr(checksums, "MOST_BYTES", 299)
    assert harmed(tmp_path) == f"{tmp_path}: EXR files have 300 bytes: checksums are compared only up to 299 bytes"
    paths[0].unlink()
    assert harmed(tmp_path) is None, "deleted files can be exported again"
    paths[0].mkdir()
    assert harmed(tmp_path).startswith(f"{paths[0]}: cannot be read: ") or "EXR files have" in harmed(tmp_path)
    monkeypatch.setattr(checksums, "MOST_BYTES", 2**32)
    assert harmed(tmp_path).startswith(f"{paths[0]}: cannot be read: is a directory")
    (tmp_path / LISTED).unlink()
    assert harmed(tmp_path) is None


@pytest.mark.parametrize(("number", "passes"), [(errno.EINVAL, True), (errno.ENOTSUP, True), (errno.EIO, False)])
def test_a_file_system_without_synchronised_folders_is_accepted(tmp_path, monkeypatch, number, passes):
    def sync(descriptor):
        raise OSError(number, "no")

    monkeypatch.setattr(regular_files.os, "fsync", sync)
    if passes:
        regular_files.sync_folder(tmp_path)
        return
    with pytest.raises(OSError, match="no") as caught:
        regular_files.sync_folder(tmp_path)
    assert caught.value.errno == number


def test_unknown_software_and_processors(monkeypatch):
    def missing(*_, **__):
        raise versions.metadata.PackageNotFoundError

    def nothing(*_, **__):
        raise OSError

    assert re.fullmatch(r"[0-9a-f]{40}\+?|", versions.present()["commit"])
    monkeypatch.setattr(versions.metadata, "version", missing)
    monkeypatch.setattr(versions.subprocess, "run", nothing)
    present = versions.present()
    assert set(present) == {"python", "machine", "commit", "device", *versions.PACKAGES}
    assert {present[name] for name in versions.PACKAGES} == {"not installed"}
    assert present["commit"] == ""
    monkeypatch.setattr(versions.Path, "read_text", nothing)
    monkeypatch.setattr(versions.platform, "processor", lambda: "")
    monkeypatch.setattr(versions.platform, "machine", lambda: "z80")
    monkeypatch.setattr(versions.os, "cpu_count", lambda: 3)
    assert versions.machine() == "z80, 3 cores"


def test_the_shipped_run_is_copied_once_and_only_where_nothing_else_is(tmp_path):
    path = tmp_path / "deep" / "demo"
    first = copy_shipped_run(path)
    times = {file: file.stat().st_mtime_ns for file in path.rglob("*") if file.is_file()}
    assert (path / "config.toml") in times
    assert first.best is not None
    lines = first.record.path.read_bytes()
    first.record.path.unlink()
    assert copy_shipped_run(path).record.path.read_bytes() == lines, "a missing file is copied again"
    times.pop(first.record.path)
    assert all(file.stat().st_mtime_ns == time for file, time in times.items())
    first.record.path.write_bytes(lines.replace(b"0", b"1", 1))
    (tmp_path / "empty").mkdir()
    assert copy_shipped_run(tmp_path / "empty").best == first.best
    (tmp_path / "thesis.tex").touch()
    for place in (path, tmp_path):
        with pytest.raises(RunError, match=f"^{place} contains other files: choose another directory with --out$"):
            copy_shipped_run(place)


def test_former_names_of_a_candidates_fields_still_work():
    with pytest.warns(FutureWarning, match="the old name will be removed"):
        assert candidate(0).mishaps == ()
    with pytest.warns(FutureWarning, match="the old name will be removed"):
        assert Candidate.of is not None


def test_all_kinds_of_damage_are_in_one_line(run, monkeypatch):
    assert run.notice is None
    for name in ("lost", "config_change", "harmed"):
        monkeypatch.setattr(directory, name, lambda *_, name=name: f"{name}!" if name != "lost" else None)
    run.record.notice = "torn!"
    assert run.notice == "torn!; config_change!; harmed!"


def test_starts_of_a_run(tmp_path, monkeypatch):
    """Commits are listed once, without unknown ones; a run comes from the animal of its first start."""
    known = [{"commit": "b"}, {"commit": ""}, {}, {"commit": "a"}, {"commit": "b"}]
    starts = [{"versions": one, **({"from": f"runs/a:{k}"} if k else {})} for k, one in enumerate(known)]
    monkeypatch.setattr(versions, "_starts", lambda run: starts)
    assert versions.commits(tmp_path) == ["b", "a"]
    assert versions.origin(tmp_path) is None
    assert versions.recorded(tmp_path) == {"commit": "b"}
    starts.pop(0)
    assert versions.origin(tmp_path) == "runs/a:1"
    starts.clear()
    assert (versions.commits(tmp_path), versions.origin(tmp_path), versions.recorded(tmp_path)) == ([], None, {})
