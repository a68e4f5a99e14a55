"""`evolve validate` and `evolve doctor`: does it work here?"""

from __future__ import annotations

import subprocess
import sys
import time
from argparse import Namespace
from pathlib import Path

from optics.numerics import backend

__all__ = ["doctor", "validate"]

CHECKOUT = Path(__file__).resolve().parents[3]


def doctor(arguments: Namespace) -> int:
    """Print what is installed and whether it works."""
    from evolve.cli.doctor import print_findings

    return print_findings(as_json=arguments.json)


def validate(arguments: Namespace) -> int:
    """Run every validation script; each asserts against closed forms and draws. 1 if any fails."""
    scripts = sorted((CHECKOUT / "validation").glob("[A-Z][0-9]*_*.py"))
    if not scripts:
        print("evolve: error: validate needs a checkout of rhabdom: its scripts are not installed", file=sys.stderr)
        return 2
    from evolve.runs.progress import clock  # not at the top: the doctor works on every system

    backend.require()
    print(f"{len(scripts)} scripts, most of which take seconds and some minutes", flush=True)
    failed, began = [], time.monotonic()
    for number, script in enumerate(scripts, start=1):
        print(f"{number}/{len(scripts)} {script.stem}, after {clock(time.monotonic() - began)}", flush=True)
        child = subprocess.run([sys.executable, "-m", f"validation.{script.stem}"], cwd=CHECKOUT, check=False)
        failed += [script.stem] if child.returncode else []
    print(f"failed: {', '.join(failed)}" if failed else f"all {len(scripts)} passed")
    return 1 if failed else 0
