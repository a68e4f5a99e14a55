"""Every argument of every command changes an output, or it is refused with a reason.

The table names each argument, and an example. Large parts of the commands are replaced by functions that record their
arguments, since other tests cover them. An argument that is missing in the table fails the test.
"""

import argparse
import io
import os
import re
import shutil
from types import SimpleNamespace

import pytest
from PIL import Image

import evolve.cli.commands.demo
import evolve.cli.commands.products
import evolve.cli.commands.run
import evolve.cli.doctor
import evolve.report.exr_export
import evolve.report.replay
import evolve.report.write
from evolve.cli.arguments import build_parser
from evolve.cli.commands import validate
from evolve.cli.commands.products import Products
from evolve.cli.pace import Pace
from evolve.cli.run_plan import RunPlan
from evolve.runs import begin, carry_on
from evolve.runs.progress import Lines
from evolve.search import loop
from evolve.store.directory import Run
from optics.numerics import device
from tests.evolve.cli.option_table import BASE, CHANGES, MORE, POSITIONAL, SCHEMA, TABLE
from tests.evolve.cli.test_generations import Acute
from tests.evolve.closed_form import tiny


def arguments(command):
    """Return the names of the arguments of a command, except help."""
    (commands,) = [each for each in build_parser()._actions if isinstance(each, argparse._SubParsersAction)]
    return {one.dest for one in commands.choices[command]._actions if one.dest != "help"}


def test_the_table_names_every_argument_of_every_command():
    (commands,) = [each for each in build_parser()._actions if isinstance(each, argparse._SubParsersAction)]
    assert set(TABLE) == set(commands.choices)
    for command in TABLE:
        assert set(TABLE[command]) == arguments(command), command


