"""Arguments of every command, their help with examples, and suggestions for mistyped arguments."""

from __future__ import annotations

import argparse
import difflib
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NoReturn, TypeAlias

from evolve.cli.argument_values import every, one_line, searches, seed
from evolve.cli.photograph_arguments import add_photograph
from evolve.runs.output import say

__all__ = ["SHELLS", "build_parser", "parse"]

SHELLS = ("bash", "zsh", "tcsh")
FIRST = """\
begin here:
  evolve doctor                              check the installation
  evolve demo --open                         show a finished run
  evolve run detection --preset quick        evolve eyes in a few minutes
  evolve list                                list the runs in the folder runs/
  evolve report runs/detection-quick-1 --open
print the options and examples of a command: evolve run --help
"""
EXAMPLES = {
    "run": """\
  evolve run detection --preset quick                       evolve eyes in a few minutes
  evolve run navigation --dry-run                           print genes, hours and disk space; start nothing
  evolve run detection --set search.generations=10 --out runs/first
  evolve run foraging --from runs/first:12                  start from an animal of another run
  evolve run ant_seeks.py:AntSeeks --preset quick           evolve eyes for a user task
""",
    "demo": "  evolve demo --open\n  evolve demo --out elsewhere\n",
    "resume": "  evolve resume runs/first --open\n",
    "status": "  evolve status runs/first --watch\n",
    "compare": "  evolve compare runs/first runs/second --html both.html\n",
    "drift": "  evolve drift runs/first\n  evolve drift runs/seed-0 runs/seed-1 --searches 1000\n",
    "replay": "  evolve replay runs/first --open\n  evolve replay runs/first --candidate 12 --seed 3\n",
    "report": "  evolve report runs/first --open\n",
    "export": "  evolve export runs/first --candidate 12 --out frames\n  evolve export runs/first --every 1\n",
    "see": "  evolve see photo.jpg --animal honeybee --width-deg 60\n",
    "list": "  evolve list\n  evolve list /data/runs --json\n",
    "validate": "  evolve validate --list\n  evolve validate psf_error_prediction aliasing\n",
    "config": "  evolve config show detection --preset quick\n  evolve config schema > settings.schema.json\n",
    "completion": "  evolve completion bash > ~/.local/share/bash-completion/completions/evolve\n",
}
Commands: TypeAlias = "argparse._SubParsersAction[Parser]"


class Parser(argparse.ArgumentParser):
    """Argument parser whose error messages are one line, with a suggestion for a mistyped word."""

    def _print_message(self, message: str, file: Any = None) -> None:
        """Print help or the version on stdout, like the results of other commands."""
        say(message, end="")

    def error(self, message: str) -> NoReturn:
        said = re.sub(r" \(choose from (.*)\)", "", message)
        wrong = re.search(r"invalid choice: '(.*)'", said)
        hint = _nearest(wrong[1], _choices(message)) if wrong else ""
        print(f"{self.prog}: error: {one_line(said)}{hint} (see {self.prog} --help)", file=sys.stderr)
        raise SystemExit(2)


def parse(arguments: Sequence[str]) -> argparse.Namespace:
    """Return the parsed arguments.

    Raises:
        SystemExit: the exit code is 0 if there are no arguments, or if the arguments request help or the version. If an
            argument is invalid, one line is printed, and the exit code is 2.
    """
    parser = build_parser()
    if not arguments:
        parser.print_help()
        raise SystemExit(0)
    parsed, unknown = parser.parse_known_args(arguments)
    if unknown:
        own: Parser = parsed.parser
        options = [option for option in own._option_string_actions if option.startswith("--")]
        flag = unknown[0].partition("=")[0]
        own.error(f"unrecognized arguments: {' '.join(unknown)}{_nearest(flag, options) if flag[:1] == '-' else ''}")
    return parsed


def _choices(message: str) -> list[str]:
    listed = re.search(r"\(choose from (.*)\)", message)
    return re.findall(r"[\w-]+", listed[1]) if listed else []


def _nearest(word: str, known: Sequence[str]) -> str:
    near = difflib.get_close_matches(word, known, n=1, cutoff=0.5)
    return f"; did you mean {near[0]!r}?" if near else ""


def build_parser() -> Parser:
    """Return the parser of all commands."""
    parser = Parser(
        prog="evolve",
        description="Evolve eyes that see through wave optics.",
        epilog=FIRST,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"rhabdom {_version()}")
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND", parser_class=Parser)
    _add_runs(commands)
    _add_watching(commands)
    _add_products(commands)
    _add_tables(commands)
    return parser


