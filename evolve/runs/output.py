"""Safe output of text on a terminal.

All text that commands print is written through a `Voice`, a stream that escapes control characters. Commands print
results with `say`.

Messages, settings and names of directories may come from an untrusted source. Escape sequences in them are printed as
visible text, so that they have no effect on the terminal. Characters that the terminal's encoding lacks are spelt out
("sigma"), or printed as numbers. If a reader such as `head` closes the pipe, or the disk is full, a run continues.

In commands other than `validate`, stdout contains only the text that `say` prints. In these commands, `print` writes to
stderr, also in the code of users' tasks.
"""

from __future__ import annotations

import errno
import os
import sys
import unicodedata
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from typing import TextIO, cast

from rhabdom.streams import OwnedStream, private_stdout

__all__ = ["Voice", "as_it_is", "printable", "results", "say", "silenced", "spelled", "voices"]

_UNSEEN = ("Cc", "Cf", "Cn", "Co", "Cs", "Zl", "Zp")  # controls, direction marks, unassigned characters, line ends
_LAYOUT = "\n\t"
_SPELLINGS = {"σ": "sigma", "λ": "lambda", "±": "+-", "×": "x", "°": " deg", "µ": "u", "²": "^2", "·": "*", "–": "-"}


def printable(text: str) -> str:
    """Return the text with control characters escaped as in Python, for example "\\x1b[31m".

    Invisible characters, such as marks of writing direction, are also escaped. Line feeds and tabs are kept.
    """
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


class Voice(OwnedStream):
    """A text stream that writes to another stream, with control characters escaped.

    stream: the stream that receives the text
    patient: True to continue without output after an error of `stream`, such as a full disk; False to raise the error
    obeyed: True to write control characters unchanged, which a progress bar needs
    name: name of the stream, for the message of the error or, if `patient` is True, of a note on stderr. None: an
        error is ignored, unless the pipe or terminal has been closed

    Raises:
        BrokenPipeError: on writing, the pipe or terminal has been closed, and `patient` is False.
        OSError: on writing, another fault has occurred, `patient` is False, and the stream has a name.
    """

    def __init__(self, stream: TextIO, patient: bool, obeyed: bool = False, name: str | None = None) -> None:
        super().__init__(stream, self._judge)
        self.patient, self.obeyed, self.name = patient, obeyed, name

    def write(self, text: str) -> int:
        super().write(spelled(text if self.obeyed else printable(text), self.stream))
        return len(text)

    def _judge(self, fault: OSError | ValueError) -> None:
        """Handle an error of the stream that receives the text: raise it, print a note on stderr, or ignore it.

        If `patient` is True, nothing is raised, and the command continues without this output. If `name` is None, an
        error is raised only if the pipe or terminal has been closed. All other errors are then ignored.

        Raises:
            BrokenPipeError: the pipe or terminal has been closed, and `patient` is False.
            OSError: another fault has occurred, `patient` is False, and `name` is not None.
        """
        number = fault.errno if isinstance(fault, OSError) else errno.EBADF
        if number in (errno.EPIPE, errno.EIO):  # a closed pipe or terminal
            if not self.patient:
                raise BrokenPipeError(number, os.strerror(number)) from fault
        elif self.name is not None and number is not None:
            if not self.patient:
                raise OSError(number, os.strerror(number), self.name) from fault
            print(f"note: {self.name}: {os.strerror(number)}; further output is discarded", file=sys.stderr)


_results: TextIO | None = None


def results() -> TextIO:
    """Return the stream for the results of a command: stdout, unless `silenced` discards them."""
    return sys.stdout if _results is None else _results


def say(text: str, end: str = "\n", flush: bool = False) -> None:
    """Print a part of a command's result on stdout, unless `silenced` discards it.

    end, flush: see `print`
    """
    print(text, end=end, file=results(), flush=flush)


@contextmanager
def voices(patient: bool, private: bool = False) -> Iterator[None]:
    """Replace stdout and stderr within the context by streams that escape control characters; see `Voice`.

    patient: True to continue without output after an error of stdout, such as a closed pipe; False: raise the error.
        Errors of stderr are never raised
    private: True if only `say` writes to stdout, and all other output goes to stderr. False: `print` writes to stdout,
        too
    """
    before = sys.stdout, sys.stderr
    sys.stderr = cast(TextIO, Voice(before[1], patient=True))
    try:
        with private_stdout() if private else nullcontext(before[0]) as stdout:
            own = cast(TextIO, Voice(stdout, patient, name="stdout"))
            sys.stdout = cast(TextIO, Voice(before[1], patient=True)) if private else own
            with _results_on(own):
                yield
                own.flush()
    finally:
        sys.stdout, sys.stderr = before


@contextmanager
def silenced() -> Iterator[None]:
    """Discard the text that `say` prints within the context."""
    with open(os.devnull, "w", encoding="utf-8") as null, _results_on(null):
        yield


@contextmanager
def _results_on(stream: TextIO) -> Iterator[None]:
    global _results
    before, _results = _results, stream
    try:
        yield
    finally:
        _results = before


def as_it_is(stream: TextIO) -> TextIO:
    """Return a stream that writes to the same destination and leaves control characters unchanged.

    See `Voice.obeyed`.
    """
    if not isinstance(stream, Voice):
        return stream
    return cast(TextIO, Voice(stream.stream, stream.patient, obeyed=True, name=stream.name))
