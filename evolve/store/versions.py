"""Which software, and settings, a run was started and continued with."""

from __future__ import annotations

import hashlib
import json
import platform
import subprocess
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any

from evolve.store.atomic_files import write_whole
from evolve.store.regular_files import read
from optics.numerics.device import device

__all__ = ["altered", "fingerprint", "origin", "present", "record_start", "recorded"]

FILE = "versions.json"
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
    """Versions of what decides a run's numbers, as they are now."""
    versions = {"python": platform.python_version(), "machine": platform.machine(), "commit": _commit()}
    versions["device"] = device()
    for package in PACKAGES:
        try:
            versions[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            versions[package] = "not installed"
    return versions


def recorded(run: Path) -> dict[str, str]:
    """Versions with which a run was begun; {} if they are not readable."""
    starts = _starts(run)
    return starts[0]["versions"] if starts else {}


def commits(run: Path) -> list[str]:
    """Of rhabdom, with which a run was begun and continued, in order and without repetitions; those that are known."""
    known = [start["versions"].get("commit") for start in _starts(run)]
    return list(dict.fromkeys(commit for commit in known if commit))


def fingerprint(config: str) -> str:
    """Of the text of a run's config.toml, but for what trains and evaluates nobody otherwise: remarks, the workers'
    number, and how long the run lasts."""
    left_out = ("workers =", "generations =", "#")
    lines = [line.strip() for line in config.splitlines() if line.strip() and not line.startswith(left_out)]
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()[:16]


def altered(run: Path) -> bool:
    """Whether a run's config.toml has changed since the run was begun or last continued."""
    starts = _starts(run)
    return bool(starts) and starts[-1].get("settings", _settings(run)) != _settings(run)


def _settings(run: Path) -> str:
    return fingerprint(read(run / "config.toml").decode())


def record_start(run: Path, candidates: int, origin: str | None = None, settings: str | None = None) -> None:
    """Write down that a run goes on from `candidates` evaluated ones with the present versions, with which settings
    (their fingerprint; None: those of its config.toml), and `origin`, from whose animal it started."""
    start: dict[str, Any] = {
        "time": datetime.now(UTC).isoformat(timespec="seconds"),
        "candidates": candidates,
        "settings": settings or _settings(run),
        "versions": present(),
    }
    if origin is not None:
        start["from"] = origin
    write_whole(run / FILE, json.dumps([*_starts(run), start], indent=1).encode())


def origin(run: Path) -> str | None:
    """From whose animal a run started ("runs/first:12"); None if from its own config, or if it is not readable."""
    starts = _starts(run)
    return str(starts[0]["from"]) if starts and "from" in starts[0] else None


def _starts(run: Path) -> list[dict[str, Any]]:
    """Earlier starts. The file informs and decides nothing, so one that is lost or damaged begins anew."""
    try:
        starts = json.loads(read(run / FILE))
        return [start for start in starts if isinstance(start["versions"], dict)]
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return []


def _commit() -> str:
    """Commit of the checkout that runs, "+" where files differ from it; "" outside a checkout."""
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
