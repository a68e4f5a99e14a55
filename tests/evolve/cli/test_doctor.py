"""`evolve doctor` lists the installed components, and its exit code reports whether an evolution can run."""

import json

import pytest

from evolve.cli import doctor
from evolve.cli.main import main
from optics.numerics import backend
from tests.slow_part import slow


@pytest.fixture(scope="module")
def findings():
    return doctor.examine()


def test_a_working_installation_is_good(findings, monkeypatch, capsys):
    assert findings["good"], findings
    assert findings["variants"] | {"scalar_spectral": "works", "llvm_ad_spectral": "works"} == findings["variants"]
    monkeypatch.setattr(doctor, "examine", lambda: findings)
    assert doctor.print_findings() == 0
    printed = capsys.readouterr().out
    assert f"drjit               {findings['packages']['drjit']}" in printed
    assert f"light tables        {findings['light_cache']['folder']}: writable\n" in printed
    assert f"free memory         {findings['free_memory'] / 2**30:.3g} GiB\n" in printed
    assert f"gpu                 {findings['gpu']} (a GPU {doctor.USE_OF_GPU})\n" in printed
    assert printed.endswith("all good\n")


def test_json_is_the_same_findings(findings, monkeypatch, capsys):
    monkeypatch.setattr(doctor, "examine", lambda: findings)
    doctor.print_findings(as_json=True)
    assert json.loads(capsys.readouterr().out) == findings


def test_light_tables_that_cannot_be_stored_are_named(monkeypatch, tmp_path):
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    monkeypatch.setattr(doctor, "_render", lambda variants, environment: dict.fromkeys(variants, "works"))
    findings = doctor.examine()
    lines = doctor._lines(findings)
    folder = tmp_path / "file" / "rhabdom" / "light"
    assert f"light tables        {folder}: Not a directory; every process computes the tables again" in lines
    assert findings["good"], "runs work without the cache"
    assert not (tmp_path / "file").is_dir()


def test_bad_llvm_is_named_with_the_remedy(monkeypatch, capsys, tmp_path):
    monkeypatch.setenv(backend.VARIABLE, str(tmp_path / "libLLVM.so"))
    assert doctor.print_findings() == 2
    printed = capsys.readouterr().out
    assert "missing: no such file" in printed
    assert backend.REMEDY in printed
    assert "llvm_ad_spectral" not in printed


def test_missing_package_is_not_good(monkeypatch):
    monkeypatch.setattr(doctor, "PACKAGES", ("no-such-package",))
    monkeypatch.setattr(doctor, "_render", lambda variants, environment: dict.fromkeys(variants, "works"))
    findings = doctor.examine()
    assert findings["packages"] == {"no-such-package": "not installed"}
    assert not findings["good"]


@pytest.mark.parametrize(("platform", "supported"), [slow("linux", True), slow("darwin", True), ("win32", False)])
def test_systems_are_named(monkeypatch, platform, supported):
    said = doctor.unsupported(platform)
    assert (said is None) is supported
    monkeypatch.setattr(doctor, "unsupported", lambda: said)
    monkeypatch.setattr(doctor, "PACKAGES", ())
    monkeypatch.setattr(doctor, "_render", lambda variants, environment: dict.fromkeys(variants, "works"))
    findings = doctor.examine()
    assert findings["good"] is supported
    assert ("WSL 2" in "\n".join(doctor._lines(findings))) is not supported


def test_windows_is_refused_in_one_line(monkeypatch, capsys):
    monkeypatch.setattr("sys.platform", "win32")
    monkeypatch.setattr(doctor, "unsupported", lambda: "win32: is not supported")
    with pytest.raises(SystemExit) as stop:
        main(["genes"])
    assert stop.value.code == 2
    assert capsys.readouterr().err == "evolve: error: win32: is not supported\n"


def test_namesakes_are_named(monkeypatch):
    monkeypatch.setattr(doctor, "namesakes", lambda: ["the project glass 9 holds a package optics too"])
    monkeypatch.setattr(doctor, "_render", lambda variants, environment: dict.fromkeys(variants, "works"))
    findings = doctor.examine()
    assert findings["good"], "these findings are harmless"
    assert "note                the project glass 9 holds" in "\n".join(doctor._lines(findings))
