"""A page of docs/results: a template of prose, filled in with what an experiment computed."""

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

__all__ = ["Figure", "Page", "markdown_table", "new_figure", "parser", "save", "told"]

DPI = 130
TEMPLATES = Path(__file__).parent / "pages"


@dataclass(frozen=True)
class Figure:
    """name: of its file, without ".png". draw: writes it."""

    name: str
    draw: Callable[[Path], None]


@dataclass(frozen=True)
class Page:
    """A page of results, made from the template of the same name in experiments/pages.

    name      of the template and of the page's file
    command   makes numbers and page anew: the template's $command
    values    numbers, tables and other text, by the template's placeholders
    figures   drawn beside the page; the template shows each of them and holds its caption
    origin    of the numbers: the template's $origin
    """

    name: str
    command: str
    values: Mapping[str, str]
    figures: Sequence[Figure]
    origin: Origin

    @property
    def markdown(self) -> str:
        """The template filled in. Raises KeyError where a placeholder has no value, and ValueError where a value or a
        figure has no place: a number that nobody shows is a mistake in one or the other."""
        template = Template((TEMPLATES / f"{self.name}.md").read_text(encoding="utf-8"))
        values = {**self.values, "command": self.command, "origin": self.origin.sentence()}
        places = {*template.get_identifiers(), *re.findall(r"\(figures/(\w+)\.png\)", template.template)}
        lost = sorted({*values, *(figure.name for figure in self.figures)} - places)
        if lost:
            raise ValueError(f"pages/{self.name}.md has no place for {', '.join(lost)}")
        return template.substitute(values)

    def publish(self, folder: Path) -> None:
        """Draws the figures and writes the page, each whole or not at all."""
        (folder / "figures").mkdir(parents=True, exist_ok=True)
        for figure in self.figures:
            figure.draw(folder / "figures" / f"{figure.name}.png")
        write_whole(folder / f"{self.name}.md", self.markdown.encode())
        print(f"page: {folder / self.name}.md")


def parser(text: str) -> argparse.ArgumentParser:
    """The option that every experiment has; help is the module's docstring."""
    found = argparse.ArgumentParser(description=text.split("\n")[0])
    found.add_argument("--docs", type=Path, default=Path("docs/results"), help="directory of page, figures and data")
    return found


def markdown_table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table; the first column is flush left, the others right."""
    lines = [header, ["---", *("---:" for _ in header[1:])], *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def told(name: str, work: Callable[[], None]) -> int:
    """0 once the work is done; 2, and one line, where it cannot be."""
    try:
        work()
    except (RunError, ExecutorError, ValueError, OSError) as error:
        print(f"{name}: error: {error}", file=sys.stderr)
        return 2
    return 0


def new_figure(width: float, height: float, columns: int = 1, rows: int = 1, **options: Any) -> tuple[Any, Any]:
    """A figure [inches] and its axes, without frame above and to the right."""
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
    """Write the figure and forget it."""
    from matplotlib import pyplot

    unfinished = path.with_suffix(".tmp.png")
    figure.savefig(unfinished, dpi=DPI, metadata={"Software": None})
    pyplot.close(figure)
    unfinished.replace(path)
