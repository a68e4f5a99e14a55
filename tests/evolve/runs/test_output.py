"""Output to the terminal: it is printable text, and runs continue, or report an error, if the reader disappears."""

import io
import os
import subprocess
import sys
from pathlib import Path

import pytest

from evolve.runs.output import Voice, as_it_is, printable, voices
from evolve.search.successive_halving import finished
from evolve.store.directory import Run
from tests.evolve.closed_form import tiny
from tests.evolve.store.records import candidate

ROOT = Path(__file__).parents[3]
HOSTILE = "\x1b]0;owned\x07\x1b[2J\x1b[31mred\x9b1m \r\u202eright\u2069\udcff\x00"
SHOWN = r"\x1b]0;owned\x07\x1b[2J\x1b[31mred\x9b1m \x0d\u202eright\u2069\udcff\x00"
# A run whose candidates take a millisecond; all other parts are real.
DRIVER = """
import sys
import evolve.cli.commands.run as commands
from evolve.cli.main import main
from evolve.runs import carry_on
from tests.evolve import closed_form
if __name__ == "__main__":
    carry_on.evaluate_candidate, carry_on.prepare_device = getattr(closed_form, sys.argv[1]), None
    commands._finish = lambda run, as_json: 0
    sys.exit(main(sys.argv[2:]))
"""
SMALL = ("search.population=2", "search.generations=2", "genome.optical.open=false", "learning.total_steps=4096")


def begin(folder, evaluate, *options, **streams):
    """Start `evolve run` in a separate process."""
    (folder / "driver.py").write_text(DRIVER)
    settings = [part for text in SMALL for part in ("--set", text)]
    command = [sys.executable, str(folder / "driver.py"), evaluate, "run", "detection", "--workers", "1", *settings]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.Popen([*command, "--out", folder / "run", *options], cwd=folder, env=environment, **streams)


def test_what_steers_a_terminal_is_shown():
    assert printable(HOSTILE) == SHOWN
    for text in ("plain\n", "σ = 0.1 µm · ±1\n", "tab\there"):
        assert printable(text) == text


@pytest.mark.parametrize(
    ("encoding", "shown"),
    [("ascii", r"sigma +-1 \u0436"), ("latin-1", r"sigma ±1 \u0436"), ("utf-8", "σ ±1 ж")],
)
def test_letters_that_the_terminal_has_not_are_spelled_or_shown_by_number(encoding, shown):
    raw = io.BytesIO()
    voice = Voice(io.TextIOWrapper(raw, encoding), patient=False)
    print("σ ±1 ж", "\udcff", file=voice, flush=True)
    assert raw.getvalue().decode(encoding) == f"{shown} \\udcff\n"


def test_escapes_that_are_meant_pass(capsys):
    with voices(patient=False):
        print("\x1b[2J", end="", file=as_it_is(sys.stdout))
        print("\x1b[2J")
    assert capsys.readouterr().out == "\x1b[2J\\x1b[2J\n"


def test_failure_texts_and_names_of_directories_do_not_steer_the_terminal(call, tmp_path):
    run = Run.create(tmp_path / "\x1b[31mrun\udcff", tiny())
    run.append(candidate(0, failure=f"ValueError: {HOSTILE}"))
    for command in (("status", run.path), ("compare", run.path), ("status", tmp_path / HOSTILE.replace("\x00", ""))):
        _, out, err = call(*command)
        assert (out + err).isprintable() or (out + err).replace("\n", "").isprintable()
        assert r"\x1b[31mr" in out + err
    _, _, err = call("run", "detection", "--set", f"{HOSTILE}=1")
    assert r"\x1b[2J" in err
    assert err.replace("\n", "").isprintable()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "closed"),
    [(("--json",), ("stdout",)), ((), ("stdout", "stderr"))],
    ids=["json, head -1", "text, 2>&1 head -1"],
)
def test_a_run_goes_on_when_nobody_reads_any_more(tmp_path, options, closed):
    """The reader takes the first line and closes the pipe, like `head -1`."""
    reader, writer = os.pipe()
    streams = {name: writer if name in closed else subprocess.PIPE for name in ("stdout", "stderr")}
    child = begin(tmp_path, "bowl", *options, **streams)
    os.close(writer)
    with open(reader, "rb", buffering=0) as pipe:
        assert pipe.read(1)
    _, err = child.communicate(timeout=120)
    assert child.returncode == 0, err
    assert not err or b"Traceback" not in err
    assert finished(Run.open(tmp_path / "run"))


def test_other_commands_end_in_silence_when_nobody_reads(tmp_path):
    command = [sys.executable, "-m", "evolve", "genes"]
    child = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    child.stdout.close()
    err = child.stderr.read()
    child.stderr.close()
    assert (child.wait(), err) == (0, b"")


def test_terminal_without_greek_letters_gets_the_genes():
    environment = {**os.environ, "PYTHONIOENCODING": "ascii", "PYTHONUTF8": "0", "LC_ALL": "C"}
    child = subprocess.run(
        [sys.executable, "-m", "evolve", "genes"], cwd=ROOT, env=environment, capture_output=True, check=False
    )
    assert child.returncode == 0, child.stderr
    assert b"sigma = " in child.stdout


@pytest.mark.slow
@pytest.mark.parametrize("evaluate", ["deletes_the_run", "deletes_the_run_at_last"])
def test_a_run_that_is_deleted_stays_deleted_and_says_so(tmp_path, evaluate):
    child = begin(tmp_path, evaluate, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    _, err = child.communicate(timeout=120)
    assert child.returncode == 2
    assert "Traceback" not in err
    assert str(tmp_path / "run") in err.splitlines()[-1]
    assert not (tmp_path / "run").exists()


@pytest.mark.slow
def test_a_run_that_was_begun_anew_gets_nothing_from_the_former_one(tmp_path):
    """Both records are empty, and the new one may even have the same inode."""
    child = begin(tmp_path, "begins_another_run", stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    _, err = child.communicate(timeout=120)
    assert child.returncode == 2
    assert "was changed by another process; nothing is added" in err
    other = Run.open(tmp_path / "run")
    assert other.config.seed == 77
    assert other.candidates == ()
