"""Notebooks made from the tutorials: docs/tutorial/NAME.md becomes docs/notebooks/NAME.ipynb.

    python docs/site/notebooks.py

Python blocks become cells to run; everything else, commands and outputs that the page shows included, stays text.
"""

from __future__ import annotations

import re
from pathlib import Path

import nbformat

DOCS = Path(__file__).resolve().parents[1]
TUTORIALS = ("optics", "rl", "evolution", "own_world", "python")
CODE = re.compile(r"```python\n(.*?)```(?:\n+```text\n.*?```)?\n*", re.DOTALL)
LINK = re.compile(r"\]\((?!https?:|#)([^)]+?)\)")
REFERENCE = re.compile(r"\[(`[^`]+`)\]\[\]")


def notebook(page: str) -> nbformat.NotebookNode:
    """A tutorial page as a notebook; the same page gives the same notebook."""
    pieces = CODE.split(page)
    cells = [_cell(piece, at % 2 == 1) for at, piece in enumerate(pieces) if piece.strip()]
    for number, cell in enumerate(cells):
        cell["id"] = f"cell-{number}"
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    return nbformat.v4.new_notebook(cells=cells, metadata={"kernelspec": kernel, "language_info": {"name": "python"}})


def _cell(piece: str, is_code: bool) -> nbformat.NotebookNode:
    if is_code:
        return nbformat.v4.new_code_cell(piece.rstrip())
    prose = REFERENCE.sub(r"\1", LINK.sub(_from_here, piece))
    return nbformat.v4.new_markdown_cell(prose.strip())


def _from_here(link: re.Match[str]) -> str:
    """Links as they lead from docs/notebooks, beside docs/tutorial: to a page of the tutorial itself by its folder."""
    target = link[1]
    return f"]({target if target.startswith('../') else f'../tutorial/{target}'})"


def main() -> None:
    """Write all notebooks."""
    for name in TUTORIALS:
        page = (DOCS / "tutorial" / f"{name}.md").read_text(encoding="utf-8")
        path = DOCS / "notebooks" / f"{name}.ipynb"
        path.write_text(nbformat.writes(notebook(page)) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