class Executor(Acute):
    """An executor in this process."""

    count = 1

    def __init__(self, log, *named):
        log.append(("executor", *map(str, named)))

    def __enter__(self):
        return self

    def __exit__(self, *_):
        return None


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Return a folder with an unfinished run, three finished ones, an empty folder and a file of settings."""
    folder = tmp_path_factory.mktemp("runs")
    Run.create(folder / "begun", tiny("search.generations=1"))
    for name, seed in (("done", 0), ("elsewhere", 1), ("again", 2)):
        run = Run.create(folder / name, tiny("search.generations=1", f"seed={seed}"))
        loop.evolve(run, Acute(), Lines(run, io.StringIO(), 1))
    damaged = shutil.copytree(folder / "done", folder / "damaged") / "candidates.jsonl"
    damaged.write_text(damaged.read_text() + "damage\n")
    (folder / "empty").mkdir()
    for name, colour in (("photo", (200, 120, 40)), ("other", (40, 120, 200))):
        Image.new("RGB", (16, 12), colour).save(folder / f"{name}.png")
    (folder / "settings.toml").write_text("seed = 9\n")
    return folder


@pytest.fixture
def world(runs, tmp_path, monkeypatch, call):
    """Return a function that runs a command in a folder with runs, and returns all that it does."""
    log = []

    def logged(name, result):
        def run(*given, **named):
            shown = [
                one for one in (*given, *named.values()) if isinstance(one, str | int | float | list | type(tmp_path))
            ]
            log.append((name, *map(str, shown), *(one.path.name for one in given if isinstance(one, Run))))
            return result

        return run

    made = Products(tmp_path / "report.html", [tmp_path / "one.exr"], tmp_path / "replay.html")
    commands = evolve.cli.commands
    for module in (commands.run, commands.demo):
        monkeypatch.setattr(module, "finished_products", logged("products", made))
    episode = SimpleNamespace()
    monkeypatch.setattr(evolve.report.replay, "write_replay", logged("replay", (episode, [made.replay])))
    monkeypatch.setattr(evolve.report.replay, "episode_facts", lambda _: {})
    monkeypatch.setattr(evolve.report.replay, "episode_table", lambda _: "table")
    monkeypatch.setattr(evolve.report.write, "write", logged("report", made.report))
    monkeypatch.setattr(evolve.report.exr_export, "export_run", logged("export", made.frames))
    monkeypatch.setattr(commands.products.webbrowser, "open", logged("open", None))
    monkeypatch.setattr(evolve.cli.doctor, "print_findings", logged("doctor", 0))
    monkeypatch.setattr(validate, "_run", lambda proofs: log.append([proof.name for proof in proofs]) or 0)
    monkeypatch.setattr(begin, "Search", logged("search", None))
    monkeypatch.setattr(carry_on, "LocalExecutor", lambda _, count, prepare: Executor(log, "local", count))
    monkeypatch.setattr(commands.run, "local_workers", carry_on.local_workers)
    monkeypatch.setattr(commands.run, "DaskExecutor", lambda scheduler, note: Executor(log, "dask"))
    monkeypatch.setattr(commands.run.Scheduler, "require_answer", logged("answer", None))
    monkeypatch.setattr(device, "make_ready", logged("device", None))
    monkeypatch.setattr(RunPlan, "measured", lambda self: RunPlan(*self_of(self), dict.fromkeys(self.animals, PACE)))
    monkeypatch.chdir(tmp_path)
    shutil.copytree(runs, tmp_path, dirs_exist_ok=True)

    def did(*given):
        log.clear()
        monkeypatch.delenv("RHABDOM_DEVICE", raising=False)
        before, entries = files(tmp_path), {*tmp_path.iterdir()}
        code, out, err = call(*given)
        chosen = os.environ.pop("RHABDOM_DEVICE", None)
        changed = {path: text for path, text in files(tmp_path).items() if before.get(path) != text}
        for path in {*tmp_path.iterdir()} - entries:
            shutil.rmtree(path) if path.is_dir() else path.unlink()
        for path, text in before.items():
            path.write_bytes(text)
        return (
            code,
            steady(out),
            steady(err),
            [*log],
            chosen,
            {str(path): steady(str(t)) for path, t in changed.items()},
        )

    return did


PACE = Pace(1, 1000, 1, 1000)


def self_of(plan):
    return plan.config, plan.directory, plan.workers


def files(folder):
    """Return the contents of all files, except those with times."""
    times = {"versions.json", "lock"}
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file() and path.name not in times}


def steady(text):
    """Return a text without the parts that depend on time."""
    return re.sub(
        r"[\d.,]+ steps/s|[\d:]+ left|\d+:\d\d|\d+(\.\d+)? ?%|[\d.]+ [kMGT]?B|\"\w*seconds\w*\": [^,}]+", "", text
    )


@pytest.mark.parametrize("command", TABLE)
def test_every_argument_has_an_effect_or_is_refused(command, world):
    base = BASE.get(command, [command])
    before = world(*base)
    assert before[0] == 0, before
    assert world(*base) == before, "the outputs do not repeat"
    for name, (given, words) in TABLE[command].items():
        changed = [*base, *given]
        if name in POSITIONAL:
            changed = [*base[: POSITIONAL[name]], *given, *base[POSITIONAL[name] + 1 :]]
        elif name == "task" and not given[0].startswith("-"):
            place = base.index("detection")
            changed = [*base[:place], *given, *base[place + 1 :]]
        if command == "config" and name == "what":
            changed = SCHEMA
        if name == "before_damage":
            changed = [*("damaged" if part in ("done", "begun") else part for part in base), *given]
            assert world(*changed[:-1])[0] == 2
            assert world(*changed)[0] == 0
            continue
        check(world, changed, words, before)


@pytest.mark.parametrize(("base", "given", "words"), MORE)
def test_arguments_that_contradict_others_are_refused(base, given, words, world):
    check(world, [*base, *given], words, None)


def check(world, changed, words, before):
    found = world(*changed)
    if words is CHANGES:
        assert found[0] == 0, (changed, found)
        assert found != before, f"{changed}: no effect"
    else:
        assert found[0] == 2, (changed, found)
        assert re.search(words, found[2]), (changed, found[2])
        assert found[2].count("\n") == 1
