"""Entry point of the command `evolve`.

Importing this module also imports `rhabdom`, which makes its three packages importable.
"""

from __future__ import annotations

import os
import signal
import threading
from contextlib import suppress
from importlib import import_module
from types import FrameType

from rhabdom.streams import open_closed_streams

__all__ = ["run_command"]

INTERRUPTED = 130
_SAID = b"evolve: interrupted\n"


def run_command() -> int:
    """Run one command, with the arguments of this process, and return the exit code.

    Raises:
        SystemExit: help or the version was requested, or an argument is invalid; see `evolve.cli.main`.
    """
    open_closed_streams()
    ours = threading.current_thread() is threading.main_thread()
    if ours and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _interrupt)
    try:
        return int(import_module("evolve.cli.main").main())
    except KeyboardInterrupt:
        _report()
        return INTERRUPTED


def _interrupt(number: int, frame: FrameType | None) -> None:
    """Interrupt the program on Ctrl-C by an exception, or end the process if a module is being imported.

    If the exception were raised during an import, while a library initialises itself, Python or the library might
    replace or suppress the exception.
    """
    if _imports(frame):
        _report()
        os._exit(INTERRUPTED)
    signal.default_int_handler(number, frame)


def _report() -> None:
    with suppress(OSError):  # stderr may be full
        os.write(2, _SAID)


def _imports(frame: FrameType | None) -> bool:
    while frame is not None and not frame.f_code.co_filename.startswith("<frozen importlib"):
        frame = frame.f_back
    return frame is not None
