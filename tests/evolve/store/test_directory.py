"""Run directories: created once, named in errors if they cannot be used, and repaired after a crash."""

import errno
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from evolve.config.run_config import ConfigError
from evolve.store.directory import Run, RunError, next_directory
from evolve.store.lock import LockedError
from evolve.store.regular_files import folders
from evolve.store.versions import origin, record_start
from tests.evolve.closed_form import tiny
from tests.evolve.store.records import CONFIG, NOBODY, candidate


def test_best_is_the_earliest_of_the_fittest(run):
    assert run.best is None
    for identity, fitness in ((3, 2.0), (1, 2.0), (0, 1.0)):
        run.append(candidate(identity, fitness))
    assert run.best.id == 1


def test_directory_with_something_in_it_is_refused(tmp_path):
    (tmp_path / "thesis.tex").write_text("all of it")
    with pytest.raises(RunError, match=r"is not empty: choose another name, or continue it with: evolve resume"):
        Run.create(tmp_path, CONFIG)
    assert [entry.name for entry in tmp_path.iterdir()] == ["thesis.tex"]


def test_two_that_create_at_once_do_not_mix(tmp_path, monkeypatch):
    """The second process starts between the first one's check of the directory and its config."""

    def meanwhile(*arguments):
        with pytest.raises(LockedError, match=f"in use by process {os.getpid()}"):
            Run.create(tmp_path / "run", tiny("seed=2"))
        record_start(*arguments)

    monkeypatch.setattr("evolve.store.directory.record_start", meanwhile)
    Run.create(tmp_path / "run", CONFIG)
    assert Run.open(tmp_path / "run").config == CONFIG


def test_file_in_the_way_and_unwritable_place_are_named(tmp_path):
    (tmp_path / "file").write_text("")
    for path in (tmp_path / "file", tmp_path / "file" / "run", "/proc/run"):
        with pytest.raises(RunError, match="cannot be written: "):
            Run.create(path, CONFIG)


@pytest.mark.parametrize("given", [True, False])
def test_the_names_of_new_directories_survive_a_power_failure(tmp_path, monkeypatch, given):
    """The folders that contain them are synchronised before the first file is written."""
    monkeypatch.chdir(tmp_path)
    synced, sync = [], os.fsync

    def fsync(descriptor):
        synced.append(Path(os.readlink(f"/proc/self/fd/{descriptor}")))
        sync(descriptor)

    monkeypatch.setattr(os, "fsync", fsync)
    run = Run.create(Path("runs/deep/run"), CONFIG) if given else Run.create_next(CONFIG, "quick")
    containing = [*run.path.absolute().parents][: 3 if given else 2]
    assert containing[-1] == tmp_path
    assert synced[: len(containing)] == containing
    synced.clear()
    (tmp_path / "made").mkdir()
    Run.create(tmp_path / "made", CONFIG)
    assert tmp_path not in synced


def test_a_folder_that_may_not_be_read_is_no_obstacle(tmp_path, monkeypatch):
    """It cannot be synchronised."""

    def refused(path):
        raise PermissionError(errno.EACCES, "Permission denied", str(path))

    monkeypatch.setattr("evolve.store.regular_files.sync_folder", refused)
    folders(tmp_path / "a" / "b")
    assert (tmp_path / "a" / "b").is_dir()
    with pytest.raises(FileExistsError):
        folders(tmp_path / "a" / "b", exist_ok=False)


def test_what_is_no_run_is_named(tmp_path):
    with pytest.raises(RunError, match="there is no such directory"):
        Run.open(tmp_path / "absent")
    with pytest.raises(RunError, match=r"it contains no config\.toml"):
        Run.open(tmp_path)


def test_damaged_config_is_named(run):
    (run.path / "config.toml").write_text("task = 'detection'\n[serch]\n")
    with pytest.raises(ConfigError, match=r"config\.toml, line 2: unknown key 'serch'"):
        Run.open(run.path)
    (run.path / "candidates.jsonl").unlink()
    (run.path / "config.toml").write_text("task = 'detection'\n")
    with pytest.raises(RunError, match=r"candidates\.jsonl: cannot be read"):
        Run.open(run.path)


def test_default_directory_is_the_first_that_is_free(tmp_path):
    assert next_directory("detection", "quick", tmp_path).name == "detection-quick-1"
    (tmp_path / "detection-quick-1").mkdir()
    (tmp_path / "detection-quick-3").mkdir()
    assert next_directory("detection", "quick", tmp_path).name == "detection-quick-2"


def test_two_that_begin_at_once_have_a_directory_each(tmp_path, monkeypatch):
    """Both processes have chosen the same name before either has created the directory."""
    monkeypatch.chdir(tmp_path)
    chosen = iter([Path("runs/detection-quick-1"), Path("runs/detection-quick-1"), Path("runs/detection-quick-2")])
    monkeypatch.setattr("evolve.store.directory.next_directory", lambda *_: next(chosen))
    made = [Run.create_next(tiny(f"seed={seed}"), "quick") for seed in (1, 2)]
    assert [run.path.as_posix() for run in made] == ["runs/detection-quick-1", "runs/detection-quick-2"]
    assert [Run.open(run.path).config.seed for run in made] == [1, 2]