def _version() -> str:
    from rhabdom import __version__

    return __version__


def _add_runs(commands: Commands) -> None:
    """Add the commands that start or continue a run."""
    run = _command(commands, "run", "run.start", "start a run: evolve eyes and brains for a task")
    _add_settings(run)
    run.add_argument("--seed", type=int, help="same as --set seed=N")
    run.add_argument("--workers", type=int, metavar="N", help="same as --set workers=N (0: one worker per core)")
    run.add_argument("--out", type=Path, metavar="DIR", help="run directory (default: runs/TASK-PRESET-N)")
    run.add_argument(
        "--from",
        dest="start_from",
        metavar="RUN[:ID]",
        help="use the genes of an animal of another run as start values (default of ID: the best animal)",
    )
    run.add_argument(
        "--dry-run", action="store_true", help="print the genes, hours and disk space of the run, then stop"
    )
    resume = _command(commands, "resume", "run.resume", "continue an interrupted run", directory=True)
    _add_task(resume)
    for command in (run, resume):
        output = command.add_mutually_exclusive_group()
        output.add_argument("--json", action="store_true", help="print one line of JSON per event")
        output.add_argument("--quiet", action="store_true", help="print only errors")
        command.add_argument("--open", action="store_true", help="open the report in a browser when it is complete")
        command.add_argument(
            "--executor",
            choices=("local", "dask"),
            default="local",
            help="where candidates are evaluated (default: local)",
        )
        command.add_argument(
            "--scheduler", metavar="ADDRESS", help="address of the Dask scheduler, such as tls://host:8786"
        )
        for name, kind in (("ca-file", "CA certificates"), ("cert", "client certificate"), ("key", "client key")):
            command.add_argument(f"--tls-{name}", type=Path, metavar="FILE", help=f"PEM file of the {kind} for tls://")
        command.add_argument(
            "--device",
            choices=("auto", "cpu", "cuda"),
            help="device for PSFs, eyes and rays (default: environment variable RHABDOM_DEVICE, else cpu)",
        )
        command.add_argument(
            "--tensorboard", action="store_true", help="also write TensorBoard files to DIR/tensorboard"
        )


def _add_settings(command: argparse.ArgumentParser) -> None:
    """Add the arguments that determine the settings of a run."""
    command.add_argument(
        "task",
        metavar="TASK",
        nargs="?",
        help="task for which eyes evolve, or FILE.py:CLASS of a user task; not needed if the preset sets a task (list: "
        "evolve tasks)",
    )
    command.add_argument(
        "--preset",
        metavar="NAME",
        default="paper",
        help="settings to start from: quick (minutes), paper (a day; default), or an experiment (list: evolve presets)",
    )
    command.add_argument("--scale", help="size of an experiment: laptop (hours on two cores; default) or paper (days)")
    command.add_argument("--config", type=Path, metavar="FILE", help="TOML file with settings; overrides the preset")
    command.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE", help="value of one setting; overrides the file"
    )


def _add_watching(commands: Commands) -> None:
    """Add the commands that show and compare runs."""
    status = _command(commands, "status", "status.status", "show the state of a run", directory=True)
    status.add_argument("--json", action="store_true", help="print JSON")
    status.add_argument("--watch", action="store_true", help="print the state after every change until the run ends")
    listing = _command(commands, "list", "status.listing", "list the runs in a directory")
    listing.add_argument(
        "directory", type=Path, nargs="?", default=Path("runs"), metavar="DIR", help="directory of runs (default: runs)"
    )
    listing.add_argument("--json", action="store_true", help="print JSON")
    compare = _command(commands, "compare", "compare.compare", "compare runs side by side")
    compare.add_argument("directories", type=Path, nargs="+", metavar="DIR", help="run directories")
    _add_damage(compare)
    compare.add_argument("--json", action="store_true", help="print JSON")
    compare.add_argument("--html", type=Path, metavar="FILE", help="also write an HTML page with the fitness curves")
    drift = _command(commands, "drift", "drift.drift", "test which genes changed by more than chance would explain")
    drift.add_argument("directories", type=Path, nargs="+", metavar="DIR", help="runs that differ only in their seeds")
    meaning = "number of searches with random fitness, with which the runs are compared (default: 200)"
    _add_damage(drift)
    drift.add_argument("--searches", type=searches, default=200, metavar="N", help=meaning)
    drift.add_argument("--json", action="store_true", help="print JSON")


