"""`evolve validate` runs every validation script of the checkout, and tells which failed."""

import re
from pathlib import Path
from types import SimpleNamespace

import pytest

from evolve.cli.commands import checks

ROOT = Path(__file__).parents[3]


@pytest.mark.parametrize("failing", [(), ("validation.B1_aliasing",)])
def test_validate_runs_every_script_and_names_those_that_fail(call, monkeypatch, failing):
    ran = []

    def run(command, cwd, check):
        assert Path(cwd) == ROOT
        ran.append(command[-1])
        return SimpleNamespace(returncode=int(command[-1] in failing))

    monkeypatch.setattr(checks.backend, "require", lambda: None)
    monkeypatch.setattr(checks.subprocess, "run", run)
    code, out, _ = call("validate")
    scripts = {f"validation.{path.stem}" for path in (ROOT / "validation").glob("*.py") if path.stem[1:2].isdigit()}
    assert set(ran) == scripts
    assert len(scripts) > 10
    assert code == bool(failing)
    assert all(re.search(rf"\d+/{len(scripts)} {name.partition('.')[2]}, after \d+:\d\d\n", out) for name in scripts)
    assert out.splitlines()[-1] == ("failed: B1_aliasing" if failing else f"all {len(scripts)} passed")


def test_validate_needs_a_checkout(call, monkeypatch, tmp_path):
    monkeypatch.setattr(checks, "CHECKOUT", tmp_path)
    code, _, err = call("validate")
    assert code == 2
    assert "needs a checkout" in err
