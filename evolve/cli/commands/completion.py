"""`evolve completion`: completion scripts for shells."""

from __future__ import annotations

from argparse import Namespace

import shtab

from evolve.cli.arguments import build_parser
from evolve.runs.output import say

__all__ = ["completion"]


def completion(arguments: Namespace) -> int:
    """Print the completion script of a shell."""
    say(shtab.complete(build_parser(), shell=arguments.shell))
    return 0
