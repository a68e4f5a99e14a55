"""`with-env`, tested with a stand-in for Python that installs nothing: its calls, its working directory, and two starts
at once."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
# The stand-in records its calls. `-m venv` takes a moment and creates an environment of stand-ins.
PYTHON = """#!/bin/bash
echo "$(basename "$0") $*" >>"$CALLS"
case "$*" in
    "-m venv "*) sleep 0.3; mkdir -p "$3/bin"; cp "$0" "$3/bin/python"; cp "$0" "$3/bin/pip" ;;
    *"import torch"* | *"backend.find"*) [ -z "${NO_LLVM:-}" ] || [[ "$*" != *backend* ]] ;;
esac
"""
NOTED = """#!/bin/bash
echo "$(basename "$0") $*" >>"$CALLS"
[ "$(basename "$0")" != id ] || echo 1000
"""


@pytest.fixture
def checkout(tmp_path):
    """A folder with `with-env`, and commands that only record their calls."""
    folder, tools = tmp_path / "checkout", tmp_path / "tools"
    folder.mkdir()
    tools.mkdir()
    for name in ("with-env", "pyproject.toml"):
        shutil.copy(ROOT / name, folder)
    for name, text in (
        ("python-stand-in", PYTHON),
        ("sudo", NOTED),
        ("apt-get", NOTED),
        ("id", NOTED),
        ("dpkg", NOTED),
    ):
        (tools / name).write_text(text)
        (tools / name).chmod(0o755)
    return folder


def environment(checkout, **more):
    tools = checkout.parent / "tools"
    path = f"{tools}:{os.environ['PATH']}"
    return {**os.environ, "PATH": path, "PYTHON": f"{tools}/python-stand-in", "CALLS": str(tools / "calls"), **more}


def calls(checkout):
    return (checkout.parent / "tools" / "calls").read_text().splitlines()


def test_the_command_runs_where_the_user_stands(checkout, tmp_path):
    stands = tmp_path / "elsewhere"
    stands.mkdir()
    for _ in range(2):  # the first call sets up, the second finds the environment
        made = subprocess.run(
            [checkout / "with-env", "sh", "-c", "pwd; echo $VIRTUAL_ENV"],
            cwd=stands,
            env=environment(checkout),
            capture_output=True,
            text=True,
            check=True,
        )
        assert made.stdout.split() == [str(stands), str(checkout / ".venv")]
    assert sum(" -m venv " in call for call in calls(checkout)) == 1
    assert list(stands.iterdir()) == []


@pytest.mark.parametrize("asked", ["", "1"])
def test_sudo_is_used_by_those_who_ask_for_it_alone(checkout, asked):
    """A user without LLVM and without root rights gets the package unpacked next to the environment. sudo is used only
    on request."""
    env = environment(checkout, NO_LLVM="1", WITH_ENV_SUDO=asked)
    subprocess.run([checkout / "with-env", "true"], env=env, capture_output=True, check=False)
    assert any(call.startswith("sudo ") for call in calls(checkout)) == (asked == "1")
    if not asked:
        assert [call for call in calls(checkout) if call.startswith("apt-get")] == ["apt-get download -qq libllvm19"]


@pytest.mark.skipif(shutil.which("flock") is None, reason="without flock nobody waits")
def test_two_first_starts_at_once_set_up_once(checkout):
    command = [checkout / "with-env", "sh", "-c", "sleep 0.1; echo done"]
    both = [subprocess.Popen(command, env=environment(checkout), stdout=subprocess.PIPE, text=True) for _ in range(3)]
    assert [child.communicate(timeout=60)[0] for child in both] == ["done\n"] * 3
    assert [child.returncode for child in both] == [0, 0, 0]
    assert sum(" -m venv " in call for call in calls(checkout)) == 1
    assert sum("install -e" in call for call in calls(checkout)) == 1
