"""Pages of docs/results: templates of prose, filled with the numbers of an experiment."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from string import Template
from typing import Any

from evolve.search.job import ExecutorError
from evolve.store.atomic_files import write_whole
from evolve.store.directory import RunError
from experiments.store import Origin

__all__ = ["Figure", "Page", "exit_code", "markdown_table", "new_figure", "parser", "save"]

DPI = 130
TEMPLATES = Path(__file__).parent / "pages"


@dataclass(frozen=True)
class Figure:
    """A figure of a page.

    name: name of its file without ".png"
    draw: function that writes the file
    """

    name: str
    draw: Callable[[Path], None]


@dataclass(frozen=True)
class Page:
    """A page of results, made from the template of the same name in experiments/pages.

    name: name of the template and of the page's file
    command: command that computes the numbers and makes the page; replaces $command in the template
    values: numbers, tables and other text, by the names of the placeholders that they replace
    figures: figures of the page; the template shows each of them with its caption
    origin: origin of the numbers; its sentence replaces $origin in the template
    """

    name: str
    command: str
    values: Mapping[str, str]
    figures: Sequence[Figure]
    origin: Origin

    @property
    def markdown(self) -> str:
        """Text of the page.

        Raises:
            KeyError: a placeholder of the template has no value.
            ValueError: a value or a figure has no place in the template.
        """
        template = Template((TEMPLATES / f"{self.name}.md").read_text(encoding="utf-8"))
        values = {**self.values, "command": self.command, "origin": self.origin.sentence()}
        places = {*template.get_identifiers(), *re.findall(r"\(figures/(\w+)\.png\)", template.template)}
        lost = sorted({*values, *(figure.name for figure in self.figures)} - places)
        if lost:
            raise ValueError(f"pages/{self.name}.md has no place for {', '.join(lost)}")
        return template.substitute(values)

    def publish(self, folder: Path) -> None:
        """Draw the figures and write the page, each completely or not at all."""
        (folder / "figures").mkdir(parents=True, exist_ok=True)
        for figure in self.figures:
            figure.draw(folder / "figures" / f"{figure.name}.png")
        write_whole(folder / f"{self.name}.md", self.markdown.encode())
        print(f"page: {folder / self.name}.md")


def parser(text: str) -> argparse.ArgumentParser:
    """Return an argument parser with the option that all experiments have.

    text: docstring of the module, whose first line describes the program in the help
    """
    found = argparse.ArgumentParser(description=text.split("\n")[0])
    found.add_argument("--docs", type=Path, default=Path("docs/results"), help="directory of page, figures and data")
    return found


def markdown_table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a Markdown table with the first column aligned left and the others right."""
    lines = [header, ["---", *("---:" for _ in header[1:])], *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def exit_code(name: str, work: Callable[[], None]) -> int:
    """Do the work and return 0; after an error, print one line and return 2."""
    try:
        work()
    except (RunError, ExecutorError, ValueError, OSError) as error:
        print(f"{name}: error: {error}", file=sys.stderr)
        return 2
    return 0


def new_figure(width: float, height: float, columns: int = 1, rows: int = 1, **options: Any) -> tuple[Any, Any]:
    """Return a figure of `width` x `height` inches and its axes, without frame lines at the top and on the right."""
    import matplotlib

    matplotlib.use("agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(
        rows, columns, figsize=(width, height), layout="constrained", squeeze=False, **options
    )
    for one in axes.flat:
        one.spines[["top", "right"]].set_visible(False)
    return figure, axes


def save(figure: Any, path: Path) -> None:
    """Write the figure and close it."""
    from matplotlib import pyplot

    unfinished = path.with_suffix(".tmp.png")
    figure.savefig(unfinished, dpi=DPI, metadata={"Software": None})
    pyplot.close(figure)
    unfinished.replace(path)
