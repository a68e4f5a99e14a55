"""The command `evolve`: reads arguments, calls the command, turns what is the user's to mend into one line and a code.

Exit codes: 0 done, 1 done but not as hoped, 2 wrong input or environment, 130 interrupted.
Commands load on use, so that help comes at once.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import NoReturn, TypeAlias

from evolve.cli.commands import INTERRUPTED
from evolve.cli.output import voices

__all__ = ["main"]


class _Parser(argparse.ArgumentParser):
    """argparse, with errors of one line."""

    def error(self, message: str) -> NoReturn:
        print(f"{self.prog}: error: {message} (see {self.prog} --help)", file=sys.stderr)
        raise SystemExit(2)


_Commands: TypeAlias = "argparse._SubParsersAction[_Parser]"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit code."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    try:
        with voices(patient=given[:1] in (["run"], ["resume"])):  # these go on when nobody reads any more
            return _outcome(given)
    except BrokenPipeError:
        return 0  # `evolve genes | head`


def _outcome(arguments: Sequence[str]) -> int:
    """The exit code of a command; what is the user's to mend is said in one line."""
    try:
        parsed = _parser().parse_args(arguments)
        # Numerical libraries read this as they load. More threads than one sum in another order, and a run must repeat.
        os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1"))
        command = import_module(f"evolve.cli.commands.{parsed.module}")
        return int(getattr(command, parsed.function)(parsed))
    except KeyboardInterrupt:
        print("evolve: interrupted", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        raise
    except Exception as error:
        if not _is_users(error):
            raise
        print(f"evolve: error: {_one_line(error)}", file=sys.stderr)
        return 2


def _one_line(error: Exception) -> str:
    if isinstance(error, OSError) and error.filename is not None:
        return f"{error.filename}: {error.strerror}"
    return " ".join(str(error).split())


def _is_users(error: Exception) -> bool:
    """Errors whose message is one line for the user; anything else is a bug of ours and keeps its traceback."""
    from evolve.config.run_config import ConfigError
    from evolve.search.local_executor import ExecutorError
    from evolve.store.directory import RunError
    from evolve.store.lock import LockedError
    from optics.numerics.backend import BackendError

    return isinstance(error, ConfigError | RunError | LockedError | ExecutorError | BackendError | OSError)


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="evolve", description="Evolve eyes that see through wave optics.")
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND", parser_class=_Parser)
    _add_runs(commands)
    _add_watching(commands)
    _add_products(commands)
    _command(commands, "validate", "checks.validate", "compare the optics with closed forms; this needs a checkout")
    doctor = _command(commands, "doctor", "checks.doctor", "say what is installed and whether it works")
    _command(commands, "tasks", "tables.tasks", "list the tasks")
    genes = _command(commands, "genes", "tables.genes", "list the genes")
    for command in (doctor, genes):
        command.add_argument("--json", action="store_true", help="print JSON")
    return parser


def _add_runs(commands: _Commands) -> None:
    """Commands that carry a run on."""
    run = _command(commands, "run", "run.start", "start a run: evolve eyes and brains for a task")
    run.add_argument(
        "task",
        metavar="TASK",
        nargs="?",
        help="task to evolve for; not needed if the preset sets one (list: evolve tasks)",
    )
    run.add_argument(
        "--preset",
        metavar="NAME",
        default="paper",
        help="settings to start from: quick (minutes), paper (a day; default), or an experiment: "
        "bifurcation-navigation, bifurcation-detection, lens, pupil, scaling, ultraviolet",
    )
    run.add_argument("--scale", help="size of an experiment: laptop (hours on two cores; default) or paper (days)")
    run.add_argument("--config", type=Path, metavar="FILE", help="TOML file of settings; overrides the preset")
    run.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="one setting; overrides the file")
    run.add_argument("--seed", type=int, help="same as --set seed=N")
    run.add_argument("--workers", type=int, metavar="N", help="same as --set workers=N (0: one worker per core)")
    run.add_argument("--out", type=Path, metavar="DIR", help="run directory (default: runs/TASK-PRESET-N)")
    run.add_argument(
        "--from",
        dest="start_from",
        metavar="RUN[:ID]",
        help="start from an animal of another run (default: the best one)",
    )
    run.add_argument(
        "--dry-run", action="store_true", help="print the plan with the hours and disk space it needs, then stop"
    )
    resume = _command(commands, "resume", "run.resume", "continue an interrupted run", directory=True)
    for command in (run, resume):
        command.add_argument("--json", action="store_true", help="print one line of JSON per event")
        command.add_argument(
            "--executor",
            choices=("local", "dask"),
            default="local",
            help="where candidates are evaluated (default: local)",
        )
        command.add_argument(
            "--scheduler", metavar="ADDRESS", help="address of the Dask scheduler, such as tls://host:8786"
        )
        for name, whose in (
            ("ca-file", "the authority's certificate"),
            ("cert", "our certificate"),
            ("key", "its key"),
        ):
            command.add_argument(f"--tls-{name}", type=Path, metavar="FILE", help=f"for a tls:// scheduler: {whose}")
        command.add_argument(
            "--tensorboard", action="store_true", help="also write TensorBoard files to DIR/tensorboard"
        )


def _add_watching(commands: _Commands) -> None:
    """Commands that read records."""
    status = _command(commands, "status", "status.status", "show the state of a run", directory=True)
    status.add_argument("--json", action="store_true", help="print JSON")
    status.add_argument("--watch", action="store_true", help="print again at every change until the run ends")
    compare = _command(commands, "compare", "compare.compare", "compare runs side by side")
    compare.add_argument("directories", type=Path, nargs="+", metavar="DIR", help="run directories")
    compare.add_argument("--json", action="store_true", help="print JSON")
    compare.add_argument("--html", type=Path, metavar="FILE", help="also write an HTML page with their fitness curves")


def _add_products(commands: _Commands) -> None:
    """Commands that make files of a run."""
    for name, meaning in (
        ("replay", "play one episode of the best agent, and print the result"),
        ("report", "write the HTML report"),
        ("export", "write what the best agent sees as spectral EXR files"),
    ):
        product = _command(commands, name, f"products.{name}", meaning, directory=True)
        if name != "report":
            product.add_argument("--candidate", type=int, metavar="ID", help="candidate to play (default: the best)")
            product.add_argument("--seed", type=_seed, default=0, help="seed of the episode (default: 0)")
        if name == "replay":
            product.add_argument("--rrd", action="store_true", help="also write a recording for Rerun")


def _seed(text: str) -> int:
    """A seed as NumPy takes it."""
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"{text!r}: must be a whole number, 0 or more")
    return int(text)


def _command(
    commands: _Commands, name: str, home: str, meaning: str, directory: bool = False
) -> argparse.ArgumentParser:
    """A command that lives in evolve.cli.commands.<home>."""
    parser = commands.add_parser(name, help=meaning, description=f"{meaning[0].upper()}{meaning[1:]}.")
    module, function = home.split(".")
    parser.set_defaults(module=module, function=function)
    if directory:
        parser.add_argument("directory", type=Path, metavar="DIR", help="run directory")
    return parser
