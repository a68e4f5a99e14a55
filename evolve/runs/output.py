"""Output on a terminal: everything that commands print passes through a Voice, whatever its source.

Escape sequences in untrusted messages, settings and directory names are printed as text, so that they have no effect.
Characters that the terminal's encoding lacks are printed as numbers. A run continues if a reader such as `head` closes
its pipe.
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

_UNSEEN = ("Cc", "Cf", "Cn", "Co", "Cs", "Zl", "Zp")  # controls, direction marks, unassigned characters, line ends
_LAYOUT = "\n\t"
_SPELLINGS = {"σ": "sigma", "λ": "lambda", "±": "+-", "×": "x", "°": " deg", "µ": "u", "²": "^2", "·": "*", "–": "-"}


def printable(text: str) -> str:
    """Return the text with control characters escaped as in Python: "\\x1b[31m"."""
    if text.isascii() and text.replace("\n", "").isprintable():
        return text
    return "".join(
        letter if letter in _LAYOUT or unicodedata.category(letter) not in _UNSEEN else _named(letter)
        for letter in text
    )


def spelled(text: str, stream: TextIO) -> str:
    """Return the text in characters of a stream's encoding, for example "sigma" instead of σ."""
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
    """A text stream for output.

    patient: whether to continue without output after the reader has gone; if not, BrokenPipeError ends the command
    obeyed: whether control characters are passed on, for a progress bar, which uses escape sequences
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
            if error.errno not in (errno.EPIPE, errno.EIO):  # a closed pipe or terminal
                raise
            self._fall_silent()
            if not self.patient:
                raise BrokenPipeError(error.errno, error.strerror) from error

    def _fall_silent(self) -> None:
        """Discard all further output, including the contents of the buffer."""
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, self.stream.fileno())
        os.close(nowhere)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)


@contextmanager
def voices(patient: bool) -> Iterator[None]:
    """Replace stdout and stderr by Voices within the context."""
    before = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = (cast(TextIO, Voice(stream, patient)) for stream in before)
    try:
        yield
        sys.stdout.flush()
    finally:
        sys.stdout, sys.stderr = before


def as_it_is(stream: TextIO) -> TextIO:
    """Return the same stream for output that may contain control characters."""
    return cast(TextIO, Voice(stream.stream, stream.patient, obeyed=True)) if isinstance(stream, Voice) else stream
