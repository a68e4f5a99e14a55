"""Files are written completely or not at all, and the remains of a killed writer are removed."""

import os
import stat
from pathlib import Path

import pytest

from evolve.store.atomic_files import UNFINISHED, sweep, unfinished, write_whole
from evolve.store.regular_files import StrangeFileError
from tests.evolve.store.records import NOBODY


def test_a_writer_that_fails_leaves_the_old_file_and_nothing_else(tmp_path, monkeypatch):
    path = tmp_path / "policies" / "file"
    write_whole(path, b"old")

    def full(descriptor):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space left") as caught:
        write_whole(path, b"new, and longer")
    assert caught.value.filename == str(path), "the error must not name the temporary file"
    assert path.read_bytes() == b"old"
    assert list(path.parent.iterdir()) == [path]


def test_an_error_that_has_a_message_alone_keeps_it(tmp_path):
    """Libraries that write images raise such errors."""
    with pytest.raises(OSError, match="no room for a picture") as caught, unfinished(tmp_path / "file"):
        raise OSError("no room for a picture")
    assert (caught.value.strerror, caught.value.filename) == ("no room for a picture", str(tmp_path / "file"))
    assert list(tmp_path.iterdir()) == []


def test_only_folders_of_a_run_that_is_there_are_made(tmp_path):
    for path in (tmp_path / "run" / "report.html", tmp_path / "run" / "policies" / "0"):
        with pytest.raises(FileNotFoundError):
            write_whole(path, b"content")
    assert list(tmp_path.iterdir()) == []
    for folder in ("policies", "trainings"):
        write_whole(tmp_path / folder / "0", b"content")


def test_what_killed_writers_left_is_swept_up(tmp_path):
    """Temporary files of a living process stay, such as a video that is not part of the run's files."""
    write_whole(tmp_path / "file", b"whole")
    living = f".film.mp4.{os.getppid()}{UNFINISHED}"
    for name in (f".file.{NOBODY}{UNFINISHED}", f".file.{os.getpid()}{UNFINISHED}", f".file{UNFINISHED}", living):
        (tmp_path / name).touch()
    sweep(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {"file", living}


@pytest.mark.parametrize("path", [".", "/", ".."])
def test_a_directory_is_no_name_for_a_file(path):
    with pytest.raises(StrangeFileError, match="is a directory: must be a regular file"):
        write_whole(Path(path), b"")


def test_content_is_on_the_disk_before_the_name_and_the_name_before_anybody_is_told(tmp_path, monkeypatch):
    """The old file or the complete new one remains if the machine fails between any two of these steps."""
    steps, sync, named = [], os.fsync, Path.replace

    def synced(descriptor):
        found = os.fstat(descriptor)
        steps.append("folder" if stat.S_ISDIR(found.st_mode) else f"{found.st_size} bytes")
        sync(descriptor)

    monkeypatch.setattr(os, "fsync", synced)
    monkeypatch.setattr(Path, "replace", lambda path, target: (steps.append("name"), named(path, target)))
    write_whole(tmp_path / "file", b"whole")
    assert steps == ["5 bytes", "name", "folder"]


def test_a_link_is_no_name_for_a_file(tmp_path):
    """The content would replace the link, or change the file to which it leads."""
    (tmp_path / "file").write_bytes(b"old")
    (tmp_path / "link").symlink_to("file")
    with pytest.raises(OSError, match="is a symbolic link: must be a regular file"):
        write_whole(tmp_path / "link", b"new")
    assert (tmp_path / "file").read_bytes() == b"old"
    write_whole(tmp_path / "file", b"new")
    assert (tmp_path / "file").read_bytes() == b"new"
