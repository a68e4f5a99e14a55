"""`evolve.run` and the command produce the same record; notebooks are generated from pages, and can be run."""

import importlib.util
import inspect
import os
import runpy
import shutil
import subprocess
import sys
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import nbformat
import pytest
from nbclient import NotebookClient

import evolve
from evolve.config.assemble import assemble
from evolve.runs import carry_on
from evolve.search.local_executor import LocalExecutor
from evolve.store.directory import Run
from optics.numerics import backend
from tests.evolve.closed_form import TINY, bowl
from tests.evolve.store.handwriting import records_of
from tests.test_docs import CODE, agrees

ROOT = Path(__file__).resolve().parents[3]
NOTEBOOKS = ROOT / "docs" / "notebooks"
SETTINGS = dict(text.split("=") for text in TINY) | {"genome.optical.open": False, "workers": 2, "seed": 7}
SETTINGS = {key: int(value) if str(value).isdecimal() else value for key, value in SETTINGS.items()}


@pytest.fixture
def closed_form(monkeypatch):
    """Use the real engine with a known fitness."""
    monkeypatch.setattr(carry_on, "evaluate_candidate", bowl)
    monkeypatch.setattr(carry_on, "LocalExecutor", lambda evaluate, count, prepare: LocalExecutor(evaluate, count))


def record(path: Path) -> list[dict[str, object]]:
    return sorted(
        ({**line, "seconds": 0} for line in records_of(path / "candidates.jsonl")), key=lambda line: line["id"]
    )


def test_record_is_the_commands(closed_form, call, finished, tmp_path, monkeypatch):
    seen = []
    run = evolve.run(
        "detection", settings=SETTINGS, out=tmp_path / "run", callbacks=[lambda r, c: seen.append((r, c.id))]
    )
    assert sorted(number for _, number in seen) == list(range(12))
    assert all(told is run for told, _ in seen)
    assert isinstance(run, evolve.Run)
    import evolve.cli.commands.run as command

    monkeypatch.setattr(command, "_finish", lambda run, *rest: 0)
    assigned = [part for key, value in SETTINGS.items() for part in ("--set", f"{key}={str(value).lower()}")]
    code, _, err = call("run", "detection", *assigned, "--out", tmp_path / "other")
    assert code == 0, err
    assert record(run.path) == record(tmp_path / "other")
    assert (run.path / "config.toml").read_bytes() == (tmp_path / "other" / "config.toml").read_bytes()
    assert run.best.fitness == Run.open(run.path).best.fitness


@pytest.mark.slow
def test_a_callback_may_end_the_run_which_can_go_on(closed_form, tmp_path):
    class EnoughError(Exception):
        pass

    def enough(run, candidate):
        if len(run.candidates) == 5:
            raise EnoughError

    begin = partial(evolve.run, "detection", settings=SETTINGS, progress=False)
    with pytest.raises(EnoughError):
        begin(out=tmp_path / "run", callbacks=[enough])
    run = evolve.Run.open(tmp_path / "run")
    assert len(run.candidates) == 5
    run.resume(progress=False)
    whole = begin(out=tmp_path / "whole")
    assert record(run.path) == record(whole.path)
    starts = (run.path / "versions.json").read_bytes()
    run.resume()
    assert isinstance(evolve.resume(run.path), evolve.Run)
    assert (run.path / "versions.json").read_bytes() == starts, "a finished run stays unchanged"


def test_a_task_of_ones_own_that_is_not_named_ends_before_anything_is_written(closed_form, tmp_path):
    """Otherwise every candidate would be on record as failed permanently."""
    task = f"{ROOT / 'examples' / 'find_ball.py'}:FindBall"
    config = assemble(task, "quick", assignments=["search.population=2", "search.generations=1", "workers=1"])
    path = Run.create(tmp_path / "run", config).path
    before = {file: file.read_bytes() for file in path.rglob("*") if file.is_file() and file.name != "lock"}
    with pytest.raises(evolve.ConfigError, match=r"find_ball\.py:FindBall.*runs only if you name it"):
        evolve.Run.open(path).resume(progress=False)
    assert {file: file.read_bytes() for file in before} == before
    assert not Run.open(path).candidates
    named = evolve.Run.open(path, task)
    with pytest.raises(evolve.ConfigError, match=r"callbacks = .*print.*: must be a list of functions"):
        named.resume(print, progress=False)
    named.resume(progress=False)
    assert len(named.candidates) == 2


def test_what_cannot_be_used_is_refused_before_anything_is_written(tmp_path):
    for arguments, message in (
        ({"settings": {"search.poplation": 3}}, "did you mean"),
        ({"settings": {"search.population": 1.5}}, "must be an integer"),
        ({"preset": "qick"}, "did you mean 'quick'"),
        ({"settings": {"search.optimizer": "none"}}, "none"),
        ({"preset": None}, "preset = None: must be a preset's name"),
        ({"out": 5}, "out = 5: must be a directory's path"),
        ({"callbacks": print}, "callbacks = .*print.*: must be a list of functions"),
        ({"callbacks": [print, 3]}, "callbacks = .*3.*: must be a list of functions"),
    ):
        with pytest.raises(evolve.ConfigError, match=message):
            evolve.run("detection", **{"out": tmp_path / "run", **arguments})
    assert not (tmp_path / "run").exists()
    with pytest.raises(evolve.ConfigError, match="directory = 5: must be a directory's path"):
        evolve.resume(5)
    with pytest.raises(evolve.ConfigError, match="task = 5: must be a task's name"):
        evolve.resume(tmp_path, 5)


