"""`evolve report`, `replay` and `export` write to the given paths, print the requested output, and open a browser;
`resume` of a finished run has no effect.
"""

import io
import json
import shutil
from pathlib import Path

import pytest

from evolve.cli import waiting
from evolve.cli.commands import products
from evolve.report.replay import write_page
from evolve.report.write import write as write_report
from evolve.store.directory import Run


@pytest.fixture
def browser(monkeypatch):
    opened = []
    monkeypatch.setattr(products.webbrowser, "open", opened.append)
    return opened


def test_replay_elsewhere_as_json_in_a_browser(call, run, browser, tmp_path):
    before = set(run.path.rglob("*"))
    page = tmp_path / "new" / "page.html"
    code, out, err = call("replay", run.path, "--seed", 3, "--json", "--open", "--out", page)
    assert (code, err) == (0, "")
    found = json.loads(out)
    assert found["files"] == [str(page)]
    assert found["actions"] == 256
    assert sum(found["terms"].values()) == pytest.approx(found["return"], abs=1e-3)
    assert browser == [page.as_uri()]
    assert page.read_text().startswith("<!doctype html>")
    assert set(run.path.rglob("*")) == before


def test_names_that_no_page_can_have_are_refused_before_an_episode_is_played(call, run, monkeypatch):
    monkeypatch.setattr("evolve.report.replay.record", None)
    monkeypatch.setattr("evolve.episodes.recorder.record", None)
    for command in ("replay", "report"):
        code, _, err = call(command, run.path, "--out", ".")
        assert (code, err) == (2, f"evolve: error: {Path.cwd()}: is a directory: must be a regular file\n")
    for film in ("film.gif", "film.MP4", "film.rrd"):
        code, _, err = call("replay", run.path, "--gif", "--out", film)
        assert code == 2
        assert f"out = {film}: must name the page, such as film.html; --" in err


def test_quiet_is_quiet_and_errors_are_not(call, run, browser, tmp_path):
    assert call("export", run.path, "--quiet", "--out", tmp_path / "frames") == (0, "", "")
    assert len(list((tmp_path / "frames").glob("*.exr"))) == 32
    code, out, err = call("export", run.path, "--quiet", "--candidate", 9)
    assert (code, out) == (2, "")
    assert "there is no candidate 9" in err
    assert browser == []


@pytest.mark.slow
def test_resume_of_a_finished_run_does_nothing_and_says_so(call, finished, browser, tmp_path):
    (finished / "report.html").write_text("as it was")
    (finished / "exr").mkdir(exist_ok=True)
    (finished / "exr" / "one.exr").write_bytes(b"as it was")
    before = {path: path.read_bytes() for path in finished.rglob("*") if path.is_file()}
    try:
        code, out, _ = call("resume", finished, "--open")
        assert code == 0
        assert "all 12 candidates have been evaluated" in out
        assert f"nothing is left to do; report: {finished / 'report.html'}" in out
        assert browser == [(finished / "report.html").as_uri()]
        assert {path: path.read_bytes() for path in finished.rglob("*") if path.is_file()} == before
        event = json.loads(call("resume", finished, "--json")[1])
        assert event["event"] == "finished"
        assert event["exr"] == [str(finished / "exr" / "one.exr")]
    finally:
        (finished / "report.html").unlink()
        (finished / "exr" / "one.exr").unlink()
        (finished / "exr").rmdir()


class Terminal(io.StringIO):
    """A stream that is a terminal."""

    def isatty(self):
        return True


def test_a_wait_shows_what_is_done_on_a_terminal_alone():
    seen, unseen, quiet = Terminal(), io.StringIO(), Terminal()
    for out, shown in ((seen, True), (unseen, True), (quiet, False)):
        with waiting.Waiting(2, shown, out) as wait:
            wait.step("writing [this]\x1b]0;title\x07")
            wait.step("writing that")
            wait.within("its second half", 0.5)
            if wait._progress is not None:
                assert wait._progress.tasks[0].percentage == 75
    assert "its second half" in seen.getvalue()
    assert "\x1b]0;" not in seen.getvalue()
    assert unseen.getvalue() == quiet.getvalue() == ""


def test_where_no_episode_can_be_played_the_report_is_kept(call, finished, tmp_path):
    """The run was copied without its policies and EXR files."""
    run = shutil.copytree(finished, tmp_path / "run")
    (run / "report.html").write_text("of an hour ago")
    code, _, err = call("resume", run)
    assert code == 2
    assert "no policy at" in err
    assert (run / "report.html").read_text() == "of an hour ago"


@pytest.mark.fast_cases(1)
@pytest.mark.parametrize("write", [write_report, write_page])
def test_a_run_that_is_deleted_while_its_report_is_made_stays_deleted(run, episode, tmp_path, write):
    path = shutil.copytree(run.path, tmp_path / "run")
    deleted = Run.open(path)
    shutil.rmtree(path)
    with pytest.raises(OSError, match="No such file or directory") as caught:
        write(deleted, episode)
    assert caught.value.filename.startswith(f"{path}/re")
    assert not path.exists()


def test_who_is_stopped_among_the_exr_files_has_no_report_yet(finished, monkeypatch):
    """An export that was interrupted leaves no report, so that `resume` detects the missing files."""

    def stopped(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("evolve.episodes.recorder.record", lambda run, pictures: None)
    monkeypatch.setattr("evolve.report.exr_export.export_episode", stopped)
    (finished / "report.html").write_text("of an hour ago")
    with pytest.raises(KeyboardInterrupt):
        products.finished_products(Run.open(finished), shown=False)
    assert not (finished / "report.html").exists()
