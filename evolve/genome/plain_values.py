"""Values from a file that somebody else may have written: of the right type and within a range, or one line."""

from __future__ import annotations

import json
from typing import Any

from evolve.genome.interval import Interval

__all__ = ["listed", "parsed", "real", "whole_number"]

SHOWN = 40  # letters of a value that a message quotes
ROUNDING = 1e-9  # of a range's width, by which a number computed from its ends may lie outside


def parsed(text: str | bytes) -> Any:
    """JSON as its standard has it, without NaN and Infinity.

    Raises:
        ValueError: it is none, or holds numbers or brackets beyond all bounds.
    """
    try:
        return json.loads(text, parse_constant=_refused)
    except RecursionError:
        raise ValueError("too many brackets within brackets") from None


def whole_number(value: Any, name: str, low: int, high: int) -> int:
    """An integer.

    Raises:
        ValueError: it is none, or not within the range.
    """
    if type(value) is not int or not low <= value <= high:
        raise ValueError(f"{name} = {_shown(value)}: must be a whole number from {low} to {high:,}")
    return value


def real(value: Any, name: str, valid: Interval) -> float:
    """A number.

    Raises:
        ValueError: it is none, or not within the range.
    """
    if type(value) not in (int, float) or not valid.low <= value <= valid.high:
        slack = ROUNDING * (valid.high - valid.low)
        if type(value) is not float or not valid.low - slack <= value <= valid.high + slack:
            raise ValueError(f"{name} = {_shown(value)}: must be a number in {valid}")
    return float(value)


def listed(value: Any, name: str, least: int, most: int) -> list[Any]:
    """A list, of so many entries.

    Raises:
        ValueError: it is none, or too short or long.
    """
    if not isinstance(value, list):
        raise ValueError(f"{name} = {_shown(value)}: must be a list")
    if not least <= len(value) <= most:
        raise ValueError(f"{name} has {len(value)} entries: must have {least} to {most}")
    return value


def _shown(value: Any) -> str:
    try:
        quoted = repr(value)
    except (ValueError, RecursionError):  # too many digits, too deep
        return type(value).__name__
    return quoted if len(quoted) <= SHOWN else f"{quoted[:SHOWN]}..."


def _refused(constant: str) -> Any:
    raise ValueError(f"{constant} is no number in JSON")
