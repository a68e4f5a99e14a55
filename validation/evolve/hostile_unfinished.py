"""Trials of validation/evolve/hostile.py: processes whose output pipe is closed or whose directory is deleted."""

from __future__ import annotations

import os
import random
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any
from unittest.mock import patch

from evolve.search.successive_halving import finished
from evolve.store.atomic_files import write_whole
from evolve.store.directory import Run
from evolve.store.evaluation import Evaluation
from validation.evolve.hostile_runs import Stage

SMALL = ("search.population=2", "search.generations=2", "genome.optical.open=false")
CHECKOUT = Path(__file__).resolve().parents[2]


def quickly(phenotype: Any, config: Any, seed: int, policy: Path, progress: Any) -> Evaluation:
    """Return an evaluation without any training, so that it takes no time."""
    write_whole(policy, b"policy")
    return Evaluation(phenotype.fov_deg, (phenotype.fov_deg,), 0.5, 4096, 0.01)


def while_it_is_deleted(phenotype: Any, config: Any, seed: int, policy: Path, progress: Any) -> Evaluation:
    """Return an evaluation without any training, and delete the run before or after it."""
    if seed % 2:
        shutil.rmtree(policy.parents[2])
    outcome = quickly(phenotype, config, seed, policy, progress)
    shutil.rmtree(policy.parents[2])
    return outcome


def _begin(stage: Stage, evaluate: str, seed: int, *options: str, **streams: Any) -> subprocess.Popen[bytes]:
    shutil.rmtree(stage.folder / "trial", ignore_errors=True)
    settings = [part for text in SMALL for part in ("--set", text)]
    command = [
        sys.executable,
        "-m",
        "validation.evolve.hostile_unfinished",
        evaluate,
        "run",
        "detection",
        "--workers",
        "1",
    ]
    out = ("--seed", str(seed), "--out", str(stage.folder / "trial" / "run"))
    return subprocess.Popen([*command, *settings, *out, *options], cwd=CHECKOUT, **streams)


def reader_leaves(chance: random.Random, stage: Stage) -> str | None:
    """Run `evolve run | head -1`, with or without `--json` and `2>&1`: the run must continue to its end."""
    reader, writer = os.pipe()
    err = chance.choice((writer, subprocess.DEVNULL))
    child = _begin(
        stage, "quickly", chance.randrange(100), *chance.choice(((), ("--json",))), stdout=writer, stderr=err
    )
    os.close(writer)
    with open(reader, "rb", buffering=0) as pipe:
        pipe.read(1)
    code = child.wait()
    done = finished(Run.open(stage.folder / "trial" / "run"))
    return None if code == 0 and done else f"code {code}, {'finished' if done else 'unfinished'}"


def run_is_deleted(chance: random.Random, stage: Stage) -> str | None:
    """Delete a run while its first candidate trains: it must stay deleted, with a message and exit code 2."""
    child = _begin(stage, "while_it_is_deleted", chance.randrange(100), stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    _, err = child.communicate()
    said = err.decode().splitlines()[-1:]
    if child.returncode != 2 or b"Traceback" in err or not said or "evolve: error: " not in said[0]:
        return f"code {child.returncode}, said {err[-200:]!r}"
    return "the directory exists again" if (stage.folder / "trial" / "run").exists() else None


def _main() -> int:
    """Run the command `evolve` with an evaluation that takes no time, and without a report."""
    import validation.evolve.hostile_unfinished as here
    from evolve.cli import main
    from evolve.cli.commands import run as command
    from evolve.runs import carry_on

    evaluate = getattr(here, sys.argv[1])
    with (
        patch.object(carry_on, "evaluate_candidate", evaluate),
        patch.object(carry_on, "prepare_device", None),
        patch.object(command, "_finish", lambda *_: 0),
    ):
        return main.main(sys.argv[2:])


if __name__ == "__main__":
    sys.exit(_main())
