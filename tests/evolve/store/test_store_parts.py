"""Parts of stored runs: locks, versions, messages and files, with stand-ins for the system."""

import errno
import fcntl
import json
import math
import os
import subprocess
import time
from collections import Counter
from types import SimpleNamespace

import pytest

from evolve.store import lock, regular_files, versions
from evolve.store.evaluation import Evaluation, most_frequent, shortened, total_episode_failures
from evolve.store.lock import LockedError, RunLock, holder
from evolve.store.regular_files import created, folders, opened, sync_folder

# --- locks


def test_a_lock_is_awaited_for_half_a_second(tmp_path, monkeypatch):
    """`holder` in another process takes the lock for an instant. A refusal closes the file."""
    now, slept, files = 1000.0, [], []

    def sleep(seconds):
        nonlocal now
        slept.append(seconds)
        now += 0.125

    monkeypatch.setattr(time, "monotonic", lambda: now)
    monkeypatch.setattr(time, "sleep", sleep)
    monkeypatch.setattr(lock, "_taken", lambda file, kind: files.append(file) or kind != fcntl.LOCK_EX)
    (tmp_path / "lock").write_text("12 on there\n")
    with pytest.raises(LockedError, match=rf"^{tmp_path} is in use by process 12 on there; wait for it or stop it$"):
        RunLock(tmp_path).__enter__()
    assert slept == [0.05] * 5
    assert files[0].closed
    assert holder(tmp_path) is None, "the lock is free for readers here"
    monkeypatch.setattr(lock, "_taken", lambda file, kind: kind == fcntl.LOCK_EX)
    (tmp_path / "lock").write_text("x" * 500)
    assert holder(tmp_path) == "x" * 400
    (tmp_path / "lock").write_text(" \n")
    assert holder(tmp_path) == "unknown"


def test_a_lock_file_names_its_process_until_the_end(tmp_path):
    (tmp_path / "lock").write_text("a longer text of a process that was killed, and of its machine\n")
    own = RunLock(tmp_path)
    assert not own.stands
    with own:
        assert (tmp_path / "lock").read_text() == f"{os.getpid()} on {os.uname().nodename}\n"
        assert own.stands
        (tmp_path / "lock").unlink()
        assert not own.stands
        (tmp_path / "lock").touch()
        assert not own.stands
    assert not own.stands
    own.__exit__(None, None, None)
    with RunLock(tmp_path):
        pass
    assert (tmp_path / "lock").read_text() == ""


def test_a_directory_that_cannot_be_locked(tmp_path):
    (tmp_path / "lock").mkdir()
    with pytest.raises(LockedError, match=r"cannot be written: lock is a directory: must be a regular file"):
        RunLock(tmp_path).__enter__()
    with pytest.raises(LockedError, match=r"none cannot be written: No such file or directory"):
        RunLock(tmp_path / "none").__enter__()


# --- versions


def start(**changes):
    return {"versions": {"commit": "c", "machine": "x86_64", "numpy": "1"}, "processor": "P, 2 cores", **changes}


def written(folder, *starts):
    (folder / "versions.json").write_text(json.dumps(starts))
    return folder


def test_records_of_starts(tmp_path):
    assert (versions.recorded(tmp_path), versions.run_id(tmp_path), versions.origin(tmp_path)) == ({}, "", None)
    first = start(**{"from": "runs/a:3"})
    unknown = {"versions": {"numpy": "2"}}
    run = written(tmp_path, first, start(versions={"commit": "d"}), start(), unknown, {"versions": {"machine": "arm"}})
    assert versions.recorded(run) == first["versions"]
    assert versions.commits(run) == ["c", "d"]
    assert versions.machines(run) == [
        "P, 2 cores", "a machine, processor not recorded", "arm, processor not recorded"
    ]  # fmt: skip
    assert versions.origin(run) == "runs/a:3"
    assert versions.origin(written(tmp_path, start(), first)) is None
    assert versions.recorded(written(tmp_path, {"versions": "x"}, start()))["numpy"] == "1"
    for text in ("[", "7", '[{"a": 1}]', "[" * 100_000):
        (tmp_path / "versions.json").write_text(text)
        assert versions.recorded(tmp_path) == {}


def test_an_id_of_a_run_depends_on_its_first_start_alone(tmp_path):
    """The order of entries does not matter. Ids are in exported files, so they must not change."""
    run_id = versions.run_id(written(tmp_path, {"b": 1, "versions": {}, "a": 2}, start()))
    assert versions.run_id(written(tmp_path, {"a": 2, "b": 1, "versions": {}})) == run_id
    assert run_id == "42b1546e6f73a807"


def test_fingerprints_ignore_comments_workers_and_generations():
    text = "task = 1\n\n# a comment\nworkers = 3\ngenerations = 4\n  sigma = 2  \n"
    assert versions.fingerprint(text) == versions.fingerprint("task = 1\nworkers = 9\nsigma = 2")
    assert versions.fingerprint(text) != versions.fingerprint("task = 1\nsigma = 3")
    assert versions.fingerprint("task = 1") == "a7dca8f02a6b99e1"


def test_a_config_is_compared_with_the_last_start(tmp_path):
    (tmp_path / "config.toml").write_text("task = 1\n")
    now = {"settings": versions.fingerprint("task = 1\n")}
    written(tmp_path, start(settings="other"), start(**now))
    assert versions.config_change(tmp_path, 3) is None, "former versions recorded no checksum"
    written(tmp_path, start(**now), start(settings="other"))
    assert "Candidates from 3 on are trained" in versions.config_change(tmp_path, 3)
    written(tmp_path, start(**now, config="other"))
    assert versions.config_change(tmp_path, 3).endswith("but only in comments, workers or generations")


