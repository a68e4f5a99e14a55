"""`evolve compare`: a comparison of several runs."""

from __future__ import annotations

import json
from argparse import Namespace

from evolve.report.comparison import comparison_lines, differing_settings, run_summary, write_page
from evolve.runs.output import say
from evolve.store.directory import Run

__all__ = ["compare"]


def compare(arguments: Namespace) -> int:
    """Print a comparison of several runs; with --html, also write it as a page."""
    runs = [Run.open(directory, before_damage=arguments.before_damage) for directory in arguments.directories]
    if arguments.json:
        found = {"runs": [run_summary(run) for run in runs], "settings": differing_settings(runs)}
        say(json.dumps(found, indent=1, allow_nan=False))
    else:
        say("\n".join(comparison_lines(runs)))
    if arguments.html:
        write_page(runs, arguments.html)
        if not arguments.json:
            say(f"page: {arguments.html}")
    return 0
