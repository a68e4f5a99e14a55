"""`evolve validate` runs the proofs of the checkout, and lists the failed ones."""

import re
import tomllib
from pathlib import Path
from types import SimpleNamespace

import pytest

from evolve.cli.commands import validate

ROOT = Path(__file__).parents[3]
PROOFS = tomllib.loads((ROOT / "validation/proofs.toml").read_text())["proofs"]
NAMES = [path.rpartition("/")[2] for path in PROOFS]


@pytest.fixture
def ran(monkeypatch):
    """Record the modules that would run; some of them fail."""
    modules, failing = [], []

    def run(command, cwd, check):
        assert Path(cwd) == ROOT
        modules.append(command[-1])
        return SimpleNamespace(returncode=int(command[-1] in failing))

    monkeypatch.setattr(validate.backend, "require", lambda: None)
    monkeypatch.setattr(validate.subprocess, "run", run)
    return SimpleNamespace(modules=modules, failing=failing)


@pytest.mark.parametrize("failing", [False, True])
def test_validate_runs_every_proof_and_names_those_that_fail(call, ran, failing):
    ran.failing += ["validation.optics.aliasing"] * failing
    code, out, _ = call("validate")
    assert ran.modules == [f"validation.{path.replace('/', '.')}" for path in PROOFS]
    assert all((ROOT / "validation" / f"{path}.py").is_file() for path in PROOFS)
    assert len(PROOFS) > 20
    assert code == failing
    assert all(re.search(rf"\d+/{len(NAMES)} {name}, after \d+:\d\d\n", out) for name in NAMES)
    assert out.splitlines()[-1] == ("failed: aliasing" if failing else f"all {len(NAMES)} passed")


def test_validate_runs_those_named_and_takes_old_codes(call, ran):
    code, _, err = call("validate", "thin_element", "B0", "F1_mutants")
    assert code == 0
    assert ran.modules == [
        "validation.optics.thin_element",
        "validation.optics.psf_error_prediction",
        "validation.mutants.mutation_testing",
    ]
    assert err == "B0 is now called psf_error_prediction\nF1_mutants is now called mutation_testing\n"


def test_every_old_code_leads_to_one_proof():
    codes = [old.partition("_")[0] for old in PROOFS.values() if old]
    assert len(set(codes)) == len(codes) == 24


def test_validate_lists_names_first_and_runs_nothing(call, ran):
    code, out, err = call("validate", "--list")
    assert (code, err, ran.modules) == (0, "", [])
    assert [line.split()[0] for line in out.splitlines()] == NAMES
    assert "psf_error_prediction         Does the predicted error hold?" in out
    assert all(len(line.split()) > 3 for line in out.splitlines())


def test_an_unknown_proof_ends_in_one_line(call, ran):
    code, _, err = call("validate", "psf_error_predictions")
    assert (code, ran.modules) == (2, [])
    assert err == (
        "evolve: error: validate psf_error_predictions: there is no such script; did you mean 'psf_error_prediction'? "
        "(see evolve validate --list)\n"
    )


def test_validate_needs_a_checkout(call, monkeypatch, tmp_path):
    monkeypatch.setattr(validate, "CHECKOUT", tmp_path)
    code, _, err = call("validate")
    assert code == 2
    assert "needs a checkout" in err