def test_a_start_is_added_to_the_record(tmp_path, monkeypatch):
    monkeypatch.setattr(versions, "present", lambda: {"numpy": "2"})
    monkeypatch.setattr(versions, "machine", lambda: "P, 2 cores")
    versions.record_start(tmp_path, 0, "runs/a:3", b"task = 1\n")
    (tmp_path / "config.toml").write_text("task = 2\n")
    versions.record_start(tmp_path, 5)
    first, second = json.loads((tmp_path / "versions.json").read_text())
    assert [one["candidates"] for one in (first, second)] == [0, 5]
    assert first["settings"] == versions.fingerprint("task = 1")
    assert second["settings"] == versions.fingerprint("task = 2")
    assert (first["from"], "from" in second) == ("runs/a:3", False)
    assert (tmp_path / "versions.json").read_text().startswith("[\n {\n  ")


@pytest.mark.parametrize(("codes", "commit"), [((0, 0), "abc+"), ((128, 0), ""), ((0, 1), ""), (None, "")])
def test_a_commit_belongs_to_a_checkout_that_tracks_this_code(monkeypatch, codes, commit):
    """git prints nothing here, and failures of git are no errors."""
    asked = []

    def run(command, **options):
        if codes is None:
            raise FileNotFoundError
        asked.append((command[3], options))
        return SimpleNamespace(returncode=codes[len(asked) - 1], stdout="abc+\n")

    monkeypatch.setattr(subprocess, "run", run)
    assert versions._commit() == commit
    for command, options in asked:
        assert options["capture_output"]
        assert not options["check"]
        assert options["timeout"] == 10
        assert options.get("text", False) == (command == "describe")


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("processor\t: 0\nmodel name\t: CPU A: 3 GHz \nmodel name\t: B\n", "CPU A: 3 GHz"),
        ("flags: x\n", "arch"),
        (None, "arch"),
    ],
)
def test_names_of_processors(monkeypatch, text, name):
    def read_text():
        if text is None:
            raise FileNotFoundError
        return text

    monkeypatch.setattr(versions, "Path", lambda path: {"/proc/cpuinfo": SimpleNamespace(read_text=read_text)}[path])
    monkeypatch.setattr(versions.platform, "processor", lambda: "")
    monkeypatch.setattr(versions.platform, "machine", lambda: "arch")
    assert versions._processor() == name
    monkeypatch.setattr(versions.platform, "processor", lambda: "known")
    assert versions._processor() == (name if name != "arch" else "known")


# --- outcomes


def test_a_failed_evaluation_has_no_results():
    found = Evaluation.failed("it\n fell \udc80")
    assert found == Evaluation(-math.inf, (), 0.0, 0, 0.0, (), "it fell \\udc80", ())
    assert Evaluation.failed("x", 2.5).seconds == 2.5
    assert Evaluation(1.0) == Evaluation(1.0, (), 0.0, 0, 0.0, (), None, ())


def test_long_messages_are_shortened_in_the_middle():
    assert shortened("x" * 1000) == "x" * 1000
    text = "a" * 700 + "b" * 700
    assert shortened(text) == "a" * 496 + " [...] " + "b" * 496


def test_four_kinds_of_failures_are_named():
    """Equally frequent failures are named in alphabetical order."""
    counts = Counter({"e": 1, "d": 1, "c": 5, "b": 2, "a\n x": 2, "others": 7})
    assert most_frequent(counts) == (("c", 5), ("a x", 2), ("b", 2), ("d", 1), ("others", 8))
    assert most_frequent(Counter({"b": 1, "a": 1})) == (("a", 1), ("b", 1))
    assert most_frequent(Counter({"x" * 301: 1, "x" * 300: 2})) == (("x" * 300, 3),)
    assert total_episode_failures((("a", 1), ("b", 2)), (("a", 3),)) == (("a", 4), ("b", 2))


# --- files


def test_new_files_can_be_read_by_everybody_and_written_by_their_owner(tmp_path):
    before = os.umask(0)
    try:
        opened(tmp_path / "a", "ab", create=True).close()
        created(tmp_path / "b").close()
    finally:
        os.umask(before)
    assert {(tmp_path / name).stat().st_mode & 0o777 for name in "ab"} == {0o644}
    with pytest.raises(FileNotFoundError):
        opened(tmp_path / "c", "ab")


@pytest.mark.parametrize("number", [errno.EINVAL, errno.ENOTSUP, errno.EIO])
def test_folders_are_synchronised_if_the_system_can(tmp_path, monkeypatch, number):
    """A descriptor is closed after an error, too."""
    closed = []

    def fail(descriptor):
        raise OSError(number, "no")

    monkeypatch.setattr(regular_files.os, "fsync", fail)
    monkeypatch.setattr(regular_files.os, "close", closed.append)
    if number == errno.EIO:
        with pytest.raises(OSError, match="no"):
            sync_folder(tmp_path)
    else:
        sync_folder(tmp_path)
    (descriptor,) = closed
    monkeypatch.undo()
    os.close(descriptor)


def test_the_parents_of_new_folders_are_synchronised(tmp_path, monkeypatch):
    synchronised = []
    monkeypatch.setattr(regular_files, "sync_folder", synchronised.append)
    folders(tmp_path / "a" / "b")
    assert synchronised == [tmp_path / "a", tmp_path]
    folders(tmp_path / "a" / "b")
    with pytest.raises(FileExistsError):
        folders(tmp_path / "a" / "b", exist_ok=False)
    assert len(synchronised) == 2
