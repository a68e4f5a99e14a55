"""The one door to the terminal: what commands print passes through a Voice, wherever its text comes from.

Escape sequences in a stranger's failure texts, settings and directory names are shown, not obeyed. What the terminal's
encoding has no letters for is shown by number. And a reader that closes its end, as `head` does, ends no run.
"""

from __future__ import annotations

import errno
import os
import sys
import unicodedata
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, TextIO, cast

__all__ = ["Voice", "as_it_is", "printable", "spelled", "voices"]

_UNSEEN = ("Cc", "Cf", "Cn", "Co", "Cs", "Zl", "Zp")  # controls, marks that turn a line around, no letters, line ends
_LAYOUT = "\n\t"
_SPELLINGS = {"σ": "sigma", "λ": "lambda", "±": "+-", "×": "x", "°": " deg", "µ": "u", "²": "^2", "·": "*", "–": "-"}


def printable(text: str) -> str:
    """The text with whatever steers a terminal written as Python would: "\\x1b[31m"."""
    if text.isascii() and text.replace("\n", "").isprintable():
        return text
    return "".join(
        letter if letter in _LAYOUT or unicodedata.category(letter) not in _UNSEEN else _named(letter)
        for letter in text
    )


def spelled(text: str, stream: TextIO) -> str:
    """The text in letters that a stream's encoding has: "sigma", where there is no σ."""
    encoding = stream.encoding or "utf-8"
    try:
        text.encode(encoding)
        return text
    except UnicodeEncodeError:
        known = "".join(letter if _has(encoding, letter) else _SPELLINGS.get(letter, letter) for letter in text)
        return known.encode(encoding, "backslashreplace").decode(encoding)


def _has(encoding: str, letter: str) -> bool:
    try:
        return bool(letter.encode(encoding))
    except UnicodeEncodeError:
        return False


def _named(letter: str) -> str:
    return letter.encode("ascii", "backslashreplace").decode() if not letter.isascii() else f"\\x{ord(letter):02x}"


class Voice:
    """A text stream to print to.

    patient: whether to go on in silence when nobody reads any more; if not, BrokenPipeError ends the command
    obeyed: whether what steers a terminal may pass: for a progress bar, whose own escapes are meant
    """

    def __init__(self, stream: TextIO, patient: bool, obeyed: bool = False) -> None:
        self.stream, self.patient, self.obeyed = stream, patient, obeyed

    def write(self, text: str) -> int:
        shown = spelled(text if self.obeyed else printable(text), self.stream)
        self._heard(lambda: self.stream.write(shown))
        return len(text)

    def flush(self) -> None:
        self._heard(self.stream.flush)

    def _heard(self, speak: Any) -> None:
        try:
            speak()
        except OSError as error:
            if error.errno not in (errno.EPIPE, errno.EIO):  # a closed pipe, a terminal that is gone
                raise
            self._fall_silent()
            if not self.patient:
                raise BrokenPipeError(error.errno, error.strerror) from error

    def _fall_silent(self) -> None:
        """Whatever is printed from here on, what is still in the buffer included, goes nowhere."""
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, self.stream.fileno())
        os.close(nowhere)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)


@contextmanager
def voices(patient: bool) -> Iterator[None]:
    """stdout and stderr as Voices, as long as the context lasts."""
    before = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = (cast(TextIO, Voice(stream, patient)) for stream in before)
    try:
        yield
        sys.stdout.flush()
    finally:
        sys.stdout, sys.stderr = before


def as_it_is(stream: TextIO) -> TextIO:
    """The same stream for what may steer the terminal."""
    return cast(TextIO, Voice(stream.stream, stream.patient, obeyed=True)) if isinstance(stream, Voice) else stream
