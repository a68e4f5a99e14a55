"""`evolve drift`: comparison of runs with searches whose fitness is random, the null model."""

from __future__ import annotations

import json
from argparse import Namespace

from evolve.cli.waiting import Waiting
from evolve.report.gene_drift import drift_of
from evolve.runs.output import say
from evolve.store.directory import Run

__all__ = ["drift"]


def drift(arguments: Namespace) -> int:
    """Print how far each gene moved in the runs, compared with searches with random fitness."""
    runs = [Run.open(directory, before_damage=arguments.before_damage) for directory in arguments.directories]
    said = "searches with random fitness"
    with Waiting(1).of_one_step(said) as wait:
        found = drift_of(runs, arguments.searches, lambda share: wait.within(said, share))
    if arguments.json:
        say(json.dumps(found.as_plain_values(), indent=1, allow_nan=False))
    else:
        say("\n".join(found.lines()))
    return 0
