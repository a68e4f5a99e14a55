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
OPTICS_ALONE = {"numpy", "scipy", "drjit"}


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


@pytest.mark.slow
def test_optics_alone_runs_its_tutorial_on_three_packages():
    """The tutorial and the how-to pages that need only optics run with three packages. All other packages are refused,
    except dependencies of the three."""
    paths = [ROOT / "docs/tutorial/optics.md", *sorted((ROOT / "docs/how_to").glob("*.md"))]
    more = re.compile(r"^from rhabdom import .*(sim|evolve)", re.MULTILINE)
    pages = [page for page in (path.read_text() for path in paths) if not more.search(page)]
    blocks = re.findall(r"```python\n(.*?)```", "".join(pages), re.DOTALL)
    blocks = [block for block in blocks if not any(f"import {more}" in block for more in ("torch", "colour"))]
    assert len(blocks) > 20
    others = sorted(set(metadata.packages_distributions()) - OPTICS_ALONE - {"optics", "rhabdom"})
    assert "matplotlib" in others
    refuse = f"""
import sys
class Refuse:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in {others!r}:
            raise ModuleNotFoundError(f"refused: {{name}}", name=name)
sys.meta_path.insert(0, Refuse())
"""
    child = subprocess.run(
        [sys.executable, "-c", refuse + "\n".join(blocks)], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert child.returncode == 0, child.stderr
    refused = subprocess.run(
        [sys.executable, "-c", f"{refuse}import torch"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert "refused: torch" in refused.stderr


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