def _add_products(commands: Commands) -> None:
    """Add the commands `replay`, `report`, `export` and `demo`, which write results to files, and the command `see`."""
    for name, meaning, out in (
        ("replay", "play an episode of an agent, print the result, and write a page that shows it", "FILE"),
        ("report", "write the HTML report", "FILE"),
        ("export", "write the views of an agent during an episode as spectral EXR files", "DIR"),
    ):
        product = _command(commands, name, f"products.{name}", meaning, directory=True)
        _add_task(product)
        if name != "report":
            product.add_argument("--candidate", type=int, metavar="ID", help="candidate to play (default: the best)")
            product.add_argument("--seed", type=seed, default=0, help="seed of the episode (default: 0)")
            action, usual = ("write a file", 8) if name == "export" else ("with --rrd, record the scene", None)
            text = f"{action} every N actions (default: 8)"
            product.add_argument("--every", type=every, default=usual, metavar="N", help=text)
        if name == "replay":
            product.add_argument("--test", action="store_true", help="play in a layout of the test set")
            product.add_argument("--rrd", action="store_true", help="also write a recording for Rerun")
            product.add_argument("--gif", action="store_true", help="also write an animated GIF, for slides and pages")
            product.add_argument("--mp4", action="store_true", help="also write a video with one frame per action")
        if name != "export":
            product.add_argument("--open", action="store_true", help="open the page in a browser")
        product.add_argument("--out", type=Path, metavar=out, help="output path (default: in the run directory)")
        _add_output(product)
    demo = _command(commands, "demo", "demo.demo", "write the report, replay and EXR files of a finished run")
    demo.add_argument(
        "--out", type=Path, metavar="DIR", default=Path("runs/demo"), help="output directory (default: runs/demo)"
    )
    demo.add_argument("--open", action="store_true", help="open the report in a browser")
    _add_output(demo)
    add_photograph(_command(commands, "see", "see.through_eye", "show a photograph through an animal's eye"))


def _add_task(command: argparse.ArgumentParser) -> None:
    """Add the argument that names a user task. The code of the task runs only if this argument is given."""
    command.add_argument(
        "--task", metavar="FILE.py:CLASS", help="user task of the run; its code runs only if you name it here"
    )


def _add_output(command: argparse.ArgumentParser) -> None:
    output = command.add_mutually_exclusive_group()
    output.add_argument("--json", action="store_true", help="print JSON")
    output.add_argument("--quiet", action="store_true", help="print only errors")


def _add_tables(commands: Commands) -> None:
    """Add the commands `validate`, `doctor`, `tasks`, `presets`, `genes`, `config` and `completion`."""
    validate = _command(
        commands, "validate", "validate.validate", "run validation scripts (in a checkout of the repository)"
    )
    validate.add_argument("proofs", nargs="*", metavar="NAME", help="scripts to run (default: all)")
    validate.add_argument("--list", action="store_true", help="list the scripts without running them")
    doctor = _command(commands, "doctor", "validate.doctor", "report what is installed and whether it works")
    tasks = _command(commands, "tasks", "listings.tasks", "list the tasks")
    presets = _command(commands, "presets", "listings.presets", "list the presets")
    genes = _command(commands, "genes", "listings.genes", "list the genes")
    for command in (doctor, tasks, presets, genes):
        command.add_argument("--json", action="store_true", help="print JSON")
    config = _command(commands, "config", "show_config.config", "show all settings of a run, or their schema")
    config.add_argument("what", choices=("show", "schema"), help="show: as TOML, for --config; schema: as JSON schema")
    _add_settings(config)
    completion = _command(commands, "completion", "completion.completion", "print a completion script for a shell")
    completion.add_argument("shell", choices=SHELLS, help="the shell")


def _command(
    commands: Commands, name: str, home: str, meaning: str, directory: bool = False
) -> argparse.ArgumentParser:
    """Add a command; return its parser. `home` names its function in `evolve.cli.commands`: "module.function"."""
    parser = commands.add_parser(
        name,
        help=meaning,
        description=f"{meaning[0].upper()}{meaning[1:]}.",
        epilog=f"examples:\n{EXAMPLES[name]}" if name in EXAMPLES else None,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    module, function = home.split(".")
    parser.set_defaults(module=module, function=function, parser=parser)
    if directory:
        parser.add_argument("directory", type=Path, metavar="DIR", help="run directory")
        _add_damage(parser)
    return parser


def _add_damage(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--before-damage", action="store_true", help="ignore the first damaged line of a record and all later lines"
    )
