"""Can a run directory be mailed? Strangers' runs, files and readers, against what is promised about them.

    python -m validation.evolve.hostile [--trials N] [--seed S]

Each trial spoils a fresh copy of a small run (or a policy, a picture, a model, a page) at random and gives it to a
command. A trial fails if the command prints a traceback, more than one line or what steers a terminal, if it ends with
another exit code than promised, takes more than a second where sizes are checked, or touches a file outside the run.
The table counts promises, trials and failures; one failure is an exit code of 1. The seed makes it repeatable.
"""

from __future__ import annotations

import argparse
import random
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from validation.evolve.hostile_files import bomb_of_a_model, broken_picture, forged_policy, text_on_a_page
from validation.evolve.hostile_runs import (
    Stage,
    broken_bytes,
    impossible_value,
    shape_bomb,
    steering_text,
    strange_file,
)
from validation.evolve.hostile_unfinished import reader_leaves, run_is_deleted

SHOWN = 3  # failures of a promise that are told


@dataclass(frozen=True)
class Promise:
    """trial: what is wrong after one trial, None if nothing is; share: of all trials."""

    text: str
    trial: Callable[[random.Random, Stage], str | None]
    share: float


PROMISES = (
    Promise("links, FIFOs, sockets and folders under a file's name lead nowhere", strange_file, 0.2),
    Promise("impossible values in a record: one line, code 2", impossible_value, 0.25),
    Promise("broken bytes: read as they are, or one line, code 2", broken_bytes, 0.15),
    Promise("animals too large to build are refused within a second", shape_bomb, 0.05),
    Promise("nothing printed steers the terminal", steering_text, 0.08),
    Promise("text stays text on a page", text_on_a_page, 0.08),
    Promise("forged and broken policies are refused within a second", forged_policy, 0.08),
    Promise("broken EXR files: the same views, or an error", broken_picture, 0.05),
    Promise("models too large to build are refused within a second", bomb_of_a_model, 0.05),
    Promise("a run goes on when its reader leaves", reader_leaves, 0.005),
    Promise("a run that is deleted stays so and says so", run_is_deleted, 0.005),
)


def failures(promise: Promise, trials: int, seed: int, stage: Stage) -> list[str]:
    """What went wrong, in how many trials it did."""
    chances = (random.Random(f"{promise.trial.__name__} {seed} {number}") for number in range(trials))
    return [wrong for chance in chances if (wrong := promise.trial(chance, stage)) is not None]


def main(arguments: Sequence[str] | None = None, promises: Sequence[Promise] = PROMISES) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trials", type=int, default=2400)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args(arguments)
    total = failed = 0
    print(f"{'promise':<70}{'trials':>8}{'failures':>10}")
    with TemporaryDirectory() as folder:
        stage = Stage.build(Path(folder))
        for promise in promises:
            trials = max(1, round(promise.share * options.trials))
            wrong = failures(promise, trials, options.seed, stage)
            total, failed = total + trials, failed + len(wrong)
            print(f"{promise.text:<70}{trials:>8}{len(wrong):>10}", flush=True)
            for told in wrong[:SHOWN]:
                print(f"    {ascii(told)[:300]}")
    print(f"{'all':<70}{total:>8}{failed:>10}")
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
