"""Functions that convert command-line arguments to whole numbers, and that shorten an error message to one line."""

from __future__ import annotations

import argparse

__all__ = ["every", "one_line", "searches", "seed"]

MOST_SEARCHES = 100_000  # as in evolve.report.gene_drift, whose import takes seconds
MOST_EVERY = 1_000_000  # as in evolve.episodes.recorder
LONGEST_MESSAGE = 1800  # maximum number of characters of an error message
LONGEST = 4000  # maximum number of digits of an argument; Python converts at most 4,300


def seed(text: str) -> int:
    """Return the seed that an argument specifies as text.

    Raises:
        ArgumentTypeError: the text is not a whole number, 0 or more, or has more than 4,000 digits.
    """
    if not text.isdecimal() or len(text) > LONGEST:
        raise argparse.ArgumentTypeError(f"{text[:40]!r}: must be a whole number, 0 or more")
    return int(text)


def every(text: str) -> int:
    """Return the number N that an argument specifies as text: a frame is recorded after every N actions.

    Raises:
        ArgumentTypeError: the text is not a whole number from 1 to 1,000,000.
    """
    if not text.isdecimal() or len(text) > LONGEST or not 1 <= int(text) <= MOST_EVERY:
        raise argparse.ArgumentTypeError(f"{text[:40]!r}: must be a whole number from 1 to {MOST_EVERY:,}")
    return int(text)


def searches(text: str) -> int:
    """Return the number of searches with random fitness, from the text of an argument.

    Raises:
        ArgumentTypeError: the text is not a whole number from 2 to 100,000.
    """
    if not text.isdecimal() or len(text) > LONGEST or not 2 <= int(text) <= MOST_SEARCHES:
        raise argparse.ArgumentTypeError(f"{text[:40]!r}: must be a whole number from 2 to {MOST_SEARCHES:,}")
    return int(text)


def one_line(text: str) -> str:
    """Return a message without line breaks. The middle of a long message is omitted."""
    text, half = " ".join(text.split()), LONGEST_MESSAGE // 2
    return text if len(text) <= LONGEST_MESSAGE else f"{text[:half]} [...] {text[-half:]}"
