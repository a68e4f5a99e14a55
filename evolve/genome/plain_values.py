"""Checks of the type and range of values from an untrusted file. Error messages have one line."""

from __future__ import annotations

import json
from typing import Any

from evolve.genome.interval import Interval

__all__ = ["listed", "parsed", "real", "whole_number"]

SHOWN = 40  # maximum number of characters of a value in a message
ROUNDING = 1e-9  # tolerance for rounding errors of numbers at the ends of a range, as a fraction of its width


def parsed(text: str | bytes) -> Any:
    """Parse standard JSON, which excludes NaN and Infinity.

    Raises:
        ValueError: the text is not JSON, or exceeds the parser's limits on digits or nested brackets.
    """
    try:
        return json.loads(text, parse_constant=_refused)
    except RecursionError:
        raise ValueError("too many nested brackets") from None


def whole_number(value: Any, name: str, low: int, high: int) -> int:
    """Return `value` if it is an integer from `low` to `high`.

    name: name of the value in messages

    Raises:
        ValueError: the value has another type or lies outside the range.
    """
    if type(value) is not int or not low <= value <= high:
        raise ValueError(f"{name} = {_shown(value)}: must be a whole number from {low} to {high:,}")
    return value


def real(value: Any, name: str, valid: Interval) -> float:
    """Return `value` as a float if it is a number within the range. A float may exceed the range by rounding errors.

    name: name of the value in messages
    valid: the range; both ends belong to it, even if `open_low` is True

    Raises:
        ValueError: the value has another type or lies outside the range.
    """
    if type(value) not in (int, float) or not valid.low <= value <= valid.high:
        slack = ROUNDING * (valid.high - valid.low)
        if type(value) is not float or not valid.low - slack <= value <= valid.high + slack:
            raise ValueError(f"{name} = {_shown(value)}: must be a number in {valid}")
    return float(value)


def listed(value: Any, name: str, least: int, most: int) -> list[Any]:
    """Return `value` if it is a list with `least` to `most` entries.

    name: name of the list in messages

    Raises:
        ValueError: the value has another type, or the list is too short or too long.
    """
    if not isinstance(value, list):
        raise ValueError(f"{name} = {_shown(value)}: must be a list")
    if not least <= len(value) <= most:
        raise ValueError(f"{name} has {len(value)} entries: must have {least} to {most}")
    return value


def _shown(value: Any) -> str:
    try:
        quoted = repr(value)
    except (ValueError, RecursionError):  # too many digits, or too deeply nested
        return type(value).__name__
    return quoted if len(quoted) <= SHOWN else f"{quoted[:SHOWN]}..."


def _refused(constant: str) -> Any:
    raise ValueError(f"{constant} is not a number in JSON")
