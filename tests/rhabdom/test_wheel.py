"""A wheel, built from the sdist and installed in an empty environment outside the repository, works as the README
describes.

rhabdom's dependencies are borrowed from this environment to make the test quick; CI installs them all from the index.
"""

import os
import site
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]
ELSEWHERE = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
PYTHON = f"python{sys.version_info.major}.{sys.version_info.minor}"


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """sdist and wheel; the wheel is built from the sdist."""
    out = tmp_path_factory.mktemp("dist")
    command = [sys.executable, "-m", "build", "--no-isolation", "--outdir", out, ROOT]
    child = subprocess.run(command, capture_output=True, text=True, check=False)
    assert child.returncode == 0, child.stdout[-2000:]
    return out


@pytest.fixture(scope="module")
def bare(built, tmp_path_factory):
    """Folder of a new environment with the wheel installed."""
    folder = tmp_path_factory.mktemp("elsewhere") / "env"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder], check=True)
    packages = folder / "lib" / PYTHON / "site-packages"
    [wheel] = built.glob("*.whl")
    pip = [sys.executable, "-m", "pip", "--python", folder / "bin" / "python", "install", "--quiet"]
    # PYTHONPATH is removed, because an editable checkout on it would be taken for the wheel.
    subprocess.run([*pip, "--no-deps", "--no-index", wheel], check=True, env=ELSEWHERE)
    (packages / "zz_borrowed.pth").write_text("\n".join(site.getsitepackages()))
    return folder


def call(bare: Path, *command: str, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    command = (str(bare / "bin" / command[0]), *command[1:])
    return subprocess.run(command, cwd=cwd or bare.parent, env=ELSEWHERE, capture_output=True, text=True, check=False)


def test_the_sdist_holds_what_the_repository_holds(built):
    [sdist] = built.glob("*.tar.gz")
    with tarfile.open(sdist) as archive:
        held = {name.partition("/")[2] for name in archive.getnames()}
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False).stdout.split(
        "\n"
    )
    if not any(listed):
        pytest.skip("no git repository, such as an unpacked sdist: there is no list to compare with")
    tracked = {name for name in listed if name and not name.startswith('"') and (ROOT / name).exists()}
    assert tracked - held == set()


def test_the_wheel_touches_no_folder_that_others_may_have(built):
    """Another project's `optics` would overwrite files in a folder with that name."""
    [wheel] = built.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
        about = archive.read(next(name for name in names if name.endswith("METADATA"))).decode()
    assert {name.split("/")[0].partition("-")[0] for name in names} == {"rhabdom", "rhabdom.pth"}
    assert sum(name.endswith((".toml", ".js", ".css", ".csv")) for name in names) > 15
    assert any(name.endswith("evolve/demo/candidates.jsonl") for name in names), (
        "the run that evolve demo shows is missing"
    )
    text = about.partition("\n\n")[2]
    relative = [line for line in text.splitlines() if "](docs/" in line or "](CHANGELOG" in line]
    assert relative == [], "relative links do not work on the package index"
    for line in ("Author: rhabdom developers", "License-Expression: BSD-3-Clause", "Keywords: ", "Classifier: "):
        assert f"\n{line}" in about


def test_all_packages_import_under_both_names(bare):
    child = call(
        bare,
        "python",
        "-c",
        "import rhabdom, optics, sim, evolve\n"
        "print(rhabdom.__version__, rhabdom.optics is optics, rhabdom.evolve.RunConfig is evolve.RunConfig)\n"
        "print(optics.__file__, sim.__file__, evolve.__file__)\n",
    )
    first, second = child.stdout.splitlines()
    assert first.endswith("True True"), child.stderr
    assert second.count(str(bare)) == 3


def test_the_doctor_is_content(bare):
    child = call(bare, "evolve", "doctor")
    assert child.stdout.endswith("all good\n"), child.stdout
    assert child.returncode == 0


def test_missing_llvm_is_one_line(bare, tmp_path):
    code = "import rhabdom; rhabdom.optics.psf(rhabdom.optics.Pupil(aperture_radius=2e-5), sensor_distance=2e-4)"
    environment = {**ELSEWHERE, "DRJIT_LIBLLVM_PATH": str(tmp_path / "libLLVM.so")}
    child = subprocess.run(
        [bare / "bin" / "python", "-c", code], env=environment, capture_output=True, text=True, check=False
    )
    last = child.stderr.strip().splitlines()[-1]
    assert "BackendError: Dr.Jit has no usable LLVM library" in last
    assert "Remedy: install LLVM" in last


def test_another_optics_is_named_and_does_no_harm(bare):
    """Another `optics` in the same folder would overwrite ours."""
    packages = bare / "lib" / PYTHON / "site-packages"
    files = {
        packages / "optics" / "__init__.py": "lens = 'theirs'\n",
        packages / "glass-9.dist-info" / "METADATA": "Metadata-Version: 2.1\nName: glass\nVersion: 9\n",
        packages / "glass-9.dist-info" / "RECORD": "optics/__init__.py,,\n",
    }
    for path, text in files.items():
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
    try:
        assert call(bare, "python", "-c", "import optics; print(optics.lens)").stdout == "theirs\n"
        child = call(bare, "evolve", "genes")
        assert child.returncode == 0
        assert "the project glass 9 holds a package optics too: pip uninstall glass" in child.stderr
    finally:
        for path in files:
            path.unlink()
    assert call(bare, "evolve", "genes").stderr == ""
