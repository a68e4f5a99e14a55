"""The command and Python start, resume and continue runs with the same code: same records, same refusals, same
steps.
"""

import json
import re
from pathlib import Path
from unittest import mock

import pytest

import evolve
from evolve.cli.main import _one_line
from evolve.config.assemble import assemble
from evolve.config.formats import FORMAT
from evolve.runs import begin, carry_on, resume
from evolve.search.local_executor import LocalExecutor
from evolve.store.directory import Run
from optics.numerics.backend import BackendError
from tests.evolve.closed_form import TINY, leaves_a_policy, tiny

ROOT = Path(__file__).resolve().parents[3]
SETTINGS = (*TINY, "workers=1", "seed=7")
FAILS = "import sim\nclass Mine(sim.Task):\n    def __init__(self):\n        raise ValueError('not today')\n"


@pytest.fixture
def closed_form(monkeypatch):
    """Use the real engine in one process, with a known fitness and without a report at the end."""
    import evolve.cli.commands.run as command

    monkeypatch.setattr(carry_on, "evaluate_candidate", leaves_a_policy)
    monkeypatch.setattr(carry_on, "LocalExecutor", lambda evaluate, count, prepare: LocalExecutor(evaluate, count))
    monkeypatch.setattr(command, "_finish", lambda run, *rest: 0)


def values(assignments):
    """Return settings "KEY=VALUE" in the form that `evolve.run` accepts, as a dictionary."""
    pairs = dict(text.split("=", 1) for text in assignments)
    return {key: json.loads(value) for key, value in pairs.items()}


class Faces:
    """The command and Python, called with the same arguments; each returns None, or the line of its refusal."""

    def __init__(self, call):
        self.call = call

    def begun_by_command(self, out, assignments=(), **options):
        flags = [part for text in assignments for part in ("--set", text)]
        words = {"start_from": "from"}
        task = options.pop("task", "detection")
        named = [part for key, value in options.items() for part in (f"--{words.get(key, key)}", value)]
        return self._command("run", *([task] if task else []), "--out", out, *flags, *named)

    def begun_in_python(self, out, assignments=(), **options):
        options = {"task": "detection", "settings": values(assignments), "out": out, "progress": False, **options}
        return self._python(lambda: evolve.run(**options))

    def resumed_by_command(self, path, task=None):
        return self._command("resume", path, *(["--task", task] if task else []))

    def resumed_in_python(self, path, task=None):
        return self._python(lambda: evolve.resume(path, task, progress=False))

    def _command(self, *arguments):
        code, _, err = self.call(*arguments)
        if not code:
            return None
        (line,) = [text for text in err.splitlines() if text.startswith("evolve: error: ")]
        return line.removeprefix("evolve: error: ")

    def _python(self, function):
        try:
            function()
        except (ValueError, RuntimeError, OSError) as error:
            return _one_line(error)


@pytest.fixture
def faces(call):
    return Faces(call)


def files(path):
    """Return the files of a run and its starts, without times and process numbers."""
    found = {file.relative_to(path): file.read_bytes() for file in path.rglob("*") if file.is_file()}
    for name in ("lock", "policies/calls.log"):
        found.pop(Path(name))
    starts = json.loads(found.pop(Path("versions.json")))
    return found, [{**start, "time": None} for start in starts]


def cut(path):
    """Cut a run to its state after five of twelve candidates, as if it had been killed."""
    record = path / "candidates.jsonl"
    record.write_bytes(b"".join(record.read_bytes().splitlines(keepends=True)[:5]))


def test_runs_are_the_same_bytes_whoever_begins_and_resumes_them(closed_form, faces, tmp_path):
    one, other = tmp_path / "one", tmp_path / "other"
    assert faces.begun_by_command(one, SETTINGS) is None
    assert faces.begun_in_python(other, SETTINGS) is None
    whole = files(one)
    assert files(other) == whole
    assert len(Run.open(one).candidates) == 12
    cut(one)
    cut(other)
    assert faces.resumed_in_python(one) is None
    assert faces.resumed_by_command(other) is None
    assert files(one) == files(other)
    assert files(one)[0] == whole[0]
    assert [start["candidates"] for start in files(one)[1]] == [0, 5]