def test_where_no_run_can_be_written_one_directory_is_tried(tmp_path, monkeypatch):
    """One example is a file system without locks."""

    def none(*_):
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("fcntl.flock", none)
    with pytest.raises(RunError, match="detection-quick-1 cannot be written: No locks available"):
        Run.create_next(CONFIG, "quick")
    assert len(list((tmp_path / "runs").iterdir())) == 1
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    (tmp_path / "elsewhere" / "runs").touch()
    with pytest.raises(RunError, match="runs/detection-quick-1 cannot be written: Not a directory"):
        Run.create_next(CONFIG, "quick")


@pytest.mark.parametrize("link", ["runs", "runs/detection-quick-1"])
def test_a_link_to_nowhere_is_named_and_not_tried_for_ever(tmp_path, monkeypatch, link):
    monkeypatch.chdir(tmp_path)
    Path(link).parent.mkdir(exist_ok=True)
    Path(link).symlink_to("nowhere")
    with pytest.raises(RunError, match=f"{link} cannot be written: File exists"):
        Run.create_next(CONFIG, "quick")


def test_a_config_that_changed_since_the_run_was_opened_is_not_overlooked(run):
    path = run.path / "config.toml"
    path.write_text(path.read_text().replace("total_steps = 4096", "total_steps = 8192"))
    with pytest.raises(RunError, match=r"config\.toml has changed since the run was opened; open it again"):
        run.repair()
    Run.open(run.path).repair()


def test_a_run_that_is_begun_again_comes_from_where_this_attempt_says(tmp_path):
    record_start(tmp_path, 0, "runs/a:3", b"")  # the process was then killed
    Run.create(tmp_path, CONFIG)
    assert origin(tmp_path) is None


def test_run_killed_while_it_is_created_can_be_begun_again(tmp_path):
    """config.toml is written last; before that, the directory has no data to lose."""
    for left in ((), ("versions.json",), ("versions.json", "candidates.jsonl", f".config.toml.{NOBODY}.unfinished")):
        path = tmp_path / str(len(left))
        (path / "policies").mkdir(parents=True)
        for name in left:
            (path / name).touch()
        assert Run.create(path, CONFIG).candidates == ()
        assert Run.open(path).config == CONFIG
    (tmp_path / "other" / "policies").mkdir(parents=True)
    (tmp_path / "other" / "policies" / "mine").touch()
    with pytest.raises(RunError, match="is not empty"):
        Run.create(tmp_path / "other", CONFIG)


def test_repair_removes_what_was_half_written(run):
    for folder in (run.path, run.path / "policies"):
        (folder / f".000001.{NOBODY}.unfinished").touch()
    run.repair()
    assert not list(run.path.rglob("*.unfinished"))
    assert (run.path / "config.toml").exists()


def test_read_only_directory_is_named_and_can_still_be_read(tmp_path):
    """The test runs in a separate process that drops root's rights if necessary, because root may write anywhere."""
    run = Run.create(tmp_path / "run", CONFIG)
    run.append(candidate(0))
    kept = (run.path / "candidates.jsonl").read_bytes()
    script = (
        "import os, sys\n"
        "sys.path[:0] = sys.argv[2:]\n"
        "from evolve.store.directory import Run\n"
        "from tests.evolve.store.records import candidate\n"
        "new = candidate(1)\n"
        "Run.open(sys.argv[1])\n"
        "os.setuid(65534) if os.geteuid() == 0 else None\n"
        "run = Run.open(sys.argv[1])\n"
        "print([c.id for c in run.candidates])\n"
        "for change in (lambda: run.append(new), lambda: run.lock().__enter__(), run.repair):\n"
        "    try:\n"
        "        change()\n"
        "    except Exception as error:\n"
        "        print(f'{type(error).__name__}: {error}')\n"
    )
    # all directories that pytest created, however deeply its workers nest them
    for place in (tmp_path, *tmp_path.parents):
        if "pytest" in str(place):
            place.chmod(0o755)
    run.path.chmod(0o555)
    for file in run.path.iterdir():
        file.chmod(0o555 if file.is_dir() else 0o444)
    command = [sys.executable, "-c", script, str(run.path), str(Path(__file__).parents[3])]
    child = subprocess.run(command, capture_output=True, text=True, check=False)
    lines = child.stdout.splitlines()
    assert lines[0] == "[0]", child.stderr
    assert len(lines) == 4
    assert all("cannot be written: Permission denied" in line for line in lines[1:]), lines
    assert (run.path / "candidates.jsonl").read_bytes() == kept


def test_steps_are_those_of_the_candidate_and_its_furthest_stage(run):
    run.append(replace(candidate(0), steps=100))
    run.append(replace(candidate(1), steps=900))
    run.append(replace(candidate(0), rung=1, steps=300))

    class Asked(dict):
        """Lines of a record that must not be scanned, because there may be thousands, and the progress display requests
        the steps of a candidate after every rollout.
        """

        def values(self):
            raise AssertionError("all lines were scanned")

    run.record.lines = Asked(run.record.lines)
    assert [run.steps_of(identity) for identity in (0, 1, 2)] == [300, 900, 0]


@pytest.mark.parametrize("name", ["policies", "trainings", "exr"])
def test_a_file_in_a_folders_place_is_named_before_anything_is_read(run, name):
    if (run.path / name).exists():
        (run.path / name).rmdir()
    (run.path / name).write_text("no folder")
    with pytest.raises((RunError, OSError), match="must be a directory") as caught:
        Run.open(run.path)
    assert name in str(caught.value)
