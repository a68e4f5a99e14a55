"""Possible mutations of the modules of the three packages: one small change at one place each.

Mutations are typical human mistakes: a sign, a comparison, a bound off by one, an omitted check or call, swapped axes
or arguments, a maximum instead of a minimum. Messages, annotations and docstrings are never changed.
"""

from __future__ import annotations

import ast
import hashlib
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

__all__ = ["Site", "drawn", "sites"]

COMPARISONS: dict[type[ast.cmpop], tuple[str, str]] = {
    ast.Lt: ("<", "<="),
    ast.LtE: ("<=", "<"),
    ast.Gt: (">", ">="),
    ast.GtE: (">=", ">"),
    ast.Eq: ("==", "!="),
    ast.NotEq: ("!=", "=="),
    ast.In: ("in", "not in"),
    ast.NotIn: ("not in", "in"),
    ast.Is: ("is", "is not"),
    ast.IsNot: ("is not", "is"),
}
OPERATORS: dict[type[ast.operator], tuple[str, str]] = {
    ast.Add: ("+", "-"),
    ast.Sub: ("-", "+"),
    ast.Mult: ("*", "/"),
    ast.Div: ("/", "*"),
    ast.BitAnd: ("&", "|"),
    ast.BitOr: ("|", "&"),
}
NAMES = {
    "min": "max",
    "max": "min",
    "minimum": "maximum",
    "maximum": "minimum",
    "any": "all",
    "all": "any",
    "floor": "ceil",
    "ceil": "floor",
    "sin": "cos",
    "cos": "sin",
    "argmin": "argmax",
    "argmax": "argmin",
}
ORDERED = ("arctan2", "atan2", "cross", "divmod", "meshgrid", "where", "searchsorted")  # by order of arguments


@dataclass(frozen=True)
class Site:
    """A change to one place of a file: bytes from `start` to `end`, which read `before`, become `after`.

    line: number of the line, counted from 1.
    kind: kind of mistake.
    same: number of earlier sites with an equal change of an equal line.
    """

    path: str
    line: int
    kind: str
    start: int
    end: int
    before: str
    after: str
    text: str
    same: int = 0

    @property
    def change(self) -> str:
        """Description of the change, which does not depend on changes of other lines."""
        return " ".join(f"{self.before} -> {self.after}  |  {self.text}".split()) + f" #{self.same}" * (self.same > 0)

    def applied(self, source: bytes) -> bytes:
        """Return the file with the mistake in it.

        Raises:
            ValueError: the file has changed in the meantime.
        """
        if source[self.start : self.end] != self.before.encode():
            raise ValueError(f"{self.path}: has changed at line {self.line}")
        return source[: self.start] + self.after.encode() + source[self.end :]

    def chance(self, seed: int) -> str:
        """Return a hash that determines the site's place in a random order, whatever other files and lines contain."""
        return hashlib.sha256(f"{seed} {self.path} {self.kind} {self.change}".encode()).hexdigest()


def sites(path: str, source: bytes) -> list[Site]:
    """Return all mutations of one file, in its order."""
    found = sorted(_Finder(path, source).all(), key=lambda site: (site.start, site.end))
    seen: Counter[tuple[str, str, str]] = Counter()
    numbered = []
    for site in found:
        key = (site.before, site.after, site.text)
        numbered.append(Site(**{**vars(site), "same": seen[key]}))
        seen[key] += 1
    return numbered


def drawn(root: Path, package: str, count: int, seed: int) -> list[Site]:
    """Return a random sample of the mutations of a package's modules, evenly drawn."""
    modules = sorted(path for path in (root / package).rglob("*.py") if path.name != "__init__.py")
    everything = [site for path in modules for site in sites(str(path.relative_to(root)), path.read_bytes())]
    return sorted(everything, key=lambda site: site.chance(seed))[:count]