@pytest.mark.slow
def test_a_script_needs_no_guard(tmp_path):
    """Workers do not execute the script again, which would start another run in each of them."""
    script = tmp_path / "script.py"
    script.write_text(
        "from pathlib import Path\n"
        "import evolve\n"
        "from evolve.runs import carry_on\n"
        "from evolve.search.local_executor import LocalExecutor\n"
        "from tests.evolve.closed_form import bowl\n"
        "with Path('began').open('a') as log: log.write('once\\n')\n"
        "carry_on.evaluate_candidate = bowl\n"
        "carry_on.LocalExecutor = lambda evaluate, count, prepare: LocalExecutor(evaluate, count)\n"
        f"print(evolve.run('detection', settings={SETTINGS!r}))\n"
    )
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, script]
    child = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert "12 of 12 candidates evaluated" in child.stdout, child.stderr
    assert (tmp_path / "began").read_text() == "once\n"
    assert [path.name for path in (tmp_path / "runs").iterdir()] == ["detection-paper-1"]


MAKER = SimpleNamespace(**runpy.run_path(str(ROOT / "docs" / "site" / "notebooks.py")))


def test_every_notebook_has_a_page():
    assert {path.stem for path in NOTEBOOKS.glob("*.ipynb")} == set(MAKER.SOURCES)


@pytest.mark.parametrize("name", MAKER.SOURCES)
def test_notebooks_are_their_pages(name):
    """Other tests run the code of the pages, which is the code of the notebooks. (If this fails: python
    docs/site/notebooks.py.)
    """
    page = MAKER.SOURCES[name]
    stored = nbformat.read(NOTEBOOKS / f"{name}.ipynb", as_version=4)
    assert stored == MAKER.notebook(page)
    nbformat.validate(stored)
    code = "".join(f"{cell.source}\n" for cell in stored.cells if cell.cell_type == "code")
    assert code == MAKER.SETUP + "".join(MAKER.CODE.findall(page.read_text()))
    prose = "\n".join(cell.source for cell in stored.cells if cell.cell_type == "markdown")
    for target in MAKER.LINK.findall(prose):
        assert (NOTEBOOKS / target.partition("#")[0]).exists(), target


@pytest.mark.parametrize("missing", [[], ["rhabdom"], ["LLVM"], ["rhabdom", "LLVM"]])
def test_setup_of_a_notebook_installs_what_is_missing(missing, monkeypatch):
    commands = []
    monkeypatch.setattr(subprocess, "run", lambda command, check: commands.append(command[1:]))
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name in missing else object())
    monkeypatch.setattr(backend, "find", lambda: (None if "LLVM" in missing else object(), []))
    monkeypatch.setattr(backend, "require", lambda: commands.append("require"))
    monkeypatch.setattr(shutil, "which", lambda name: f"/usr/bin/{name}")
    exec(MAKER.SETUP, {})
    pip = ["-m", "pip", "install", "--quiet", "git+https://github.com/rhabdom/rhabdom"]
    apt = [["update", "-qq"], ["install", "-y", "-qq", "libllvm19", "libatomic1"]]
    assert commands == [pip] * ("rhabdom" in missing) + apt * ("LLVM" in missing) + ["require"]


@pytest.mark.slow
def test_a_notebook_runs_as_jupyter_runs_it(tmp_path, monkeypatch):
    """This notebook's cells show tables and figures. They print the output of the page."""
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    book = nbformat.read(NOTEBOOKS / "python.ipynb", as_version=4)
    NotebookClient(book, timeout=300, resources={"metadata": {"path": tmp_path}}).execute()
    shown = {kind for cell in book.cells for output in cell.get("outputs", ()) for kind in output.get("data", ())}
    assert "image/png" in shown
    printed = [cell.outputs for cell in book.cells[1:] if cell.cell_type == "code"]  # without the setup
    page = (ROOT / "docs" / "tutorial" / "python.md").read_text()
    for (_, expected), outputs in zip(CODE.findall(page), printed, strict=True):
        texts = [output.text for output in outputs if output.output_type == "stream" and output.name == "stdout"]
        assert not expected or agrees(expected, "".join(texts))
    assert Run.open(tmp_path / "runs" / "python").best is not None


def _seen(call, monkeypatch, module, **given):
    """Return what a call of `evolve.run` or `evolve.resume` passes on."""
    seen = []

    class Begun:
        @classmethod
        def open(cls, *passed):
            seen.append(passed)
            return cls()

        def resume(self, *passed):
            seen.append(passed)

        @contextmanager
        def create(self, kind, out):
            seen.append(out)
            yield self

    class Watching:
        def __init__(self, *passed):
            seen.append(passed)

        def carry_on(self, begun):
            """Do nothing."""

    with monkeypatch.context() as patch:
        patch.setattr(module, "prepare_run", lambda request: seen.append(request) or Begun())
        patch.setattr(module, "Callbacks", Watching)
        patch.setattr(module, "OpenedRun", Begun)
        call(**given)
    return seen


EXAMPLES = {
    "task": "tracking",
    "preset": "quick",
    "settings": {"seed": 4},
    "config": "settings.toml",
    "scale": "laptop",
    "start_from": "runs/first:3",
    "out": "there",
    "callbacks": (print,),
    "progress": False,
    "directory": "other",
    "before_damage": True,
}


@pytest.mark.parametrize(("call", "base"), [(evolve.run, {}), (evolve.resume, {"directory": "begun"})])
def test_every_argument_reaches_the_run(call, base, monkeypatch):
    module = sys.modules[call.__module__]
    before = _seen(call, monkeypatch, module, **base)
    assert _seen(call, monkeypatch, module, **base) == before
    for name in inspect.signature(call).parameters:
        assert _seen(call, monkeypatch, module, **base | {name: EXAMPLES[name]}) != before, name
