"""Place of an error in the code of a user task."""

from __future__ import annotations

from pathlib import Path

__all__ = ["MODULE", "error_in_task", "error_text"]

MODULE = "rhabdom_task_"  # beginning of the names of modules that execute a user's file


def error_in_task(error: BaseException) -> str | None:
    """Return the message of an error in one line, with the method, line and file of a user task.

    The line is the innermost one of the user's file in the traceback. If the error occurred outside any method, no
    method is named. If the traceback contains no line of a user's file, the result is None.
    """
    place, trace = None, error.__traceback__
    while trace is not None:
        frame = trace.tb_frame
        if str(frame.f_globals.get("__name__", "")).startswith(MODULE):
            method = frame.f_code.co_name
            where = "" if method == "<module>" else f"{method}, "
            place = f"{where}line {trace.tb_lineno} of {Path(frame.f_code.co_filename).name}"
        trace = trace.tb_next
    return None if place is None else f"{place}: {error_text(error)}"


def error_text(error: BaseException) -> str:
    """Return the type and the message of an error in one line."""
    return " ".join(f"{type(error).__name__}: {error}".split())
