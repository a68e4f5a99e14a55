"""Trials of validation/evolve/hostile.py: commands on damaged run directories."""

from __future__ import annotations

import io
import json
import os
import random
import shutil
import socket
import time
from collections.abc import Sequence
from contextlib import chdir, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from evolve.cli.main import main
from evolve.config.assemble import assemble
from evolve.config.numbering import Place
from evolve.genome.genotype import Genotype
from evolve.genome.phenotype import develop
from evolve.store.candidate import Candidate
from evolve.store.chain import sealed_record, without_checksum
from evolve.store.directory import Run
from evolve.store.evaluation import Evaluation

READERS = ("status", "compare", "report", "replay", "resume", "export")
FILES = ("config.toml", "candidates.jsonl", "versions.json", "lock")
FOLDERS = ("policies", "trainings", "exr", "tensorboard")
KINDS = ("link", "dangling link", "FIFO", "socket", "directory", "file")
SECRET = "the only copy\n"
TEXTS = (
    "<img src=x onerror=alert(1)>",
    "</script><script>alert(1)</script>",
    "\x1b[2J\x1b]0;owned\x07",
    "\u202e",
    "$\\x$",
)
IMPOSSIBLE = (
    "9" * 400,
    "1e400",
    "-1e400",
    "NaN",
    "Infinity",
    "7" * 6000,
    "[" * 50_000 + "]" * 50_000,
    "true",
    '"0"',
    "{}",
    "[[[]]]",
    '"\\ud800"',
    "1e308",
    '["a"]',
    *map(json.dumps, TEXTS),
)
BOMBS = {
    "n_eyes": "1000000000",
    "layers": "1000000000",
    "neurons": "20000",
    "memory_frames": "1000000000",
    "resolution": "[1000000, 1000000]",
    "relief": json.dumps([0.5] * 10_000),
    "lambda_max_nm": json.dumps([500.0] * 10_000),
}


@dataclass(frozen=True)
class Stage:
    """A small finished run, which is copied and damaged, and a file outside the run."""

    folder: Path

    @classmethod
    def build(cls, folder: Path) -> Stage:
        small = ("search.population=4", "search.generations=2", "genome.optical.open=false")
        run = Run.create(folder / "whole", assemble("detection", assignments=small))
        dimension = Genotype(run.config.genome).dimension
        for number in range(6):
            genome = np.random.default_rng(number).random(dimension)
            outcome = Evaluation(float(number), (number - 0.5, number + 0.5), 0.5, 4096, 0.1, ((4096, 1.0),))
            animal = develop(genome, run.config)
            run.append(
                Candidate.from_evaluation(Place.from_id(number, 4), tuple(genome.tolist()), animal, number, outcome)
            )
        (folder / "thesis.tex").write_text(SECRET)
        return cls(folder)

    @property
    def lines(self) -> list[str]:
        """Lines of the run's record, without checksums."""
        written = (self.folder / "whole" / "candidates.jsonl").read_bytes().splitlines()
        return [without_checksum(line).decode() + "\n" for line in written]

    @property
    def victim(self) -> Path:
        return self.folder / "thesis.tex"

    def copy(self, name: str = "run") -> Path:
        """Return a fresh copy of the run."""
        shutil.rmtree(self.folder / "trial", ignore_errors=True)
        (self.folder / "trial").mkdir()
        return Path(shutil.copytree(self.folder / "whole", self.folder / "trial" / name))


def call(*arguments: Any) -> tuple[int, str, str]:
    """Run a command and return its exit code and output."""
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        try:
            code = main([str(argument) for argument in arguments])
        except SystemExit as stop:
            code = int(stop.code or 0)
        except Exception as error:
            return -1, out.getvalue(), f"{type(error).__name__}: {error}"
    return code, out.getvalue(), err.getvalue()


def refusal(stage: Stage, *arguments: Any) -> str | None:
    """Check that a command refuses in one line and touches no other file; return the failure, or None."""
    code, out, err = call(*arguments)
    if code != 2 or out or err.count("\n") != 1 or not err.startswith("evolve: error: "):
        return f"code {code}, said {err[-200:]!r}"
    if not err[:-1].isprintable() or len(err) > 2000:
        return f"said {err[:200]!r}"
    return None if stage.victim.read_text() == SECRET else "a file outside the run has changed"


