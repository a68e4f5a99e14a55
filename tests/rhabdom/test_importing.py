"""`import rhabdom` gives the three packages, under either name, even if other projects use these names."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def python(code: str, *first: Path) -> subprocess.CompletedProcess[str]:
    """Result of running code in a new interpreter, with `first` before rhabdom on the path."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, (*first, ROOT)))}
    command = [sys.executable, "-P", "-c", code]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


@pytest.fixture
def foreign(tmp_path):
    """Another project's `optics`, as pip would install it."""
    (tmp_path / "optics").mkdir()
    (tmp_path / "optics" / "__init__.py").write_text("lens = 'theirs'\n")
    (tmp_path / "glass-9.dist-info").mkdir()
    (tmp_path / "glass-9.dist-info" / "METADATA").write_text("Metadata-Version: 2.1\nName: glass\nVersion: 9\n")
    (tmp_path / "glass-9.dist-info" / "RECORD").write_text("optics/__init__.py,,\n")
    return tmp_path


def test_both_names_are_one_package():
    child = python(
        "import rhabdom, sys\n"
        "import rhabdom.optics.numerics.arguments as one, optics.numerics.arguments as other\n"
        "assert one is other and one.__name__ == one.__spec__.name == 'optics.numerics.arguments'\n"
        "from rhabdom.optics import Grid\n"
        "import optics, sim, evolve\n"
        "assert Grid is optics.Grid\n"
        "assert (rhabdom.optics, rhabdom.sim, rhabdom.evolve) == (optics, sim, evolve)\n"
        "assert rhabdom.__version__.count('.') == 2 and set(dir(rhabdom)) >= {'optics', 'sim', 'evolve'}\n"
        "print([n for n in ('torch', 'mitsuba', 'drjit', 'scipy', 'mujoco') if n in sys.modules])"
    )
    assert (child.stdout, child.stderr) == ("[]\n", "")


def test_names_that_are_not_there():
    child = python("import rhabdom\ntry: rhabdom.lenses\nexcept AttributeError as error: print(error)")
    assert child.stdout == "module 'rhabdom' has no attribute 'lenses'\n"
    assert "No module named 'rhabdom.optics.lenses'" in python("import rhabdom.optics.lenses").stderr.replace(
        "'optics", "'rhabdom.optics"
    )


@pytest.mark.parametrize("package", ["rhabdom", "sim", "evolve"])
def test_another_projects_package_is_named_and_does_not_stand_in_the_way(foreign, package):
    child = python(f"import {package}, optics; print(optics.Pupil.__module__)", foreign)
    assert child.stdout == "optics.elements.pupil\n", child.stderr
    assert "the project glass 9 holds a package optics too: pip uninstall glass" in child.stderr
    assert child.stderr.count("RuntimeWarning") == 1
    assert "theirs" in python("import optics; print(optics.lens)", foreign).stdout, (
        "without rhabdom the other package is imported"
    )


def test_a_file_of_ones_own_is_named(tmp_path):
    (tmp_path / "sim.py").write_text("")
    child = python("import rhabdom.sim; print(rhabdom.sim.TASKS[0])", tmp_path)
    assert f"rename {tmp_path / 'sim.py'}" in child.stderr
    assert child.stdout


def test_what_has_been_imported_already_cannot_be_helped(foreign):
    child = python("import optics, rhabdom", foreign)
    last = child.stderr.strip().splitlines()[-1]
    assert last.startswith(f"ImportError: {foreign / 'optics'}: is already imported as optics")
