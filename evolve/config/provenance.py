"""Location of a setting: a line of a TOML file, or a `--set` option."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from evolve.genome.genes import groups_of

__all__ = ["Source"]

Tree = dict[str, Any]
LONGEST_VALUE = 100  # maximum number of lines that a value may span


@dataclass(frozen=True)
class Source:
    """Settings from one source.

    name: name of the source in messages, such as a file's path, "--set seed=3" or "preset quick"; "" for a source that
        messages do not name
    tree: settings as nested tables
    text: TOML text of the settings; None if the source has no text
    """

    name: str
    tree: Tree
    text: str | None = None

    def place(self, key: str) -> str | None:
        """Return the location of `key` in this source, such as "mine.toml, line 7"; None if the source does not set it.

        A source may contain a setting for a whole group of genes instead of a single gene, for example
        `genome.optical.open` for all optical genes. The location is then that of the group's setting.

        key: dotted name of the setting, such as "genome.dispersion.open"
        """
        for path in _spellings(key):
            if not _holds(self.tree, path):
                continue
            line = None if self.text is None else _line_of(self.text, path)
            return self.name if line is None else f"{self.name}, line {line}"
        return None


def _spellings(key: str) -> Iterator[list[str]]:
    """Yield the parts of a dotted key.

    If the key belongs to a gene, also yield the keys of the groups that contain the gene, the smallest group first. In
    these keys, the name of the group (for example "optical") replaces the name of the gene.
    """
    path = key.split(".")
    yield path
    if path[0] == "genome" and len(path) > 1:
        for group in groups_of(path[1]):
            yield ["genome", group, *path[2:]]


def _line_of(text: str, path: list[str]) -> int | None:
    """Return the number of a setting's last line; None if the search meets a value of more than 100 lines.

    That value may belong to another setting. tomllib does not report line numbers. If the first n lines contain the
    setting, any larger number of lines also contains it. Bisection therefore finds the smallest n.
    """
    lines = text.splitlines(keepends=True)
    low, high = 0, len(lines)  # the first `low` lines do not contain the setting; the first `high` lines do
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
    """Return the smallest number of lines, at least `count`, that can be parsed, and the settings in these lines.

    Lines that end in the middle of a multi-line value cannot be parsed. If more than 100 additional lines are needed,
    the result is (count, None).
    """
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
