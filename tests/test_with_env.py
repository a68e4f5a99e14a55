"""`with-env`, its Python a stand-in that installs nothing: who is asked, where commands run, two at once."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
# Notes how it is called. `-m venv` takes a moment and makes an environment of stand-ins like itself.
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
    """A folder with `with-env`, and commands that only say that they were called."""
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
    for _ in range(2):  # set up on the way, and set up already
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
    """Who has no LLVM and is not root: the package is unpacked beside the environment, unless they say otherwise."""
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
