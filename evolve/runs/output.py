"""Safe output of text on a terminal. Commands print all text through a Voice.

Messages, settings and names of directories may come from an untrusted source. Escape sequences in them are printed as
visible text, so that they have no effect on the terminal. Characters that the terminal's encoding lacks are spelt out
("sigma"), or printed as numbers. If a reader such as `head` closes the pipe, a run continues.
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
    """Return the text with control characters escaped as in Python, for example "\\x1b[31m"."""
    if text.isascii() and text.replace("\n", "").isprintable():
        return text
    return "".join(
        letter if letter in _LAYOUT or unicodedata.category(letter) not in _UNSEEN else _named(letter)
        for letter in text
    )


def spelled(text: str, stream: TextIO) -> str:
    """Return the text in characters that the stream's encoding contains, for example "sigma" instead of σ."""
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
    """A text stream that writes to another stream, with control characters escaped.

    stream: the stream that receives the text
    patient: if the reader has closed the pipe, whether to continue without output; False: BrokenPipeError ends the
        command
    obeyed: whether control characters are written unchanged; True for a progress bar, which needs them
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
            if error.errno not in (errno.EPIPE, errno.EIO):  # other errors than a closed pipe or terminal
                raise
            self._fall_silent()
            if not self.patient:
                raise BrokenPipeError(error.errno, error.strerror) from error

    def _fall_silent(self) -> None:
        """Redirect the stream to the null device, which discards the buffer and all further output."""
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, self.stream.fileno())
        os.close(nowhere)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)


@contextmanager
def voices(patient: bool) -> Iterator[None]:
    """Replace stdout and stderr by Voices within the context.

    patient: see `Voice`
    """
    before = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = (cast(TextIO, Voice(stream, patient)) for stream in before)
    try:
        yield
        sys.stdout.flush()
    finally:
        sys.stdout, sys.stderr = before


def as_it_is(stream: TextIO) -> TextIO:
    """Return a stream that writes to the same place, but does not escape control characters."""
    return cast(TextIO, Voice(stream.stream, stream.patient, obeyed=True)) if isinstance(stream, Voice) else stream
