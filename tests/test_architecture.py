"""Imports run one way, heavy libraries stay in their modules, and package imports are light."""

import ast
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

from tests.sources import PACKAGES, ROOT, SOURCES, tree


def test_contracts_hold():
    linter = Path(sys.executable).with_name("lint-imports")
    child = subprocess.run([linter], cwd=ROOT, capture_output=True, text=True, check=False)
    assert child.returncode == 0, child.stdout + child.stderr


def imported_at(path: Path) -> dict[str, bool]:
    """Return the top-level packages that a file imports, each with True if it is imported on import of the file."""
    module = tree(path)
    nested = {id(node) for f in ast.walk(module) if isinstance(f, ast.FunctionDef | ast.Lambda) for node in ast.walk(f)}
    found: dict[str, bool] = {}
    for node in ast.walk(module):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names = [node.module]
        else:
            continue
        for name in names:
            top = name.split(".")[0]
            found[top] = found.get(top, False) or id(node) not in nested
    return found


def test_rhabdom_imports_no_package_that_imports_it():
    """rhabdom must not import them for type checking either; `__init__.pyi` declares the types."""
    above = {"optics", "sim", "evolve"}
    circles = {path.name: above & imported_at(path).keys() for path in (ROOT / "rhabdom").glob("*.py")}
    assert not any(circles.values()), circles


def test_importing_the_packages_loads_nothing_heavy():
    heavy = ("torch", "mitsuba", "drjit", "mujoco", "nevergrad", "stable_baselines3", "colour", "matplotlib", "scipy")
    code = f"import sys, {', '.join(PACKAGES)}; print([name for name in {heavy!r} if name in sys.modules])"
    child = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert child.stdout.strip() == "[]"


def test_no_variant_is_set_at_import():
    """A library that sets Mitsuba's variant on import would change the user's program."""
    code = (
        "import mitsuba as mi, optics, sim, evolve, sim.scene.mirror, sim.render.batched_renderer; print(mi.variant())"
    )
    child = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert child.stdout.strip() == "None"


def test_nothing_reads_or_writes_pickles():
    readers = {"pickle", "cloudpickle", "dill", "joblib", "shelve", "marshal"}
    offenders = {path.name: readers & imported_at(path).keys() for path in SOURCES}
    assert not any(offenders.values()), offenders


FOLDERS = sorted(
    folder
    for package in PACKAGES
    for folder in (ROOT / package).iterdir()
    if folder.is_dir() and any(folder.glob("*.py"))
)


def test_packages_are_folders_with_names():
    """A package holds at most eleven folders, and at most three modules next to its `__init__`."""
    for package in PACKAGES:
        modules = {path.name for path in (ROOT / package).glob("*.py")} - {"__init__.py"}
        assert len(modules) <= 3, modules
        assert sum(folder.parent.name == package for folder in FOLDERS) <= 11


def faults_by_folder(faults: Callable[[Path], set[str]]) -> dict[str, set[str]]:
    """Folders with faults, and their faults."""
    return {folder.relative_to(ROOT).as_posix(): found for folder in FOLDERS if (found := faults(folder))}


def test_folders_list_their_modules():
    """The docstring of a folder's `__init__` is a table of contents."""
    assert faults_by_folder(unlisted) == {}


def unlisted(folder: Path) -> set[str]:
    """Modules and folders that the table of contents lacks."""
    listed = {line.split()[0].split(".")[0] for line in table(folder / "__init__.py")}
    there = {path.stem for path in folder.glob("*.py")} | {path.parent.name for path in folder.glob("*/__init__.py")}
    return there - {"__init__"} - listed


def test_tests_mirror_the_folders_and_say_what_covers_what():
    """The `__init__` of a folder in `tests` names, for each module, the test files that fail if it is broken."""
    assert faults_by_folder(uncovered) == {}


def uncovered(folder: Path) -> set[str]:
    """Modules without a line in the folder of tests, and files named there that do not exist."""
    here = ROOT / "tests" / folder.relative_to(ROOT)
    covered = dict(line.split(": ", 1) for line in table(here / "__init__.py") if ": " in line)
    modules = {path.relative_to(folder).with_suffix("") for path in folder.rglob("*.py")}
    wanted = {".".join(path.parts) for path in modules if path.name != "__init__"}
    places = (here, here.parent, ROOT / "tests")
    named = {file for files in covered.values() for file in files.split(", ")}
    return (wanted - covered.keys()) | {file for file in named if not any((place / file).is_file() for place in places)}


def table(init: Path) -> list[str]:
    """Lines of a folder's docstring below its first line."""
    text = ast.get_docstring(tree(init)) or ""
    return [line for line in text.split("\n")[1:] if line and not line.startswith(" ")]


def test_names_of_modules_are_unique_within_a_package():
    """A name in a traceback or a search result then identifies one file."""
    places: dict[tuple[str, str], list[str]] = {}
    for path in SOURCES:
        inside = path.relative_to(ROOT)
        if path.name != "__init__.py":
            places.setdefault((inside.parts[0], path.stem), []).append(str(inside))
    assert not {name: found for name, found in places.items() if len(found) > 1}


def test_files_are_small():
    """Files of sources and tests have at most 300 lines; a longer file usually has two responsibilities."""
    files = [*SOURCES, *(ROOT / "tests").rglob("*.py")]
    long = {str(path.relative_to(ROOT)): n for path in files if (n := len(path.read_text().splitlines())) > 300}
    assert not long


def test_typed_marker_ships():
    for package in PACKAGES:
        assert (ROOT / package / "py.typed").exists()
