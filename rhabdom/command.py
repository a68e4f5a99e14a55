"""Entry point of the command `evolve`. Importing this module puts the packages on Python's path."""

from __future__ import annotations

import os
import signal
import threading
from importlib import import_module
from types import FrameType

__all__ = ["run_command"]

INTERRUPTED = 130
_SAID = b"evolve: interrupted\n"


def run_command() -> int:
    """Run one command and return the exit code."""
    ours = threading.current_thread() is threading.main_thread()
    if ours and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _interrupt)
    try:
        return int(import_module("evolve.cli.main").main())
    except KeyboardInterrupt:
        os.write(2, _SAID)
        return INTERRUPTED


def _interrupt(number: int, frame: FrameType | None) -> None:
    """Interrupt the process on Ctrl-C, or end it if a module is being imported.

    An exception raised during an import may come up in the middle of a library's initialisation. Python or the library
    may then replace or suppress it.
    """
    if _imports(frame):
        os.write(2, _SAID)
        os._exit(INTERRUPTED)
    signal.default_int_handler(number, frame)


def _imports(frame: FrameType | None) -> bool:
    while frame is not None and not frame.f_code.co_filename.startswith("<frozen importlib"):
        frame = frame.f_back
    return frame is not None
