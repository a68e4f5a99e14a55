"""A run from a stranger: whatever the files in it are, no file outside the run is read or written, and no command
waits.
"""

import os
import socket
import stat

import pytest

from evolve.store.atomic_files import write_whole
from evolve.store.directory import Run, RunError
from evolve.store.lock import LockedError, RunLock, holder
from evolve.store.regular_files import StrangeFileError, created, folder, opened, read
from tests.evolve.closed_form import tiny
from tests.evolve.store.records import CONFIG, candidate

SECRET = b"the only copy\n"
KINDS = {
    "link": "a symbolic link",
    "dangling link": "a symbolic link",
    "FIFO": "a FIFO",
    "socket": "a socket",
    "directory": "a directory",
}


@pytest.fixture
def victim(tmp_path):
    path = tmp_path / "thesis.tex"
    path.write_bytes(SECRET)
    return path


def put(kind, path, victim):
    """Put a link, FIFO, socket or similar under a file's name."""
    path.unlink(missing_ok=True)
    if kind == "link":
        path.symlink_to(victim)
    elif kind == "dangling link":
        path.symlink_to(victim.with_name("absent"))
    elif kind == "FIFO":
        os.mkfifo(path)
    elif kind == "socket":
        with socket.socket(socket.AF_UNIX) as one:
            one.bind(os.path.relpath(path))  # absolute paths are too long for a socket's name
    else:
        path.mkdir()


@pytest.mark.parametrize("kind", KINDS)
def test_door_opens_regular_files_only(tmp_path, victim, kind):
    path = tmp_path / "file"
    put(kind, path, victim)
    for use in (
        read,
        lambda p: opened(p, "r+b"),
        lambda p: opened(p, "ab", create=True),
        lambda p: write_whole(p, b""),
    ):
        with pytest.raises(StrangeFileError, match=f"is {KINDS[kind]}: must be a regular file") as error:
            use(path)
        assert error.value.filename == str(path)
    assert victim.read_bytes() == SECRET
    assert not victim.with_name("absent").exists()


def test_devices_are_refused(tmp_path):
    for path in ("/dev/null", "/dev/zero"):
        with pytest.raises(StrangeFileError, match="is a device"):
            read(tmp_path / path)


def test_what_is_looked_at_is_what_was_opened(tmp_path, victim, monkeypatch):
    """A link that is created between the check of a name and its opening is not followed either."""
    path = tmp_path / "file"
    monkeypatch.setattr("evolve.store.regular_files.require_regular", lambda path: put("link", path, victim))
    with pytest.raises(OSError, match="symbolic links"):
        opened(path, "r+b", create=True)
    monkeypatch.setattr("evolve.store.regular_files.require_regular", lambda path: None)
    put("FIFO", path, victim)
    with pytest.raises(StrangeFileError, match="is a FIFO"):
        read(path)


def test_file_with_two_names_is_read_but_not_changed(tmp_path, victim):
    os.link(victim, tmp_path / "lock")
    assert read(tmp_path / "lock") == SECRET
    with pytest.raises(LockedError, match=r"lock has 2 names \(hard links\)"), RunLock(tmp_path):
        pass
    assert victim.read_bytes() == SECRET


def test_new_file_takes_the_place_of_a_link_and_leaves_its_target(tmp_path, victim):
    (tmp_path / "link").symlink_to(victim)
    with created(tmp_path / "link") as file:
        file.write(b"mine")
    assert victim.read_bytes() == SECRET
    assert (tmp_path / "link").read_bytes() == b"mine"


def test_folder_that_is_a_link_is_refused(tmp_path):
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "policies").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(StrangeFileError, match="is a symbolic link: must be a directory"):
        folder(tmp_path / "policies")
    assert folder(tmp_path / "new").is_dir()
    with pytest.raises(FileNotFoundError):
        folder(tmp_path / "absent" / "new")


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", ["config.toml", "versions.json", "candidates.jsonl", "lock"])
def test_run_with_something_strange_in_it_is_refused_by_name(run, victim, kind, name):
    run.append(candidate(0))
    put(kind, run.path / name, victim)
    with pytest.raises(StrangeFileError, match=KINDS[kind]) as error:
        Run.open(run.path)
    assert error.value.filename == str(run.path / name)
    assert victim.read_bytes() == SECRET


@pytest.mark.parametrize("name", ["policies", "trainings", "exr", "tensorboard"])
def test_run_whose_folder_leads_elsewhere_is_refused_by_name(run, tmp_path, name):
    (tmp_path / "elsewhere").mkdir()
    if (run.path / name).exists():
        (run.path / name).rmdir()
    (run.path / name).symlink_to(tmp_path / "elsewhere")
    with pytest.raises(StrangeFileError, match="must be a directory") as error:
        Run.open(run.path)
    assert error.value.filename == str(run.path / name)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", ["lock", "candidates.jsonl", "versions.json"])
def test_nothing_is_created_over_something_strange(tmp_path, victim, kind, name):
    (tmp_path / "run").mkdir()
    put(kind, tmp_path / "run" / name, victim)
    with pytest.raises(RunError, match=f"{name} cannot be written: is {KINDS[kind]}"):
        Run.create(tmp_path / "run", CONFIG)
    assert victim.read_bytes() == SECRET
    assert [entry.name for entry in (tmp_path / "run").iterdir()] == [name]


def test_somebodys_own_file_called_lock_is_not_emptied(tmp_path):
    (tmp_path / "lock").write_text("package = 1\n" * 100)
    with pytest.raises(RunError, match="is not empty"):
        Run.create(tmp_path, CONFIG)
    assert (tmp_path / "lock").stat().st_size == 1200


def test_record_that_becomes_a_link_gets_no_line(run, victim):
    (run.path / "candidates.jsonl").unlink()
    (run.path / "candidates.jsonl").symlink_to(victim)
    for change in (lambda: run.append(candidate(0)), run.repair):
        with pytest.raises(RunError, match="is a symbolic link"):
            change()
    with pytest.raises(StrangeFileError, match="is a symbolic link"):
        Run.open(run.path)
    assert victim.read_bytes() == SECRET


def test_links_that_wait_for_a_writers_next_file_lead_nowhere(run, victim):
    """The name of a temporary file can be guessed. A link that was put there has no effect."""
    waiting = run.path / f".report.html.{os.getpid()}.unfinished"
    waiting.symlink_to(victim)
    write_whole(run.path / "report.html", b"page")
    assert (run.path / "report.html").read_bytes() == b"page"
    assert victim.read_bytes() == SECRET
    assert not waiting.is_symlink()


def test_fifo_as_lock_keeps_nobody_waiting(tmp_path):
    os.mkfifo(tmp_path / "lock")
    with pytest.raises(StrangeFileError, match="is a FIFO"):
        holder(tmp_path)


def test_lock_of_a_run_that_was_begun_anew_stands_no_more(tmp_path):
    run = Run.create(tmp_path / "run", tiny())
    with run.lock() as lock:
        assert lock.stands
        (run.path / "lock").unlink()
        assert not lock.stands
        with pytest.raises(RunError, match="was changed by another process"):
            run.append(candidate(0))
        (run.path / "lock").touch()
        assert not lock.stands
    assert not lock.stands


def test_new_files_are_for_others_to_read(tmp_path):
    write_whole(tmp_path / "file", b"")
    assert stat.S_IMODE((tmp_path / "file").stat().st_mode) == 0o644
