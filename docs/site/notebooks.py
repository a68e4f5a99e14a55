"""Make notebooks from pages: docs/tutorial/NAME.md becomes docs/notebooks/NAME.ipynb, for all pages in `SOURCES`.

    python docs/site/notebooks.py

The first cell of each notebook is `notebook_setup.py`, which installs rhabdom if it is missing. Python blocks become
code cells. The output or the image that follows a block is left out, because the cell produces it. Everything else
stays text.
"""

from __future__ import annotations

import re
from pathlib import Path

import nbformat

DOCS = Path(__file__).resolve().parents[1]
SETUP = Path(__file__).with_name("notebook_setup.py").read_text(encoding="utf-8")
TUTORIALS = ("optics", "rl", "evolution", "own_world", "python")
# Name of each notebook and its page.
SOURCES = {name: DOCS / "tutorial" / f"{name}.md" for name in TUTORIALS}
SOURCES |= {f"lesson_{page.stem}": page for page in sorted((DOCS / "lesson").glob("*.md"))}
CODE = re.compile(r"```python\n(.*?)```(?:\n+```text\n.*?```)?(?:\n+!\[[^\]]*\]\([^)]*\))?\n*", re.DOTALL)
LINK = re.compile(r"\]\((?!https?:|#)([^)]+?)\)")
REFERENCE = re.compile(r"\[(`[^`]+`)\]\[\]")


def notebook(page: Path) -> nbformat.NotebookNode:
    """A page as a notebook; the same page gives the same notebook."""
    pieces = CODE.split(page.read_text(encoding="utf-8"))
    cells = [nbformat.v4.new_code_cell(SETUP.rstrip())]
    cells += [_cell(piece, at % 2 == 1, page.parent.name) for at, piece in enumerate(pieces) if piece.strip()]
    for number, cell in enumerate(cells):
        cell["id"] = f"cell-{number}"
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    return nbformat.v4.new_notebook(cells=cells, metadata={"kernelspec": kernel, "language_info": {"name": "python"}})


def _cell(piece: str, is_code: bool, folder: str) -> nbformat.NotebookNode:
    if is_code:
        return nbformat.v4.new_code_cell(piece.rstrip())
    prose = LINK.sub(lambda link: f"]({_from_notebooks(link[1], folder)})", piece)
    return nbformat.v4.new_markdown_cell(REFERENCE.sub(r"\1", prose).strip())


def _from_notebooks(target: str, folder: str) -> str:
    """A link's target relative to docs/notebooks instead of the page's folder in docs; a page that has a notebook is
    replaced by it."""
    page = (DOCS / folder / target).resolve()
    found = [f"{name}.ipynb" for name, source in SOURCES.items() if source == page]
    return found[0] if found else target if target.startswith("../") else f"../{folder}/{target}"


def main() -> None:
    """Write all notebooks."""
    for name, page in SOURCES.items():
        path = DOCS / "notebooks" / f"{name}.ipynb"
        path.write_text(nbformat.writes(notebook(page)) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
