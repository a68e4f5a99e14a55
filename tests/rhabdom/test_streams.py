"""Commands whose standard streams are closed, full or badly encoded end with the usual exit code.

RANDOM_STREAMS=20 python -m pytest tests/rhabdom/test_streams.py     tries twenty times the default number of commands
"""

import json
import os
import random
import subprocess
import sys
from pathlib import Path

import pytest

from evolve.search.successive_halving import finished
from evolve.store.directory import Run
from rhabdom.streams import OwnedStream
from tests.evolve.runs.test_output import DRIVER, SMALL

ROOT = Path(__file__).parents[2]
ROUNDS = int(os.environ.get("RANDOM_STREAMS", "1"))
CLOSED, FULL, OPEN = "{}>&-", "{}>/dev/full", ""
COMMANDS = {  # exit code and whether stdout contains a result
    ("genes",): (0, True),
    ("presets", "--json"): (0, True),
    ("--help",): (0, True),
    ("run", "--help"): (0, True),
    ("config", "show", "detection", "--preset", "quick"): (0, True),
    ("completion", "bash"): (0, True),
    ("list", "/nowhere"): (2, False),
    ("status", "/nowhere"): (2, False),
    ("resume", "/nowhere"): (2, False),
    ("run", "detection", "--set", "nothing=1"): (2, False),
    ("nonsense",): (2, False),
}
UNUSABLE = ["undefined", "idna", "punycode"]  # encodings with which Python starts


def shell(arguments, stdin=OPEN, stdout=OPEN, stderr=OPEN, **variables):
    """Run a program whose streams are redirected by a shell."""
    redirected = " ".join(["exec", '"$@"', stdin and "<&-", stdout.format(1), stderr.format(2)])
    environment = {**os.environ, "PYTHONPATH": str(ROOT), **variables}
    return subprocess.run(
        ["bash", "-c", redirected, "bash", *arguments],
        cwd=ROOT,
        env=environment,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        check=False,
        timeout=300,
    )


def evolve(arguments, **streams):
    return shell([sys.executable, "-m", "evolve", *arguments], **streams)


@pytest.mark.parametrize("stdout", [OPEN, CLOSED, FULL], ids=["1", "1>&-", "1>/dev/full"])
@pytest.mark.parametrize("stderr", [OPEN, CLOSED, FULL], ids=["2", "2>&-", "2>/dev/full"])
def test_exit_codes_do_not_depend_on_the_streams(stdout, stderr):
    """Only a full stdout changes the code, because the result is lost; stderr then reports it if possible."""
    rng = random.Random()
    for command, (code, has_result) in rng.sample(sorted(COMMANDS.items()), 1 if ROUNDS == 1 else len(COMMANDS)):
        child = evolve(command, stdin=rng.choice([OPEN, CLOSED]), stdout=stdout, stderr=stderr)
        lost = stdout == FULL and has_result
        assert child.returncode == (2 if lost else code), (command, child)
        assert b"Traceback" not in child.stderr
        assert b"lost sys" not in child.stderr
        if stdout == OPEN:
            assert bool(child.stdout) == has_result
        if stderr == OPEN:
            assert child.stderr.count(b"\n") == (lost or code == 2), child.stderr
            assert (b"error: stdout: No space left on device" in child.stderr) == lost


def test_encodings_that_write_no_text_are_replaced():
    rng = random.Random()
    for encoding in rng.sample(UNUSABLE, 1 if ROUNDS == 1 else len(UNUSABLE)):
        command, (code, has_result) = rng.choice(sorted(COMMANDS.items()))
        child = evolve(command, PYTHONIOENCODING=encoding)
        assert child.returncode == code, child
        assert f"note: encoding {encoding}: cannot write text; UTF-8 is used\n".encode() in child.stderr
        assert b"Traceback" not in child.stderr
        assert child.stdout == (evolve(command, PYTHONIOENCODING="utf-8").stdout if has_result else b"")


