"""Patterns in the navigation of mkdocs.yml: each stands for all pages it matches that are not named elsewhere.

A section without pages disappears. Long titles are cut to their first clause in the menu; the page keeps its own.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

Entry = Any  # of MkDocs' nav: a path, or {title: path or list of entries}


def on_config(config: Any) -> Any:
    """MkDocs calls it once the configuration has been read."""
    config.nav = resolved(config.nav, Path(config.docs_dir))
    return config


def resolved(nav: list[Entry], docs: Path) -> list[Entry]:
    """The navigation with its patterns replaced by pages."""
    named = {path for path in _paths(nav) if "*" not in path}
    return _resolved(nav, docs, named)


def _paths(nav: list[Entry]) -> list[str]:
    found = []
    for entry in nav:
        for content in entry.values() if isinstance(entry, dict) else [entry]:
            found += _paths(content) if isinstance(content, list) else [content]
    return found


def _resolved(nav: list[Entry], docs: Path, named: set[str]) -> list[Entry]:
    entries: list[Entry] = []
    for entry in nav:
        if isinstance(entry, dict):
            sections = {
                title: _resolved(content, docs, named) if isinstance(content, list) else content
                for title, content in entry.items()
            }
            entries += [{title: content} for title, content in sections.items() if content]
        elif "*" in entry:
            pages = sorted(path.relative_to(docs).as_posix() for path in docs.glob(entry))
            entries += [{_title(docs / page): page} for page in pages if page not in named]
        else:
            entries.append(entry)
    return entries


def _title(page: Path) -> str:
    """The first clause of the page's heading: "050: Every picture by Dr.Jit"."""
    heading = re.search(r"^# (.+)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    if heading is None:
        return page.stem
    number, colon, words = heading[1].partition(": ")
    return number + colon + re.split(r"[:,?.;](?:\s|$)", words)[0]  # "Dr.Jit" is one word