@pytest.mark.parametrize(
    ("assignments", "options"),
    [
        (["search.poplation=3"], {}),
        (["search.population=1.5"], {}),
        (['search.optimizer="none"'], {}),
        ([], {"preset": "qick"}),
        ([], {"task": "detecton"}),
        ([], {"task": None}),
        ([], {"task": "absent.py:Mine"}),
        ([], {"task": "fails.py:Mine"}),
        ([], {"task": "fails.py:Yours"}),
        ([], {"scale": "laptop"}),
        ([], {"config": "absent.toml"}),
        ([], {"start_from": "absent"}),
        ([], {"start_from": "finished:99"}),
        ([], {"out": "finished"}),
    ],
    ids=str,
)
def test_both_refuse_a_beginning_with_the_same_line(faces, finished, tmp_path, monkeypatch, assignments, options):
    monkeypatch.chdir(tmp_path)
    Path("finished").symlink_to(finished)
    Path("fails.py").write_text(FAILS)
    out = options.pop("out", "run") if (options := dict(options)) else "run"
    lines = {begun(out, assignments, **options) for begun in (faces.begun_by_command, faces.begun_in_python)}
    assert len(lines) == 1
    assert None not in lines
    assert not Path("run").exists()


def locked(run):
    run.lock().__enter__()


def damaged(run):
    run.record.path.write_text("{}\n")


def of_a_former_format(run):
    config = run.path / "config.toml"
    config.write_text(re.sub(rf"^format = {FORMAT}$", "format = 1", config.read_text(), flags=re.MULTILINE))


def of_a_user_task(run):
    pass


@pytest.mark.parametrize(
    ("state", "task"),
    [
        (locked, None),
        (damaged, None),
        (of_a_former_format, None),
        (of_a_user_task, None),
        (of_a_user_task, "absent.py:Mine"),
        (of_a_user_task, "{find_ball}:FindBal"),
        (locked, "{find_ball}:FindBall"),
    ],
    ids=lambda given: getattr(given, "__name__", str(given)),
)
def test_both_refuse_to_resume_with_the_same_line(faces, tmp_path, state, task):
    find_ball = ROOT / "examples" / "find_ball.py"
    config = tiny() if state is not of_a_user_task else assemble(f"{find_ball}:FindBall", assignments=TINY)
    run = Run.create(tmp_path / "run", config)
    state(run)
    before = {file: file.read_bytes() for file in run.path.rglob("*") if file.is_file() and file.name != "lock"}
    task = task and task.format(find_ball=find_ball)
    lines = {resumed(run.path, task) for resumed in (faces.resumed_by_command, faces.resumed_in_python)}
    assert len(lines) == 1
    assert None not in lines
    assert {file: file.read_bytes() for file in before} == before


@pytest.mark.parametrize("step", ["assemble", "Search", "device", "try_task"])
def test_both_begin_by_the_same_steps(faces, tmp_path, monkeypatch, step):
    monkeypatch.setattr(begin, step, refusing(step))
    for begun in (faces.begun_by_command, faces.begun_in_python):
        assert begun(tmp_path / "run", SETTINGS) == f"{step}: refused"
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("step", ["device", "finished", "try_task", "present", "record_start"])
def test_both_resume_by_the_same_steps(faces, tmp_path, monkeypatch, step):
    path = Run.create(tmp_path / "run", tiny()).path
    monkeypatch.setattr(resume, step, refusing(step))
    for resumed in (faces.resumed_by_command, faces.resumed_in_python):
        assert resumed(path) == f"{step}: refused"


@pytest.mark.parametrize("step", ["LocalExecutor", "evolve"])
def test_both_carry_on_by_the_same_steps(closed_form, faces, tmp_path, monkeypatch, step):
    monkeypatch.setattr(carry_on, step, refusing(step))
    for number, begun in enumerate((faces.begun_by_command, faces.begun_in_python)):
        path = tmp_path / f"run-{number}"
        assert begun(path, SETTINGS) == f"{step}: refused"
        for resumed in (faces.resumed_by_command, faces.resumed_in_python):
            assert resumed(path) == f"{step}: refused"


def refusing(step):
    """Return a function that raises the error of its method."""
    error = BackendError(f"{step}: refused")
    return mock.Mock(side_effect=error, make_ready=mock.Mock(side_effect=error))


def test_only_the_command_prints_notes(closed_form, call, tmp_path, capsys):
    """Notes report changed settings and lost policies; `--quiet` suppresses them."""
    paths = [tmp_path / name for name in ("told", "quiet", "python")]
    for path in paths:
        evolve.run("detection", settings=values(SETTINGS), out=path, progress=False)
        cut(path)
        config = path / "config.toml"
        config.write_text(config.read_text().replace("total_steps = 4096", "total_steps = 8192"))
        (path / "policies" / "000001.safetensors").unlink()
    capsys.readouterr()
    lost = Run.open(paths[0]).notice
    assert "policies of 1 candidates are lost" in lost
    changed = "config.toml has changed since the last start. Candidates from 5 on are trained and evaluated with other "
    assert changed in lost
    told = call("resume", paths[0])[2]
    assert re.findall(r"^note: .*", told, re.MULTILINE) == [f"note: {lost}"]
    assert "note: " not in call("resume", paths[1], "--quiet")[2]
    evolve.resume(paths[2], progress=False)
    assert capsys.readouterr().err == ""
