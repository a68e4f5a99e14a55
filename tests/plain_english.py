"""Markers of compressed or translated English in documents, docstrings, comments and messages.

    ./with-env python -m tests.plain_english                    # one line per kind of text and folder
    ./with-env python -m tests.plain_english sim/render --show  # each marker, with file and line

A marker is an indicator, not a fault: some are right where they stand. Well-kept projects have up to about one in 1,000
words. Code blocks, tables and inline code of documents are left out, and so are file names of pages.
"""

from __future__ import annotations

import argparse
import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FOLDERS = ("optics", "sim", "evolve", "rhabdom", "validation", "experiments", "examples", "tests")
PAGES = ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "SECURITY.md", "docs")
CODE = tuple(
    re.compile(pattern, flags) for pattern, flags in ((r"```.*?```", re.S), (r"^\|.*$", re.M), (r"`[^`]*`", 0))
)
LINK = re.compile(r"\]\([^)]*\)")
# Strings are matched too, so that a "#" in a string does not count as a comment. Python's tokenizer takes 18 times as
# long.
STRING_OR_COMMENT = re.compile(
    r'''"{3}[^"\\]*(?:(?:\\.|"(?!""))[^"\\]*)*"{3}|"[^"\\]*(?:\\.[^"\\]*)*"'''
    r"""|'{3}[^'\\]*(?:(?:\\.|'(?!''))[^'\\]*)*'{3}|'[^'\\]*(?:\\.[^'\\]*)*'|(?P<comment>\#[^\n]*)""",
    re.DOTALL,
)
MARKERS = {
    name: re.compile(pattern, re.MULTILINE)
    for name, pattern in {
        "anew": r"\banew\b",
        "beside": r"\bbeside\b",
        "one's own": r"\b(one|somebody|anybody)'s own\b",
        "nobody": r"\b(some|no|any)body\b|\bwhoever\b",
        "in silence": r"\bin silence\b",
        "would do": r"\b(will|would|did|do) (not )?do\b[ ,.;:]",
        "held against": r"\b(held|hold|holds|holding) .{0,40}?against\b",
        "err by": r"\b(err|errs|erred) (by|up|at|as|about|less|more)\b",
        "asked for": r"\b(asked|asks|ask) for\b",
        "told": r"\b(told|tells|tell)\b",
        "looked at again": r"\blooked at again\b|\blooks again\b|\bseen anew\b|\blooked at for\b",
        "as X has it": r"\bas [A-Za-z' ]{2,30} (has|have|had) it\b",
        "What ... is": r"(?:^|[.;:]\s)What (?:[a-z]+ ){1,8}(?:is|are|was|were)\b",
        "of what": r"\bof (what|which|whom)\b",
        "those that": r"\bthose (that|who|which|of)\b",
        "but for": r"\bbut for\b",
        "as many as": r"\bas (many|few|much|little)\b",
        "so many": r"\bso (many|few|much|little)\b",
        "no more than": r"\bno (more|less|longer|fewer) than\b",
        "be it": r"\bbe (it|they)\b",
        "where (if)": r"\bwhere (one|it|they|there|that|this|nothing|rays|what)\b",
        "first to last": r"\bfrom first to last\b",
        "elsewhere": r"\bput elsewhere\b",
        "wants": r"\b(wants|knows|remembers|is content)\b",
        "which is no": r"\b(is|are|was|were) no\b",
        "no zero": r"(?<![\d\w.])\.\d+\b",
    }.items()
}


@dataclass(frozen=True)
class Text:
    """A piece of prose: its kind ("document", "docstring", "comment" or "message"), its file, and its first line."""

    kind: str
    path: Path
    line: int
    text: str

    @property
    def words(self) -> int:
        """Number of words."""
        return len(self.text.split())

    @cached_property
    def markers(self) -> list[tuple[str, str]]:
        """Name of each marker, and the words that it matches."""
        return [(name, match[0]) for name, marker in MARKERS.items() for match in marker.finditer(self.text)]


def document(path: Path) -> Text:
    """The prose of a Markdown page."""
    text = path.read_text(encoding="utf-8")
    for pattern in CODE:
        text = pattern.sub(" ", text)
    return Text("document", path, 1, LINK.sub("] ", text))


def texts_in(path: Path) -> Iterator[Text]:
    """Docstrings, comments and messages of a Python file."""
    source = path.read_text(encoding="utf-8")
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            if text := ast.get_docstring(node):
                yield Text("docstring", path, getattr(node, "lineno", 1), _without_code(text))
        elif message := _message(node):
            yield Text("message", path, getattr(node, "lineno", 1), message)
    for found in STRING_OR_COMMENT.finditer(source):
        comment = found["comment"]
        if comment and not re.match(r"#\s*(noqa|type:|ruff:|!)", comment):
            line = source.count("\n", 0, found.start()) + 1
            yield Text("comment", path, line, _without_code(comment.lstrip("# ")))


def texts(names: tuple[str, ...] = (*PAGES, *FOLDERS)) -> list[Text]:
    """All prose below these files and folders."""
    paths = [
        path for name in names for path in ([ROOT / name] if (ROOT / name).is_file() else (ROOT / name).rglob("*"))
    ]
    pages = [document(path) for path in sorted(paths) if path.suffix == ".md"]
    return pages + [text for path in sorted(paths) if path.suffix == ".py" for text in texts_in(path)]


def rate(found: list[Text]) -> float:
    """Markers per 1,000 words."""
    return 1000 * sum(len(text.markers) for text in found) / max(sum(text.words for text in found), 1)


def _without_code(text: str) -> str:
    return re.sub(r"`[^`]*`", " ", text)


def _message(node: ast.AST) -> str:
    """Return words that a user may read: errors, warnings and help texts of options."""
    if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call):
        return _without_code(" ".join(_strings(node.exc)))
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in ("warn", "error"):
        return _without_code(" ".join(_strings(node)))
    if isinstance(node, ast.keyword) and node.arg == "help":
        return _without_code(" ".join(_strings(node.value)))
    return ""


def _strings(node: ast.AST) -> list[str]:
    """Return the string constants of an expression, without format specifications such as ".3g"."""
    if isinstance(node, ast.Constant):
        return [node.value] if isinstance(node.value, str) else []
    if isinstance(node, ast.FormattedValue):
        return _strings(node.value)
    return [text for child in ast.iter_child_nodes(node) for text in _strings(child)]


def main() -> None:
    """Count markers."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("names", nargs="*", default=(*PAGES, *FOLDERS), help="files and folders")
    parser.add_argument("--show", action="store_true", help="print each marker")
    options = parser.parse_args()
    for name in options.names:
        found = texts((name,))
        for kind in dict.fromkeys(text.kind for text in found):
            mine = [text for text in found if text.kind == kind]
            print(f"{name}: {rate(mine):.1f} per 1,000 words of {kind}s ({sum(text.words for text in mine)} words)")
        for text in found if options.show else []:
            for marker, words in text.markers:
                print(f"{text.path.relative_to(ROOT)}:{text.line}: {marker}: {words.strip()!r}")


if __name__ == "__main__":
    main()
