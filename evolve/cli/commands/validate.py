"""`evolve validate` and `evolve doctor`: checks of results and of the installation."""

from __future__ import annotations

import ast
import subprocess
import sys
import time
import tomllib
from argparse import Namespace
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from evolve.runs.output import say
from optics.numerics import backend

__all__ = ["doctor", "validate"]

CHECKOUT = Path(__file__).resolve().parents[3]


@dataclass(frozen=True)
class _Proof:
    """A validation script.

    module: name of the script's module
    old: name of the script before it was renamed, which `evolve validate` still accepts; it begins with a code (B0 in
        "B0_planner"). "" if there is none
    """

    module: str
    old: str

    @property
    def name(self) -> str:
        return self.module.rpartition(".")[2]

    @property
    def question(self) -> str:
        """First line of the script's docstring."""
        source = (CHECKOUT / self.module.replace(".", "/")).with_suffix(".py").read_text(encoding="utf-8")
        return (ast.get_docstring(ast.parse(source)) or "").split("\n")[0]


def doctor(arguments: Namespace) -> int:
    """Print what is installed and whether it works."""
    from evolve.cli.doctor import print_findings

    return print_findings(as_json=arguments.json)


def validate(arguments: Namespace) -> int:
    """Run validation scripts, which check results and draw figures; with --list, only print what they check.

    Without names of scripts, all scripts run. Return 1 if one fails, and 2 if the scripts are not installed.

    Raises:
        ConfigError: a name is unknown.
        BackendError: Dr.Jit finds no usable LLVM library or GPU.
    """
    listed = CHECKOUT / "validation" / "proofs.toml"
    if not listed.is_file():
        print("evolve: error: validate needs a checkout of rhabdom: its scripts are not installed", file=sys.stderr)
        return 2
    paths = tomllib.loads(listed.read_text(encoding="utf-8"))["proofs"]
    known = [_Proof(f"validation.{path.replace('/', '.')}", old) for path, old in paths.items()]
    proofs = [_found(name, {proof.name: proof for proof in known}) for name in arguments.proofs] or known
    if arguments.list:
        width = max(len(proof.name) for proof in proofs) + 2
        say("\n".join(f"{proof.name:<{width}}{proof.question}" for proof in proofs))
        return 0
    backend.require()
    return _run(proofs)


def _found(name: str, proofs: Mapping[str, _Proof]) -> _Proof:
    """Return the validation script with this name. The name may be the current one, an old one, or an old code.

    A code is the beginning of an old name, such as B0 in "B0_planner". If the name is not the current one, the current
    name is printed.

    proofs: scripts by current name

    Raises:
        ConfigError: the name is unknown.
    """
    if name in proofs:
        return proofs[name]
    for proof in proofs.values():
        if proof.old and name in (proof.old, proof.old.partition("_")[0]):
            print(f"{name} is now called {proof.name}", file=sys.stderr)
            return proof
    from evolve.config.checks import ConfigError  # imported on use: `doctor` must work everywhere
    from optics.numerics.arguments import did_you_mean

    raise ConfigError(
        f"validate {name}: there is no such script{did_you_mean(name, proofs)} (see evolve validate --list)"
    )


def _run(proofs: list[_Proof]) -> int:
    """Run these validation scripts one after another. Return 1 if one fails, else 0."""
    from evolve.runs.progress import clock

    if len(proofs) > 1:
        say(f"{len(proofs)} scripts; most take seconds, some take minutes", flush=True)
    failed, began = [], time.monotonic()
    for number, proof in enumerate(proofs, start=1):
        say(f"{number}/{len(proofs)} {proof.name}, after {clock(time.monotonic() - began)}", flush=True)
        child = subprocess.run([sys.executable, "-m", proof.module], cwd=CHECKOUT, check=False)
        failed += [proof.name] if child.returncode else []
    say(f"failed: {', '.join(failed)}" if failed else f"all {len(proofs)} passed")
    return 1 if failed else 0
