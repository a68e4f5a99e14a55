"""requirements.lock: every package that pyproject.toml requires, in an allowed version, with hashes."""

import re
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[1]
LOCKED_EXTRAS = ("dev", "docs", "rerun")
PIN = re.compile(r"(?P<name>[A-Za-z0-9._-]+)(?:\[[^]]*\])?==(?P<version>\S+?)(?: ; [^\\]*)?\s*")


def asked():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = [line for name in LOCKED_EXTRAS for line in project["optional-dependencies"][name]]
    return [Requirement(line) for line in (*project["dependencies"], *extras)]


def pins(text):
    """Pinned version of each package.

    Raises:
        ValueError: a line is not a pin, or has no hash.
    """
    found = {}
    lines = [line for line in text.split("\n") if not line.startswith("#")]
    for entry in "\n".join(lines).replace("\\\n", "").strip().split("\n"):
        pin, *hashes = entry.split("--hash=sha256:")
        match = PIN.fullmatch(pin)
        if match is None or not hashes or not all(re.fullmatch(r"[0-9a-f]{64}\s*", digest) for digest in hashes):
            raise ValueError(f"no pin with hashes: {entry[:80]}")
        found[canonicalize_name(match["name"])] = match["version"]
    return found


def unmet(requirements, locked):
    """Requirements that the lock file lacks, or pins in a version that they do not allow."""
    names = {requirement: canonicalize_name(requirement.name) for requirement in requirements}
    return [
        str(requirement)
        for requirement, name in names.items()
        if name not in locked or not requirement.specifier.contains(locked[name], prereleases=True)
    ]


def test_the_lock_file_has_what_the_project_asks_for():
    assert unmet(asked(), pins((ROOT / "requirements.lock").read_text())) == []


def test_another_version_is_noticed():
    pin = f"numpy==1.26.4 \\\n    --hash=sha256:{'0' * 64}\n"
    assert pins(pin) == {"numpy": "1.26.4"}
    assert unmet([Requirement("numpy>=2.0"), Requirement("Scipy")], pins(pin)) == ["numpy>=2.0", "Scipy"]
    assert unmet([Requirement("NumPy>=1.0")], pins(pin)) == []
    for bad in ("numpy==1.0\n", "numpy>=1.0 --hash=sha256:00\n", f"numpy>=1.0 --hash=sha256:{'0' * 64}"):
        with pytest.raises(ValueError, match="no pin with hashes"):
            pins(bad)
