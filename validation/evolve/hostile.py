"""Trials of untrusted runs, files and readers: do they satisfy the guarantees of run directories?

    python -m validation.evolve.hostile [--trials N] [--seed S]

Each trial randomly damages a fresh copy of a small run (or a policy, an image, a model, a page) and passes it to a
command. A trial fails if the command prints a traceback, more than one line or terminal control sequences, or ends with
another exit code than promised. It also fails if the command takes more than a second where sizes are checked, or
touches a file outside the run. The table counts trials and failures of each promise. Any failure gives exit code 1. The
seed makes the trials repeatable.
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

SHOWN = 3  # printed failures per promise


@dataclass(frozen=True)
class Promise:
    """A guarantee with its trial.

    trial: function that runs one trial, and returns the description of its failure, or None.
    share: fraction of all trials that test this guarantee.
    """

    text: str
    trial: Callable[[random.Random, Stage], str | None]
    share: float


PROMISES = (
    Promise("links, FIFOs, sockets and folders in place of files are refused", strange_file, 0.2),
    Promise("invalid values in a record: one-line error, exit code 2", impossible_value, 0.25),
    Promise("damaged bytes: read unchanged, or one-line error, exit code 2", broken_bytes, 0.15),
    Promise("animals too large to build are refused within a second", shape_bomb, 0.05),
    Promise("printed text contains no terminal control sequences", steering_text, 0.08),
    Promise("text is escaped on pages", text_on_a_page, 0.08),
    Promise("forged and damaged policies are refused within a second", forged_policy, 0.08),
    Promise("damaged EXR files: the same images, or an error", broken_picture, 0.05),
    Promise("models too large to build are refused within a second", bomb_of_a_model, 0.05),
    Promise("a run continues after its output pipe is closed", reader_leaves, 0.005),
    Promise("a deleted run stays deleted and ends with a message", run_is_deleted, 0.005),
)


def failures(promise: Promise, trials: int, seed: int, stage: Stage) -> list[str]:
    """Return the descriptions of the failed trials."""
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