@pytest.mark.fast_cases(1)
@pytest.mark.parametrize("both_closed", [False, True])
def test_a_run_continues_and_can_be_resumed_with_any_streams(tmp_path, both_closed):
    """The run starts with random faults of its streams, and is resumed with others."""
    rng, program = random.Random(), tmp_path / "driver.py"
    program.write_text(DRIVER)
    settings = [part for text in SMALL for part in ("--set", text)]
    first = ["bowl", "run", "detection", "--workers", "1", *settings, "--out", str(tmp_path / "run")]
    for arguments in (first, ["bowl", "resume", str(tmp_path / "run")]):
        stdout, stderr = rng.choice([(OPEN, CLOSED), (OPEN, FULL), (CLOSED, OPEN), (FULL, OPEN), (FULL, FULL)])
        options = rng.choice([(), ("--json",)])
        encoding = rng.choice([{}, {"PYTHONIOENCODING": rng.choice(UNUSABLE)}])
        if both_closed:
            stdout = stderr = CLOSED
        command = [sys.executable, str(program), *arguments, *options]
        child = shell(command, stdin=rng.choice([OPEN, CLOSED]), stdout=stdout, stderr=stderr, **encoding)
        assert child.returncode == 0, (command, child)
        assert b"Traceback" not in child.stderr
        note = b"note: stdout: No space left on device; further output is discarded"
        assert child.stderr.count(note) <= (stdout == FULL and stderr == OPEN), child.stderr
    run = Run.open(tmp_path / "run")
    assert finished(run)
    for file in run.path.iterdir():
        assert not file.is_file() or b"candidate 0 (" not in file.read_bytes(), "a message is in a file of the run"


def test_what_workers_print_does_not_reach_stdout(tmp_path):
    program, settings = tmp_path / "driver.py", [part for text in SMALL for part in ("--set", text)]
    program.write_text(DRIVER)
    command = ["prints_and_closes", "run", "detection", "--workers", "1", *settings, "--out", str(tmp_path / "run")]
    child = shell([sys.executable, str(program), *command, "--json"])
    assert child.returncode == 0, child
    events = [json.loads(line) for line in child.stdout.splitlines()]
    failures = [event["failure"] for event in events if event["event"] == "evaluated"]
    assert [failure is None for failure in failures] == [True, True, False, True]
    assert failures[2].startswith("SystemExit: 5 (closed_form.py:")
    assert child.stderr.count(b"noise\n") >= 4 * 2  # print works only until the stream below has been closed


OWNED = """
import os, sys
from rhabdom.streams import open_closed_streams, private_stdout
os.close({closed})
open_closed_streams()
with private_stdout() as own:
    sys.__stdout__.write("to stderr\\n")
    os.write(1, b"to stderr, too\\n")
    sys.stdout.close() if {closes} else None
    own.write("result\\n")
    file = open({path!r}, "w")
    assert file.fileno() > 2
"""


@pytest.mark.parametrize("closed", [0, 2])
def test_only_the_program_writes_to_its_stdout(tmp_path, closed):
    script = OWNED.format(closed=closed, closes=random.random() < 0.5, path=str(tmp_path / "file"))
    child = shell([sys.executable, "-c", script])
    assert (child.returncode, child.stdout) == (0, b"result\n"), child.stderr
    assert closed == 2 or (b"to stderr\n" in child.stderr and b"to stderr, too\n" in child.stderr)


def test_a_stream_that_is_closed_from_below_reports_once(tmp_path):
    faults = []
    with (tmp_path / "file").open("w") as file:
        stream = OwnedStream(file, faults.append)
        stream.close()
        assert not stream.closed
        assert stream.write("text") == 4
        file.close()
        stream.write("lost")
        stream.write("lost")
    assert len(faults) == 1
    assert (tmp_path / "file").read_text() == "text"
