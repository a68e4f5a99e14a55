"""`evolve demo`: a copy of the finished run that is included in rhabdom, with report, replay and EXR files."""

from __future__ import annotations

import json
from argparse import Namespace

from evolve.cli.commands.products import finished_products, open_page
from evolve.cli.commands.status import standing, standing_lines
from evolve.runs.output import say
from evolve.store.shipped_run import copy_shipped_run
from optics.numerics import device

__all__ = ["demo"]


def demo(arguments: Namespace) -> int:
    """Copy the finished run that is included in rhabdom into a directory, and write the files about it.

    These files are the run's report, and the replay and EXR files of its best animal.
    """
    device.make_ready()
    run = copy_shipped_run(arguments.out)
    shown = not (arguments.json or arguments.quiet)
    if shown:
        say("\n".join(standing_lines(standing(run))))
        say("The best animal plays an episode; report, replay and EXR files are written ...", flush=True)
    made = finished_products(run, shown, replay=True)
    if arguments.json:
        say(json.dumps(made.record(run), indent=1))
    else:
        say("\n".join(made.lines(run)))
        say(f"See the record: evolve status {run.path}. Evolve your own: evolve run detection --preset quick")
    open_page(made.report, arguments)
    return 0
