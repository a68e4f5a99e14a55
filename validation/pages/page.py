"""Pages of proofs: a script's docstring and table, printed, drawn and optionally written to the docs.

The docstring is the page's text: its first line is the title, and an indented line is the command.
"""

from __future__ import annotations

import argparse
import os
import re
from collections.abc import Callable
from dataclasses import dataclass
from inspect import cleandoc
from pathlib import Path

__all__ = ["Page", "blanked", "parser"]


@dataclass(frozen=True)
class Page:
    """A proof's page.

    name: name of script, figure and page.
    broken: descriptions of the bounds that do not hold.
    """

    name: str
    text: str
    table: str
    broken: list[str]

    @property
    def markdown(self) -> str:
        title, _, prose = cleandoc(self.text).partition("\n")
        figure = f"The command draws `validation/figures/{self.name}.png`."
        return f"# {title}\n\n{prose.strip()}\n\n{figure}\n\n```\n{self.table}\n```\n"

    @property
    def file_name(self) -> str:
        return f"{self.name}.md"

    def publish(self, options: argparse.Namespace, draw: Callable[[Path], None]) -> int:
        """Print table and verdict, draw the figure into --out, write the page into --docs; return the exit code."""
        print(self.table)
        options.out.mkdir(parents=True, exist_ok=True)
        figure = options.out / f"{self.name}.png"
        draw(figure)
        print(f"figure: {figure}")
        if options.docs:
            options.docs.mkdir(parents=True, exist_ok=True)
            path = options.docs / self.file_name
            unfinished = path.with_suffix(".tmp")
            unfinished.write_text(self.markdown, encoding="utf-8")
            os.replace(unfinished, path)
            print(f"page: {path}")
        print("\n".join(self.broken) if self.broken else "all bounds hold")
        return 1 if self.broken else 0


def parser(text: str) -> argparse.ArgumentParser:
    """Return the argument parser with the options of all pages."""
    found = argparse.ArgumentParser(description=text.split("\n")[0])
    found.add_argument("--out", type=Path, default=Path("validation/figures"), help="directory for the figure")
    found.add_argument("--docs", type=Path, help="directory for the page, docs/validation for the stored one")
    return found


def blanked(markdown: str) -> str:
    """Return a page with its numbers replaced, because their last digits differ between machines."""
    without = re.sub(r"[-+]?(\d[\d.]*(e[-+]?\d+)?|\binf\b|\bnan\b)", "#", markdown)
    return re.sub(r"[ -]+", " ", without)
