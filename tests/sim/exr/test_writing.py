"""EXR files on the disk: a write that fails leaves the old file, and no link leads elsewhere."""

import os

import pytest

from sim.exr.files import read_exr, write_exr
from sim.exr.view import View
from tests.sim.exr.test_files import NM, views


def test_link_that_waits_under_the_temporary_name_leads_nowhere(tmp_path):
    victim = tmp_path / "thesis.tex"
    victim.write_text("all of it")
    (tmp_path / f".a.exr.{os.getpid()}.tmp").symlink_to(victim)
    write_exr(tmp_path / "a.exr", views())
    assert victim.read_text() == "all of it"
    assert len(read_exr(tmp_path / "a.exr")) == 3


def test_a_failed_write_leaves_the_old_file_alone(tmp_path):
    write_exr(tmp_path / "a.exr", views())
    before = (tmp_path / "a.exr").read_bytes()
    with pytest.raises(ValueError, match="attributes"):
        write_exr(tmp_path / "a.exr", [View("left", NM, views()[0].radiance, attributes={"x": object()})])
    assert (tmp_path / "a.exr").read_bytes() == before
    assert len(list(tmp_path.iterdir())) == 1


def test_files_may_be_read_by_whoever_may_read_others(tmp_path):
    write_exr(tmp_path / "a.exr", views())
    (tmp_path / "plain").touch()
    assert (tmp_path / "a.exr").stat().st_mode == (tmp_path / "plain").stat().st_mode


def test_a_picture_is_on_the_disk_before_it_has_its_name(tmp_path, monkeypatch):
    """Otherwise a crash of the machine could leave a name with an incomplete image."""
    steps, sync, replace = [], os.fsync, os.replace
    monkeypatch.setattr(os, "fsync", lambda file: (steps.append(("sync", os.fstat(file).st_size)), sync(file)))
    monkeypatch.setattr(
        os, "replace", lambda old, new: (steps.append(("name", os.stat(old).st_size)), replace(old, new))
    )
    write_exr(tmp_path / "a.exr", views())
    size = (tmp_path / "a.exr").stat().st_size
    assert steps == [("sync", size), ("name", size)]


def test_a_disk_that_is_full_leaves_the_old_picture_and_nothing_else(tmp_path, monkeypatch):
    write_exr(tmp_path / "a.exr", views())
    before = (tmp_path / "a.exr").read_bytes()

    def full(file):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space left"):
        write_exr(tmp_path / "a.exr", views(seed=1))
    assert [path.name for path in tmp_path.iterdir()] == ["a.exr"]
    assert (tmp_path / "a.exr").read_bytes() == before
