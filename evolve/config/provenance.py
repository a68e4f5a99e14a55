"""Where a setting stands: the line of a TOML file, or the `--set` that made it."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from evolve.genome.genes import groups_of

__all__ = ["Source"]

Tree = dict[str, Any]
LONGEST_VALUE = 100  # lines


@dataclass(frozen=True)
class Source:
    """Settings from one place.

    name: as messages call it: a file's path, "--set fov_deg=3", "preset quick"; "" for what needs no name
    tree: the settings, as nested tables
    text: the TOML they were read from; None where there is none
    """

    name: str
    tree: Tree
    text: str | None = None

    def place(self, key: str) -> str | None:
        """ "mine.toml, line 7", where this source sets `key` (dotted; a gene also through its groups), else None."""
        for path in _spellings(key):
            if not _holds(self.tree, path):
                continue
            line = None if self.text is None else _line_of(self.text, path)
            return self.name if line is None else f"{self.name}, line {line}"
        return None


def _spellings(key: str) -> Iterator[list[str]]:
    """The key's parts, then those under which a group of genes sets it, the narrowest first."""
    path = key.split(".")
    yield path
    if path[0] == "genome" and len(path) > 1:
        for group in groups_of(path[1]):
            yield ["genome", group, *path[2:]]


def _line_of(text: str, path: list[str]) -> int | None:
    """The line that ends the setting of `path`: the first after which the file, cut off there, holds it.

    tomllib keeps no positions. What a file cut off at a line holds, it holds when cut off later, so halving finds the
    line. None where a value spans more lines than LONGEST_VALUE.
    """
    lines = text.splitlines(keepends=True)
    low, high = 0, len(lines)  # cut off at low, it does not hold it; at high it does
    while high - low > 1:
        middle = (low + high) // 2
        cut, tree = _parsed_from(lines, middle)
        if tree is None:
            return None
        if _holds(tree, path):
            high = middle
        else:
            low = min(cut, high - 1)
    return _parsed_from(lines, high)[0]


def _parsed_from(lines: list[str], count: int) -> tuple[int, Tree | None]:
    """The first place from `count` on where the file can be cut off, and what it holds then: inside a value that spans
    lines it does not parse."""
    for cut in range(count, min(count + LONGEST_VALUE, len(lines)) + 1):
        try:
            return cut, tomllib.loads("".join(lines[:cut]))
        except tomllib.TOMLDecodeError:
            continue
    return count, None


def _holds(tree: Any, path: list[str]) -> bool:
    for part in path:
        if not isinstance(tree, dict) or part not in tree:
            return False
        tree = tree[part]
    return True
