"""Standard streams that stay usable even if they were closed from the start, are full, or a user's code closes them.

The encoding of a stream is replaced if it cannot encode text.
"""

from __future__ import annotations

import codecs
import os
import string
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any, TextIO, cast

__all__ = ["OwnedStream", "open_closed_streams", "private_stdout", "repair_encodings", "send_all_to_stderr"]

NAMES = ("stdin", "stdout", "stderr")


def open_closed_streams() -> None:
    """Open each closed standard stream on the null device.

    Otherwise the next file that the program opens would get the stream's descriptor, and messages of libraries would be
    written into this file.
    """
    for descriptor, name in enumerate(NAMES):
        try:
            os.fstat(descriptor)
        except OSError:
            null = os.open(os.devnull, os.O_RDWR)
            os.dup2(null, descriptor)  # also makes it inheritable
            if null != descriptor:
                os.close(null)
            else:
                os.set_inheritable(descriptor, True)
        if getattr(sys, name) is None:
            stream = open(descriptor, "w" if descriptor else "r", encoding="utf-8", closefd=False)  # noqa: SIM115
            setattr(sys, name, stream)
            setattr(sys, f"__{name}__", stream)


def repair_encodings() -> list[str]:
    """Set the encoding of stdout and stderr to UTF-8 if their own cannot encode text; return the replaced encodings."""
    replaced = []
    for stream in (sys.stdout, sys.stderr):
        encoding, reconfigure = getattr(stream, "encoding", None), getattr(stream, "reconfigure", None)
        if encoding is not None and reconfigure is not None and not _encodes(encoding):
            reconfigure(encoding="utf-8", errors="backslashreplace")
            replaced.append(str(encoding))
    return sorted(set(replaced))


def _encodes(encoding: str) -> bool:
    """Return whether text that is encoded line by line is decoded to the same text."""
    lines = [string.printable, "", "ab" * 40, "\n"]
    try:
        encoder = codecs.getincrementalencoder(encoding)()
        return b"".join(map(encoder.encode, lines)).decode(encoding) == "".join(lines)
    except (LookupError, ValueError, TypeError):
        return False


@contextmanager
def private_stdout() -> Iterator[TextIO]:
    """Yield a stream to stdout to which only the program writes.

    Within the context, everything else that is written to descriptor 1 goes to stderr: the output of users' code,
    libraries and child processes. If stdout has been replaced, for example by a test, the replacement is yielded.
    """
    original: Any = sys.__stdout__
    if sys.stdout is not original or original.fileno() != 1:
        yield sys.stdout
        return
    with suppress(OSError):
        original.flush()
    lines = 1 if original.isatty() else -1
    own = open(os.dup(1), "w", lines, encoding=original.encoding, errors=original.errors)  # noqa: SIM115
    os.dup2(2, 1)
    try:
        yield own
    finally:
        with suppress(OSError, ValueError):
            original.flush()
        os.dup2(own.fileno(), 1)
        with suppress(OSError):
            own.close()


def send_all_to_stderr() -> None:
    """Send everything that this process writes on stdout to stderr, until it ends. No code can close the new streams.

    A worker process calls this function, because its stdout is that of the program.
    """
    open_closed_streams()
    os.dup2(2, 1)
    repair_encodings()
    sys.stdout, sys.stderr = (cast(TextIO, OwnedStream(cast(TextIO, sys.__stderr__))) for _ in range(2))


class OwnedStream:
    """A text stream that writes to another stream. Other code cannot close it, and its faults do not end the program.

    After a fault, all further output is discarded.

    stream: the stream that receives the text
    report: function that is called with the first fault: an OSError, or a ValueError if the stream was closed
    """

    def __init__(self, stream: TextIO, report: Callable[[OSError | ValueError], None] | None = None) -> None:
        self.stream, self._report = stream, report

    def write(self, text: str) -> int:
        self._attempt(lambda: self.stream.write(text))
        return len(text)

    def flush(self) -> None:
        self._attempt(self.stream.flush)

    def close(self) -> None:
        """Flush the stream, which stays open."""
        self.flush()

    @property
    def closed(self) -> bool:
        return False

    def _attempt(self, call: Callable[[], Any]) -> None:
        try:
            call()
        except (OSError, ValueError) as fault:
            self._fall_silent()
            if self._report is not None:
                self._report(fault)

    def _fall_silent(self) -> None:
        """Redirect the stream to the null device, which discards the buffer and all further output."""
        null = os.open(os.devnull, os.O_WRONLY)
        try:
            os.dup2(null, self.stream.fileno())
        except (OSError, ValueError):  # the stream was closed
            self.stream = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
        finally:
            os.close(null)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)
