"""The command `evolve`: parses the arguments and runs one of its subcommands.

Errors that users can correct are printed as one line. The exit code is 0 after success, 1 if all candidates of a run
failed, a validation script failed or an unexpected error occurred, 2 if the input or the environment is wrong, and 130
after an interruption. Modules of subcommands are imported on use, so that help appears immediately.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from contextlib import nullcontext
from importlib import import_module

from evolve.cli.argument_values import one_line
from evolve.cli.arguments import parse
from evolve.cli.commands import INTERRUPTED
from evolve.cli.notes import notes
from evolve.config.task_errors import error_in_task
from evolve.runs.output import results, silenced, voices
from rhabdom.streams import open_closed_streams, repair_encodings

__all__ = ["main"]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one subcommand and return the exit code.

    arguments: arguments of the command line without the command's name; None: the arguments of this process

    Raises:
        SystemExit: help or the version was requested, or an argument is invalid (see `evolve.cli.arguments.parse`), or
            the subcommand does not support Windows.
    """
    given = list(sys.argv[1:] if arguments is None else arguments)
    open_closed_streams()
    replaced = repair_encodings()
    # `run` and `resume` continue even if the program that reads their output through a pipe has ended, or the disk is
    # full. The scripts of `validate` are child processes that print their results themselves.
    patient = given[:1] in (["run"], ["resume"]) and not {"--dry-run", "--help", "-h"} & {*given}
    try:
        with voices(patient, private=given[:1] != ["validate"]), notes():
            for encoding in replaced:
                print(f"note: encoding {encoding}: cannot write text; UTF-8 is used", file=sys.stderr)
            return _outcome(given)
    except BrokenPipeError:
        return 0  # the program that reads the output has ended, for example in `evolve genes | head`


def _outcome(arguments: Sequence[str]) -> int:
    """Run one subcommand and return the exit code. Errors that users can correct are printed as one line.

    Raises:
        BrokenPipeError: the program that reads the output has ended.
    """
    try:
        try:
            return _code(arguments)
        finally:
            results().flush()
    except KeyboardInterrupt:
        print("evolve: interrupted", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        raise
    except BaseException as error:
        place = error_in_task(error)
        if place is None and not (isinstance(error, Exception) and _is_users(error)):
            raise
        print(f"evolve: error: {place or _one_line(error)}", file=sys.stderr)
        return 2


def _code(arguments: Sequence[str]) -> int:
    """Run one subcommand and return the exit code."""
    parsed = parse(arguments)
    if parsed.module != "validate":
        _require_system()
    # Numerical libraries read these variables on import. They are limited to one thread because runs must be
    # reproducible, and with several threads the order of summation varies.
    os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1"))
    if getattr(parsed, "device", None):
        os.environ["RHABDOM_DEVICE"] = parsed.device  # worker processes inherit this variable
    command = import_module(f"evolve.cli.commands.{parsed.module}")
    with silenced() if getattr(parsed, "quiet", False) else nullcontext():
        return int(getattr(command, parsed.function)(parsed))


def _require_system() -> None:
    """Exit with an error on Windows, which does not support the kinds of processes and locks that runs use."""
    if sys.platform == "win32":
        from evolve.cli.doctor import unsupported

        print(f"evolve: error: {unsupported()}", file=sys.stderr)
        raise SystemExit(2)


def _one_line(error: BaseException) -> str:
    if isinstance(error, OSError) and error.filename is not None:
        return f"{error.filename}: {error.strerror}"
    if isinstance(error, MemoryError):
        return "not enough memory: close other programs, or use a machine with more memory"
    return one_line(str(error))


def _is_users(error: BaseException) -> bool:
    """Return whether users can correct the cause of an error. Any other error is a bug and keeps its traceback."""
    from evolve.config.run_config import ConfigError
    from evolve.search.local_executor import ExecutorError
    from evolve.store.directory import RunError
    from evolve.store.lock import LockedError
    from optics.numerics.backend import BackendError

    return isinstance(
        error, ConfigError | RunError | LockedError | ExecutorError | BackendError | OSError | MemoryError
    )
