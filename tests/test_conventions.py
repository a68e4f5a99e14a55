"""One form of docstring, one form of message, and one meaning per name."""

import ast
import re
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.sources import ROOT, SOURCES, tree

# A row explains arguments or fields: "name: meaning", "one, another: meaning".
ROW = re.compile(r"^(?P<names>[a-z_]\w*(?:, [a-z_]\w*)*): \S")
COLUMN = re.compile(r"^[a-z_]\w*(?:, [a-z_]\w*)* {2,}\S")
RAISES = re.compile(r"^Raises:\n((?:    .+\n?)+)", re.MULTILINE)
RAISED = re.compile(r"^    (?P<error>(?:optics\.)?[A-Z]\w+): \S")
RAISES_IN_PROSE = re.compile(r"\b[Rr]aises? (?:optics\.)?[A-Z]\w+")
Definition = ast.FunctionDef | ast.ClassDef


@dataclass(frozen=True)
class Documented:
    """A class or function, its location, and its docstring."""

    where: str
    node: Definition
    text: str


def documented(path: Path, module: ast.Module) -> list[Documented]:
    found = []
    for node in ast.walk(module):
        if isinstance(node, Definition) and (text := ast.get_docstring(node)):
            found.append(Documented(f"{path}:{node.lineno} {node.name}", node, text))
    return found


def faults(thing: Documented) -> list[str]:
    """Parts of a docstring that do not follow the form."""
    lines, found = thing.text.split("\n"), []
    found += [f"column of names: {line}" for line in lines if COLUMN.match(line)]
    prose = RAISES.sub("", thing.text)
    found += [f"errors in prose: {said[0]}" for said in RAISES_IN_PROSE.finditer(prose)]
    for block in RAISES.findall(thing.text):
        entries = [line for line in block.rstrip("\n").split("\n") if not line.startswith("     ")]
        found += [f"no error: {line.strip()}" for line in entries if not RAISED.match(line)]
    if thing.text.startswith("Raises:"):
        found.append("no first line")
    if "Raises:" in thing.text and not RAISES.search(thing.text):
        found.append("Raises: without errors")
    return found


def test_docstrings_have_one_form():
    things = [thing for path in SOURCES for thing in documented(path, tree(path))]
    assert {thing.where: wrong for thing in things if (wrong := faults(thing))} == {}


@pytest.mark.parametrize(
    "docstring",
    [
        "What it is.\n\n    radius  of it [m]\n    ",
        "What it is. Raises ValueError for no good.\n    ",
        "Raises:\n        ValueError: no good.\n    ",
        "What it is.\n\n    Raises:\n        no good\n    ",
    ],
    ids=["column", "prose", "no first line", "no error"],
)
def test_other_forms_are_noticed(docstring):
    [thing] = documented(Path("some.py"), ast.parse(f'def some(radius):\n    """{docstring}"""\n'))
    assert faults(thing)


# --- messages


def messages(module: ast.AST) -> list[str]:
    """Messages of raised errors, with {} in place of values."""
    found = []
    for node in ast.walk(module):
        if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call) and node.exc.args:
            first = node.exc.args[0]
            if isinstance(first, ast.Constant) and isinstance(first.value, str):
                found.append(first.value)
            elif isinstance(first, ast.JoinedStr):
                found.append("".join(part.value if isinstance(part, ast.Constant) else "{}" for part in first.values))
    return found


def ill_formed(message: str) -> bool:
    """Return whether a message breaks the form: first the error, then, after a colon or semicolon, the correct value
    ("name = value: must be ...")."""
    return "\n" in message or bool(re.search(r"^[^:;]*\bmust\b", message))


def test_messages_have_one_form():
    said = {path.relative_to(ROOT).as_posix(): messages(tree(path)) for path in SOURCES}
    assert [(path, message) for path, found in said.items() for message in found if ill_formed(message)] == []


def test_other_messages_are_noticed():
    module = ast.parse('raise ValueError(f"n = {n}, must be 1")\nraise ValueError("n = 0: must be 1")')
    assert [ill_formed(message) for message in messages(module)] == [True, False]


# --- names


def exported(path: Path) -> set[str]:
    """Classes and functions that other modules may use."""
    return {node.name for node in tree(path).body if isinstance(node, Definition) and node.name[0] != "_"}


def test_no_two_names_of_different_packages_are_alike():
    """Class names are unique within a package, too. Functions that are called by their module's name (`shapes.build`)
    may share a name."""
    homes = defaultdict(list)
    for path in SOURCES:
        for name in exported(path):
            homes[name].append(path.relative_to(ROOT))
    alike = {
        name: [str(path) for path in paths]
        for name, paths in homes.items()
        if len({path.parts[0] for path in paths}) > 1 or (name[0].isupper() and len(paths) > 1)
    }
    assert alike == {}