class _Finder:
    """Visitor of one file's syntax tree; positions are in bytes."""

    def __init__(self, path: str, source: bytes) -> None:
        self.path, self.source = path, source
        self.lines = source.split(b"\n")
        self.offsets = [0]
        for line in self.lines:
            self.offsets.append(self.offsets[-1] + len(line) + 1)

    def all(self) -> Iterator[Site]:
        yield from self._below(ast.parse(self.source))

    def _below(self, node: ast.AST) -> Iterator[Site]:
        for name, value in ast.iter_fields(node):
            if name in ("annotation", "returns", "decorator_list", "bases"):
                continue
            for child in value if isinstance(value, list) else [value]:
                if isinstance(child, ast.AST) and not self._left_alone(child):
                    yield from self._here(child)
                    yield from self._below(child)

    def _left_alone(self, node: ast.AST) -> bool:
        """Return whether a node is text, a type, or code that no user's program runs."""
        if isinstance(node, ast.Assign):
            names = [target.id for target in node.targets if isinstance(target, ast.Name)]
            return "__all__" in names
        if isinstance(node, ast.If):
            return "TYPE_CHECKING" in ast.unparse(node.test) or "__main__" in ast.unparse(node.test)
        return isinstance(node, ast.JoinedStr | ast.Raise)

    def _here(self, node: ast.AST) -> Iterator[Site]:
        looks = {
            ast.Compare: self._comparison,
            ast.BinOp: self._operator,
            ast.UnaryOp: self._unary,
            ast.BoolOp: self._logic,
            ast.Call: self._call,
            ast.Attribute: self._attribute,
            ast.Subscript: self._subscript,
            ast.If: self._check,
            ast.Expr: self._statement,
            ast.Assign: self._targets,
        }
        if type(node) in looks:
            yield from looks[type(node)](node)

    # --- kinds of mistakes

    def _comparison(self, node: ast.Compare) -> Iterator[Site]:
        operands = [node.left, *node.comparators]
        for left, right, op in zip(operands, operands[1:], node.ops, strict=False):
            yield from self._between("comparison", left, right, *COMPARISONS[type(op)])
        for operand in operands:
            yield from self._number("bound", operand)

    def _operator(self, node: ast.BinOp) -> Iterator[Site]:
        if type(node.op) not in OPERATORS or _is_type(node):
            return
        kind = {ast.Add: "sign", ast.Sub: "sign", ast.Mult: "factor", ast.Div: "factor"}.get(type(node.op), "logic")
        yield from self._between(kind, node.left, node.right, *OPERATORS[type(node.op)])
        if kind == "sign":
            yield from self._number("bound", node.right)

    def _unary(self, node: ast.UnaryOp) -> Iterator[Site]:
        kind = "sign" if isinstance(node.op, ast.USub) else "logic"
        if not isinstance(node.op, ast.UAdd):
            start = self._start(node)
            operator = re.match(rb"not\s+|.", self.source[start:])
            assert operator is not None, "an operator precedes its operand"
            yield self._site(kind, start, start + operator.end(), "")

    def _logic(self, node: ast.BoolOp) -> Iterator[Site]:
        words = ("and", "or") if isinstance(node.op, ast.And) else ("or", "and")
        yield from self._between("logic", node.values[0], node.values[1], *words)

    def _call(self, node: ast.Call) -> Iterator[Site]:
        name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        if name in NAMES:
            end = self._end(node.func)
            yield self._site("extreme", end - len(name), end, NAMES[name])
        for keyword in node.keywords:
            axis = keyword.value
            if keyword.arg == "axis" and isinstance(axis, ast.Constant) and isinstance(axis.value, int):
                yield self._site("axes", self._start(axis), self._end(axis), "1" if axis.value == 0 else "0")
        if name in ORDERED and len(node.args) >= 2:
            first, second = node.args[-2:]
            yield self._swap(first, second)
        if name == "range":
            yield from self._number("bound", node.args[-1])

    def _attribute(self, node: ast.Attribute) -> Iterator[Site]:
        if node.attr == "T":
            yield self._site("axes", self._end(node) - len(".T"), self._end(node), "")

    def _subscript(self, node: ast.Subscript) -> Iterator[Site]:
        parts = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        for part in parts:
            for end in [part.lower, part.upper] if isinstance(part, ast.Slice) else [part]:
                if end is not None and not _is_type(node):
                    yield from self._number("bound", end)

    def _check(self, node: ast.If) -> Iterator[Site]:
        if len(node.body) == 1 and isinstance(node.body[0], ast.Raise):
            yield self._site("check", self._start(node.body[0]), self._end(node.body[0]), "pass")

    def _statement(self, node: ast.Expr) -> Iterator[Site]:
        if isinstance(node.value, ast.Call):
            yield self._site("call", self._start(node), self._end(node), "pass")

    def _targets(self, node: ast.Assign) -> Iterator[Site]:
        [target, *more] = node.targets
        if not more and isinstance(target, ast.Tuple) and len(target.elts) == 2:
            first, second = target.elts
            if isinstance(first, ast.Name) and isinstance(second, ast.Name) and "_" not in (first.id, second.id):
                yield self._swap(first, second)

    # --- places

    def _number(self, kind: str, node: ast.AST) -> Iterator[Site]:
        if isinstance(node, ast.Constant) and type(node.value) in (int, float):
            yield self._site(kind, self._start(node), self._end(node), repr(node.value + 1))

    def _swap(self, first: ast.AST, second: ast.AST) -> Site:
        start, end = self._start(first), self._end(second)
        between = self.source[self._end(first) : self._start(second)].decode()
        swapped = f"{self._text(second)}{between}{self._text(first)}"
        return self._site("axes", start, end, swapped)

    def _between(self, kind: str, left: ast.AST, right: ast.AST, before: str, after: str) -> Iterator[Site]:
        """Yield the site of the operator between two operands."""
        low, high = self._end(left), self._start(right)
        pattern = r"\b" + before.replace(" ", r"\s+") + r"\b" if before[0].isalpha() else re.escape(before)
        match = re.search(pattern, self.source[low:high].decode())
        if match is not None:
            yield self._site(kind, low + match.start(), low + match.end(), after)

    def _site(self, kind: str, start: int, end: int, after: str) -> Site:
        line = self.source.count(b"\n", 0, start) + 1
        before, text = self.source[start:end].decode(), self.lines[line - 1].decode().strip()
        return Site(self.path, line, kind, start, end, before, after, text)

    def _start(self, node: ast.AST) -> int:
        return self.offsets[node.lineno - 1] + node.col_offset  # type: ignore[attr-defined]

    def _end(self, node: ast.AST) -> int:
        return self.offsets[node.end_lineno - 1] + node.end_col_offset  # type: ignore[attr-defined]

    def _text(self, node: ast.AST) -> str:
        return self.source[self._start(node) : self._end(node)].decode()


def _is_type(node: ast.AST) -> bool:
    """Return whether a node is a union or subscript of type names, such as `int | None` or `Sequence[int]`."""
    if isinstance(node, ast.BinOp):
        return isinstance(node.op, ast.BitOr) and (_is_type(node.left) or _is_type(node.right))
    if isinstance(node, ast.Subscript):
        return _is_type(node.value)
    name = node.attr if isinstance(node, ast.Attribute) else getattr(node, "id", "")
    return name[:1].isupper() or name in ("int", "float", "str", "tuple", "list", "dict", "bool", "bytes", "type")
