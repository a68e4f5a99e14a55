"""The file versions.json: software versions, machine and checksums of the settings at each start of a run."""

from __future__ import annotations

import hashlib
import json
import os
import platform
import subprocess
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any

from evolve.config.sources import LARGEST_TOML
from evolve.store.atomic_files import write_whole
from evolve.store.regular_files import read
from optics.numerics.device import device

__all__ = [
    "commits",
    "config_change",
    "fingerprint",
    "machine",
    "machines",
    "origin",
    "present",
    "provenance",
    "record_start",
    "recorded",
    "run_id",
]

FILE, CONFIG = "versions.json", "config.toml"
LARGEST_FILE = 2**24  # maximum size of the file [bytes], for thousands of starts
PACKAGES = (
    "rhabdom",
    "numpy",
    "drjit",
    "mitsuba",
    "mujoco",
    "torch",
    "stable-baselines3",
    "gymnasium",
    "nevergrad",
    "cma",
)


def present() -> dict[str, str]:
    """Return the software versions, architecture and device that influence a run's numbers, by name.

    The names are "python", "machine" (architecture), "commit" (of rhabdom; "" if unknown), "device", and the names of
    ten Python packages, such as "numpy". The version of a missing package is "not installed".
    """
    versions = {"python": platform.python_version(), "machine": platform.machine(), "commit": _commit()}
    versions["device"] = device()
    for package in PACKAGES:
        try:
            versions[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            versions[package] = "not installed"
    return versions


def recorded(run: Path) -> dict[str, str]:
    """Return the versions of the software at the first start of a run, by name.

    The names are those that the function `present` uses. The result is {} if versions.json is missing or damaged.
    """
    starts = _starts(run)
    return starts[0]["versions"] if starts else {}


def commits(run: Path) -> list[str]:
    """Return the git commits of rhabdom's code that started or resumed a run, in order and each once.

    Starts without a recorded commit are omitted.
    """
    known = [start["versions"].get("commit") for start in _starts(run)]
    return list(dict.fromkeys(commit for commit in known if commit))


def machine() -> str:
    """Return the processor and the number of logical cores of this machine, such as "AMD EPYC, 2 cores"."""
    return f"{_processor()}, {os.cpu_count()} cores"


def machines(run: Path) -> list[str]:
    """Return the machines that started or resumed a run, in order and each once; see `machine`.

    For starts by older versions of rhabdom, only the architecture is known, such as x86_64.
    """
    found = []
    for start in _starts(run):
        architecture = start["versions"].get("machine", "a machine")
        found.append(str(start.get("processor", f"{architecture}, processor not recorded")))
    return list(dict.fromkeys(found))


def run_id(run: Path) -> str:
    """Return the id of a run, which does not depend on its directory: 16 hexadecimal digits of a SHA-256.

    The id is computed from everything that versions.json records about the first start of the run, such as the time,
    the checksums of the settings, and the versions of the software. If no start is recorded, the id is "".
    """
    starts = _starts(run)
    return hashlib.sha256(json.dumps(starts[0], sort_keys=True).encode()).hexdigest()[:16] if starts else ""


def provenance(run: Path) -> dict[str, Any]:
    """Return named values that identify a run, for the files that are made from it.

    Values that are unknown are omitted. The names and their meanings are:

    run: name of the run directory
    run_id: see `run_id`
    settings: fingerprint of its config.toml
    run_commits: commits of rhabdom that started or resumed the run
    commit: commit of this code

    Raises:
        OSError: config.toml cannot be read.
    """
    known = {
        "run": run.resolve().name,
        "run_id": run_id(run),
        "settings": fingerprint(read(run / CONFIG, LARGEST_TOML).decode()),
        "run_commits": commits(run),
        "commit": _commit(),
    }
    return {name: value for name, value in known.items() if value}


def config_change(run: Path, candidates: int) -> str | None:
    """Return a message if a run's config.toml has changed since the last start of the run; None otherwise.

    If an older version of rhabdom last started the run, no checksum of the file is recorded. Only changes of settings
    that influence training and evaluation are then noticed.

    candidates: number of candidates that have been evaluated

    Raises:
        OSError: config.toml cannot be read.
    """
    starts = _starts(run)
    if not starts:
        return None
    last, now = starts[-1], _checksums(read(run / CONFIG, LARGEST_TOML))
    changed = f"{CONFIG} has changed since the last start"
    if last.get("settings", now["settings"]) != now["settings"]:
        return (
            f"{changed}. Candidates from {candidates} on are trained and evaluated with other settings than earlier "
            "ones. If you did not change it, restore it from a copy"
        )
    if last.get("config", now["config"]) != now["config"]:
        return f"{changed}, but only in comments, workers or generations"
    return None


def fingerprint(config: str) -> str:
    """Return the fingerprint of the text of a run's config.toml, 16 hexadecimal digits of a SHA-256.

    It ignores lines that do not influence training and evaluation: empty lines, lines that start with "#", the number
    of workers, and the number of generations.
    """
    left_out = ("workers =", "generations =", "#")
    lines = [line.strip() for line in config.splitlines() if line.strip() and not line.startswith(left_out)]
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()[:16]


def _checksums(config: bytes) -> dict[str, str]:
    """Return the SHA-256 of a config.toml ("config") and its `fingerprint` ("settings").

    The fingerprint covers only the settings that influence training and evaluation.
    """
    return {"settings": fingerprint(config.decode()), "config": hashlib.sha256(config).hexdigest()}


def record_start(run: Path, candidates: int, origin: str | None = None, config: bytes | None = None) -> None:
    """Add a start of a run to versions.json, with the time, this machine, and the present software versions.

    candidates: number of candidates that have been evaluated before this start
    origin: "RUN:ID", the animal whose genes are the start values; None if there is no such animal
    config: content of the run's config.toml; None: read it from the file

    Raises:
        OSError: config.toml cannot be read, or versions.json cannot be written.
    """
    start: dict[str, Any] = {
        "time": datetime.now(UTC).isoformat(timespec="seconds"),
        "candidates": candidates,
        **_checksums(read(run / CONFIG, LARGEST_TOML) if config is None else config),
        "processor": machine(),
        "versions": present(),
    }
    if origin is not None:
        start["from"] = origin
    write_whole(run / FILE, json.dumps([*_starts(run), start], indent=1).encode())


def origin(run: Path) -> str | None:
    """Return "RUN:ID" of the animal whose genes were the start values of a run; None if there is no such animal."""
    starts = _starts(run)
    return str(starts[0]["from"]) if starts and "from" in starts[0] else None


def _starts(run: Path) -> list[dict[str, Any]]:
    """Return one entry of versions.json for each start of a run.

    The result is [] if the file is missing or damaged. This is no error, because a run does not need the file.
    """
    try:
        starts = json.loads(read(run / FILE, LARGEST_FILE))
        return [start for start in starts if isinstance(start["versions"], dict)]
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return []


def _processor() -> str:
    """Return the processor's name, or the architecture if the system does not provide the name."""
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()


def _commit() -> str:
    """Return the git commit of this code, with "+" if tracked files differ from it; "" if git does not know it."""
    here = Path(__file__).parent
    try:
        described = subprocess.run(
            ["git", "-C", str(here), "describe", "--always", "--abbrev=40", "--exclude=*", "--dirty=+"],
            capture_output=True,
            text=True,
            timeout=10,
            check=False,
        )
        tracked = subprocess.run(
            ["git", "-C", str(here), "ls-files", "--error-unmatch", "versions.py"],
            capture_output=True,
            timeout=10,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return described.stdout.strip() if described.returncode == 0 and tracked.returncode == 0 else ""
