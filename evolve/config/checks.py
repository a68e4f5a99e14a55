"""Checking single settings: kind and range, or one line that says what would be right."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import fields
from typing import Any

import numpy as np

from evolve.genome.eye_config import AUTO
from evolve.genome.genes import Gene, GeneConfig
from evolve.genome.interval import Interval
from optics.numerics.arguments import close_match, shown

__all__ = [
    "AUTO",
    "ConfigError",
    "check_gene_use",
    "check_gene_value",
    "check_value",
    "check_values",
    "quoted",
    "suggestion",
]

SHOWN = 200  # letters of a value that a message quotes
MOST_LISTED = 36  # of known words: all genes and tasks, and not all settings


class ConfigError(ValueError):
    """A setting that cannot be used; the message is one line naming key, value and what is allowed.

    keys: dotted names of the settings to blame, so that whoever knows where they were set can say so
    """

    def __init__(self, message: str, *keys: str) -> None:
        super().__init__(message)
        self.keys = keys


def check_value(cls: type, name: str, value: Any, key: str) -> Any:
    """`value` as field `name` of `cls` takes it.

    Raises:
        ConfigError: one line, naming `key`, the value and what is allowed.
    """
    definition = next(f for f in fields(cls) if f.name == name)
    if definition.type == "float | str":
        if isinstance(value, str) and value == AUTO:
            return value
        if isinstance(value, str):
            raise ConfigError(f"{key} = {value!r}: must be a number or {AUTO!r}", key)
    kind = {"int": int, "float": float, "float | str": float, "bool": bool, "str": str}[str(definition.type)]
    return _checked(value, kind, definition.metadata.get("valid"), key)


def check_values(settings: Any, names: Iterable[str] | None = None, prefix: str = "") -> None:
    """Those of a frozen dataclass of settings, or the named ones of them.

    Raises:
        ConfigError: see above.
    """
    for name in [one.name for one in fields(settings)] if names is None else names:
        value = check_value(type(settings), name, getattr(settings, name), f"{prefix}{name}")
        object.__setattr__(settings, name, value)  # Python's number for NumPy's


def check_gene_value(gene: Gene, name: str, value: Any, key: str) -> Any:
    """`value` as a gene's "open", "low", "high", "start" or "opens_at" takes it.

    Raises:
        ConfigError: see above.
    """
    if name == "open":
        return _checked(value, bool, None, key)
    if name == "opens_at":
        return _checked(value, int, Interval(0, 100_000), key)
    return float(_checked(value, int if gene.kind == "integer" else float, gene.range, key))


def check_gene_use(gene: Gene, use: GeneConfig) -> None:
    """A gene's search range must be one, and hold its start.

    Raises:
        ConfigError: it is none, or does not.
    """
    key = f"genome.{gene.name}"
    if use.start not in gene.range or math.isnan(use.start):
        raise ConfigError(f"{key}.start = {use.start:g}: must be in {gene.range}", f"{key}.start")
    if not use.open:
        return
    keys = (f"{key}.low", f"{key}.high", f"{key}.start")
    if not use.low < use.high:
        raise ConfigError(f"{key}: open, but low = {use.low:g} is not below high = {use.high:g}", *keys[:2])
    if not use.low <= use.start <= use.high:
        raise ConfigError(
            f"{key}.start = {use.start:g}: must be in the searched range [{use.low:g}, {use.high:g}]", *keys
        )


def suggestion(word: Any, known: Iterable[str]) -> str:
    """ "did you mean X?" where a known word, or the last part of one, is near; else the list of them, the first
    MOST_LISTED of it."""
    known, word = list(known), str(word)
    by_last = {name.rpartition(".")[2]: name for name in known}
    last = close_match(word.rpartition(".")[2], by_last, cutoff=0.75)
    close = close_match(word, known) or (by_last[last] if last else None)
    if close:
        return f"did you mean {close!r}?"
    more = f", and {len(known) - MOST_LISTED} more: see evolve config schema" if len(known) > MOST_LISTED else ""
    return f"known: {', '.join(known[:MOST_LISTED])}{more}"


def _checked(value: Any, kind: type[Any], valid: Interval | None, key: str) -> Any:
    """`value`, if it is of this kind (a whole number may stand for a number) and in `valid`."""
    names = {int: "an integer", float: "a number", bool: "true or false", str: "text"}
    shown = str(value).lower() if isinstance(value, bool) else quoted(value)
    allowed = names[kind] if valid is None else f"{names[kind]} in {valid}"
    value = value.item() if isinstance(value, np.generic) else value
    try:
        if kind is float and type(value) is int:
            value = float(value)
        if type(value) is not kind:
            raise ConfigError(f"{key} = {shown}: must be {allowed}", key)
        if valid is not None and value not in valid:
            raise ConfigError(f"{key} = {shown}: must be in {valid}", key)
    except OverflowError:  # a whole number that no float comes near
        raise ConfigError(f"{key} = {shown}: must be {allowed}", key) from None
    return value


def quoted(value: Any) -> str:
    """As a message shows it, on one line."""
    try:
        whole = repr(value) if isinstance(value, str) else shown(value)
    except ValueError:  # more digits than Python writes
        return "a number of thousands of digits"
    return whole if len(whole) <= SHOWN else f"{whole[:SHOWN]}..."