def strange_file(chance: random.Random, stage: Stage) -> str | None:
    """Replace a file or folder of the run by something else, which any command must refuse, even `run --out`."""
    run, name = stage.copy(), chance.choice(FILES + FOLDERS)
    kind = chance.choice([kind for kind in KINDS if kind != ("directory" if name in FOLDERS else "file")])
    place = run / name
    if place.is_dir():
        shutil.rmtree(place)
    place.unlink(missing_ok=True)
    _put(kind, place, stage.victim)
    command = chance.choice((*READERS, "run"))
    if command == "run":
        return refusal(stage, "run", "detection", "--preset", "quick", "--out", run)
    return refusal(stage, command, run)


def _put(kind: str, place: Path, victim: Path) -> None:
    if kind == "link":
        place.symlink_to(victim)
    elif kind == "dangling link":
        place.symlink_to(victim.with_name("absent"))
    elif kind == "FIFO":
        os.mkfifo(place)
    elif kind == "socket":
        with chdir(place.parent), socket.socket(socket.AF_UNIX) as one:
            one.bind(place.name)
    elif kind == "directory":
        place.mkdir()
    else:
        place.write_text("")


def _write_record(run: Path, lines: Sequence[str]) -> None:
    (run / "candidates.jsonl").write_bytes(sealed_record(lines))


def impossible_value(chance: random.Random, stage: Stage) -> str | None:
    """Put an invalid value anywhere in a line of the record."""
    run, record = stage.copy(), json.loads(stage.lines[-1])
    table = record["phenotype"] if chance.random() < 0.5 else record
    table[chance.choice([name for name in table if name != "failure"])] = "@"
    line = json.dumps(record).replace('"@"', chance.choice(IMPOSSIBLE), 1)
    _write_record(run, [*stage.lines[:-1], line + "\n"])
    return refusal(stage, chance.choice(READERS), run)


def shape_bomb(chance: random.Random, stage: Stage) -> str | None:
    """Record an animal that would exceed the memory if it were built."""
    run, record = stage.copy(), json.loads(stage.lines[-1])
    trait = chance.choice(list(BOMBS))
    record["phenotype"][trait] = "@"
    _write_record(run, [json.dumps(record).replace('"@"', BOMBS[trait], 1) + "\n"])
    began = time.process_time()
    wrong = refusal(stage, "status", run)
    took = time.process_time() - began
    return wrong or (f"{trait}: took {took:.1f} s" if took > 1.0 else None)


def broken_bytes(chance: random.Random, stage: Stage) -> str | None:
    """Flip, remove or insert bytes: the record must be read if it is still valid, or refused in one line."""
    run = stage.copy()
    path = run / chance.choice(("config.toml", "candidates.jsonl", "versions.json"))
    content = bytearray(path.read_bytes())
    for _ in range(chance.randint(1, 8)):
        at = chance.randrange(len(content) - 8)
        content[at : at + chance.choice((0, 1, 1, 5))] = chance.randbytes(chance.choice((0, 1, 1, 3)))
    path.write_bytes(content)
    code, out, err = call(chance.choice(("status", "compare")), run, *chance.choice(((), ("--json",))))
    if code == 2 and not out and err.count("\n") == 1 and err[:-1].isprintable():
        return None
    plain = (out + err).replace("\n", "").isprintable()
    return None if code == 0 and out and plain else f"code {code}, said {err[-200:]!r}"


def steering_text(chance: random.Random, stage: Stage) -> str | None:
    """Put escape sequences into a failure's text and a directory's name, shown by `status` and `compare`."""
    letters = [chr(chance.choice((27, 7, 8, 13, 0x9B, 0x202E, 0xDCE9, chance.randrange(1, 0x500)))) for _ in range(12)]
    name = "".join(letters).replace("/", "-").encode(errors="surrogateescape").decode(errors="surrogateescape")
    run, record = stage.copy(f"run{name}"), json.loads(stage.lines[-1])
    record |= {"failure": f"ValueError: {name}", "fitness": None}
    _write_record(run, [*stage.lines[:-1], json.dumps(record) + "\n"])
    code, out, err = call(chance.choice(("status", "compare")), run)
    plain = (out + err).translate(dict.fromkeys(map(ord, "\n\t"))).isprintable()  # newlines and tabs are harmless
    return None if code == 0 and plain else f"code {code}, said {out + err!r}"
