"""Declared packages are imported, imported packages are declared, and no GPL package is ever loaded."""

import ast
import json
import re
import subprocess
import sys
import tomllib
from importlib import metadata
from pathlib import Path

import pytest

from evolve.cli import doctor
from evolve.store import versions
from tests.sources import tree

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
MODULES = {"stable-baselines3": "stable_baselines3", "tomli-w": "tomli_w", "pillow": "PIL"}
MODULES |= {"imageio-ffmpeg": "imageio_ffmpeg"}
THROUGH_OTHERS = {"cma"}  # used, but imported by nevergrad


def declared(requirements: list[str]) -> set[str]:
    return {re.match(r"[\w-]+", text)[0] for text in requirements}


def imported(*packages: str) -> set[str]:
    found = set()
    for package in packages:
        for path in (ROOT / package).rglob("*.py"):
            for node in ast.walk(tree(path)):
                if isinstance(node, ast.Import):
                    found |= {alias.name.split(".")[0] for alias in node.names}
                elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
                    found.add(node.module.split(".")[0])
    return found - sys.stdlib_module_names - {"rhabdom", "optics", "sim", "evolve"}


def test_what_is_demanded_is_what_is_imported():
    extras = {name for group in PROJECT["optional-dependencies"].values() for name in declared(group)}
    needed = declared(PROJECT["dependencies"])
    modules = {MODULES.get(name, name) for name in needed}
    found = imported("rhabdom", "optics", "sim", "evolve")
    assert needed - found >= THROUGH_OTHERS
    assert modules - THROUGH_OTHERS <= found
    assert found - modules <= {MODULES.get(name, name) for name in extras} | {"rerun"}


def test_the_doctor_asks_for_what_is_demanded_and_no_more():
    assert set(doctor.PACKAGES) == {"rhabdom"} | declared(PROJECT["dependencies"])
    assert set(versions.PACKAGES) <= set(doctor.PACKAGES)


def gpl() -> set[str]:
    """Import names of installed projects under a GPL."""
    names = set()
    for module, projects in metadata.packages_distributions().items():
        for project in projects:
            about = metadata.metadata(project)
            said = [about.get("License-Expression") or "", *about.get_all("Classifier", [])]
            if any(re.search(r"\bA?GPL|GNU (Affero )?General Public", text) for text in said):
                names.add(module)
    return names


@pytest.mark.slow
def test_no_gpl_module_is_ever_imported(tmp_path):
    """The script imports all our modules and starts a search with each kind of optimizer. One of nevergrad's
    dependencies shows that the check finds GPL packages."""
    assert "directsearch" in gpl()
    script = """
import json, pkgutil, sys
from importlib import import_module
import rhabdom
for name in ("rhabdom", "optics", "sim", "evolve"):
    package = import_module(name)
    for module in pkgutil.walk_packages(package.__path__, f"{name}."):
        if not module.name.endswith("__main__"):
            import_module(module.name)
from evolve.config.assemble import assemble
from evolve.search.search import Search
for optimizer in ("CMA", "mutation", "TwoPointsDE", "PSO", "OnePlusOne"):
    search = Search(assemble("detection", "quick", assignments=[f"search.optimizer={optimizer}"]))
    search.tell([(proposal.id, float(proposal.id)) for proposal in search.propose_generation()])
    search.propose_generation()
print(json.dumps(sorted({name.split(".")[0] for name in sys.modules})))
"""
    child = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=False)
    assert child.returncode == 0, child.stderr
    loaded = set(json.loads(child.stdout.splitlines()[-1]))
    assert {"nevergrad", "torch", "mitsuba", "mujoco"} <= loaded
    assert loaded & gpl() == set()
