"""`evolve replay`, `evolve report` and `evolve export`: files with the results of a run.

The function `finished_products` writes the report and the EXR files at the end of a run, and a replay on request.
"""

from __future__ import annotations

import json
import webbrowser
from argparse import Namespace
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from evolve.cli.waiting import Waiting
from evolve.report.write import FILE as REPORT
from evolve.runs.output import say
from evolve.store.directory import EXR, Run
from optics.numerics import device

__all__ = ["REPORT", "Products", "export", "finished_products", "open_page", "replay", "report"]


@dataclass(frozen=True)
class Products:
    """Paths of the files with the results of a finished run.

    report: HTML page
    frames: EXR files
    replay: page that plays the episode; None unless it was requested
    """

    report: Path
    frames: list[Path]
    replay: Path | None = None

    def record(self, run: Run) -> dict[str, Any]:
        """Return the paths of the files as JSON values."""
        replay = {} if self.replay is None else {"replay": str(self.replay)}
        exr = [str(frame) for frame in self.frames]
        return {"directory": str(run.path), "report": str(self.report), **replay, "exr": exr}

    def lines(self, run: Run) -> list[str]:
        """Return lines with the paths of the run directory and the pages, and a line about the EXR files.

        The last line states the number of EXR files, their folder, and the name of the first file.
        """
        return [
            f"run directory: {run.path}",
            f"report: {self.report}",
            *([] if self.replay is None else [f"replay: {self.replay}"]),
            f"EXR files: {len(self.frames)} in {self.frames[0].parent}, the first: {self.frames[0].name}",
        ]


def finished_products(run: Run, shown: bool, replay: bool = False) -> Products:
    """Write the report of a run, and the EXR files of an episode of its best animal.

    The report is written last, so its existence shows that all files are complete.

    shown: True to show a progress bar
    replay: True to also write a page that plays the episode

    Raises:
        RunError: no candidate has succeeded, or the policy of the best one is missing or damaged.
        ConfigError: the user task was not named when the run was opened, or its module cannot be executed.
        RuntimeError: a method of the user task fails at the start of the episode.
        BackendError: Dr.Jit finds no usable LLVM library or GPU.
        OSError: a file cannot be read or written.
    """
    with Waiting(3 + replay, shown) as wait:
        wait.step("the best agent plays an episode")
        from evolve.episodes import recorder
        from evolve.report import exr_export
        from evolve.report.replay import write_page
        from evolve.report.write import write

        best, played = recorder.record(run, pictures=True), None
        # The old report is deleted only now, so that it is kept if no episode can be played.
        (run.path / REPORT).unlink(missing_ok=True)
        if replay:
            wait.step("writing the replay")
            played = write_page(run, best)
        wait.step("writing EXR files")
        frames = exr_export.export_episode(run, best, run.path / EXR, wait.within)
        wait.step("writing the report")
        return Products(write(run, best, doing=wait.within), frames, played)


def replay(arguments: Namespace) -> int:
    """Play an episode of an agent, print the result, and write a page that shows the episode."""
    run = _open(arguments)
    with _waiting(arguments, "an episode is played and written"):
        from evolve.report.replay import BESIDE, episode_facts, episode_table, write_replay

        also = [form for form in BESIDE if getattr(arguments, form)]
        mode = "test" if arguments.test else "evaluation"
        selected = (arguments.candidate, arguments.seed, arguments.every)
        episode, paths = write_replay(run, *selected, also, arguments.out, mode)
    if arguments.json:
        say(json.dumps({**episode_facts(episode), "files": [str(path) for path in paths]}, indent=1))
    else:
        say(episode_table(episode))
        say("\n".join(f"replay: {path}" for path in paths))
    open_page(paths[0], arguments)
    return 0


def report(arguments: Namespace) -> int:
    """Write the HTML report of a run, and print its path."""
    run = _open(arguments)
    with _waiting(arguments, "the report is written") as wait:
        from evolve.report.write import write

        page = write(run, out=arguments.out, doing=wait.within)
    say(json.dumps({"report": str(page)}) if arguments.json else f"report: {page}")
    open_page(page, arguments)
    return 0


def export(arguments: Namespace) -> int:
    """Write the radiance in front of an agent's eyes and the eyes' signals as EXR files, and print where they are."""
    run = _open(arguments)
    with _waiting(arguments, "EXR files are written") as wait:
        from evolve.report.exr_export import export_run

        selected = (arguments.candidate, arguments.seed, arguments.every, arguments.out)
        files = export_run(run, *selected, wait.within)
    if arguments.json:
        say(json.dumps({"exr": [str(file) for file in files]}, indent=1))
    else:
        say(f"EXR files: {len(files)} in {files[0].parent}, the first: {files[0].name}")
    return 0


def open_page(page: Path, arguments: Namespace) -> None:
    """Open a page in a browser if `--open` was given."""
    if arguments.open:
        webbrowser.open(page.resolve().as_uri())


def _waiting(arguments: Namespace, text: str) -> Waiting:
    """Return a progress bar for a single step, which `text` describes."""
    wait = Waiting(1, shown=not (arguments.json or arguments.quiet))
    return wait.of_one_step(text)


def _open(arguments: Namespace) -> Run:
    """Open the run, and check that Dr.Jit, which computes PSFs and the signals of eyes, works on this machine.

    Raises:
        BackendError: Dr.Jit finds no usable LLVM library or GPU.
        RunError: the directory contains no run, or its record is damaged; see `Run.open` for its other errors.
    """
    run = Run.open(arguments.directory, arguments.task, arguments.before_damage)
    device.make_ready()
    return run
