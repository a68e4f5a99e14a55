"""Checks of the type and range of single settings. Error messages are one line that names the allowed values."""

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

SHOWN = 200  # maximum number of characters of a value in a message
MOST_LISTED = 36  # maximum number of words listed in a message; all genes or tasks fit, but not all settings


class ConfigError(ValueError):
    """A setting or an argument is invalid. The message is one line that names it, its value and the allowed values.

    keys: dotted names of the settings that caused the error; callers use them to find where each setting was made
    """

    def __init__(self, message: str, *keys: str) -> None:
        super().__init__(message)
        self.keys = keys


def check_value(cls: type, name: str, value: Any, key: str) -> Any:
    """Return a setting's value after a check, converted to the type of the field `name` of the dataclass `cls`.

    Integers are converted for fields of type float, and NumPy numbers to Python numbers.

    key: dotted name of the setting, for the error message

    Raises:
        ConfigError: the value is invalid. The message is one line that names `key`, the value and the allowed values.
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
    """Check all settings of a frozen dataclass, or only those in `names`, and convert NumPy numbers in place.

    prefix: beginning of the settings' dotted names in messages, such as "eye."

    Raises:
        ConfigError: see `check_value`.
    """
    for name in [one.name for one in fields(settings)] if names is None else names:
        value = check_value(type(settings), name, getattr(settings, name), f"{prefix}{name}")
        object.__setattr__(settings, name, value)  # NumPy numbers have been converted to Python numbers


def check_gene_value(gene: Gene, name: str, value: Any, key: str) -> Any:
    """Return the value of a gene's setting after a check, converted to bool, int or float.

    name: the setting: "open", "low", "high", "start" or "opens_at"
    key: dotted name of the setting, for the error message

    Raises:
        ConfigError: see `check_value`.
    """
    if name == "open":
        return _checked(value, bool, None, key)
    if name == "opens_at":
        return _checked(value, int, Interval(0, 100_000), key)
    return float(_checked(value, int if gene.kind == "integer" else float, gene.range, key))


def check_gene_use(gene: Gene, use: GeneConfig) -> None:
    """Check that a gene's start value is valid and, if the gene is open, that its search range contains this value.

    Raises:
        ConfigError: the start value is NaN or outside the gene's valid range, or the search range of an open gene is
            empty or does not contain the start value.
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
    """Return "did you mean X?" if `word` is similar to the known word X; else a list of known words, as text.

    For words with dots, it is enough that the parts after the last dot are similar. The list contains the first 36
    known words, and states the number of the others.
    """
    known, word = list(known), str(word)
    by_last = {name.rpartition(".")[2]: name for name in known}
    last = close_match(word.rpartition(".")[2], by_last, cutoff=0.75)
    close = close_match(word, known) or (by_last[last] if last else None)
    if close:
        return f"did you mean {close!r}?"
    more = f", and {len(known) - MOST_LISTED} more: see evolve config schema" if len(known) > MOST_LISTED else ""
    return f"known: {', '.join(known[:MOST_LISTED])}{more}"


def _checked(value: Any, kind: type[Any], valid: Interval | None, key: str) -> Any:
    """Return `value` if it has the type `kind` and lies in `valid`. Integers are converted if `kind` is float.

    Raises:
        ConfigError: the value has another type or lies outside the range.
    """
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
    except OverflowError:  # an integer beyond the range of floats
        raise ConfigError(f"{key} = {shown}: must be {allowed}", key) from None
    return value


def quoted(value: Any) -> str:
    """Return a value as text for a message, on one line and with at most 200 characters before "..."."""
    try:
        whole = repr(value) if isinstance(value, str) else shown(value)
    except ValueError:  # more digits than Python converts to text
        return "a number of thousands of digits"
    return whole if len(whole) <= SHOWN else f"{whole[:SHOWN]}..."
