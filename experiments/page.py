"""A page of docs/results: question, answer, figures and table, and how to make them again."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from evolve.store.atomic_files import write_whole
from experiments.store import Origin

__all__ = ["Figure", "Page", "markdown_table", "new_figure", "parser", "save"]

DPI = 130


@dataclass(frozen=True)
class Figure:
    """name: of its file, without ".png". draw: writes it. caption: Markdown on one line."""

    name: str
    draw: Callable[[Path], None]
    caption: str


@dataclass(frozen=True)
class Page:
    """name: of the page's file. answer: begins with "Reproduced", "Partly", "Not" or what was found. method: prose.
    command: makes numbers and page anew. tables: Markdown.
    """

    name: str
    title: str
    question: str
    answer: str
    method: str
    command: str
    figures: Sequence[Figure]
    tables: Sequence[str]
    origin: Origin

    @property
    def markdown(self) -> str:
        pictures = [f"![{self.title}: {f.name}](figures/{f.name}.png)\n\n{f.caption}" for f in self.figures]
        parts = [
            f"# {self.title}",
            f"**Question.** {self.question}",
            f"**Answer.** {self.answer}",
            *pictures,
            *self.tables,
            f"**How.** {self.method}",
            f"```sh\n{self.command}\n```",
            f"Made in {self.origin.sentence()}",
        ]
        return "\n\n".join(parts) + "\n"

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
