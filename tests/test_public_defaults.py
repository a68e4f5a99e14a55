"""Defaults of public callables are those of a stored list, because a changed default changes results without a message.

After a deliberate change, write the list again, and mention the change in CHANGELOG.md:

    python -m tests.test_public_defaults
"""

import inspect
import re
from pathlib import Path

import pytest

import evolve
import optics
import sim
from tests.walked_arguments import public

STORED = Path(__file__).with_name("public_defaults.txt")
PACKAGES = (optics, sim, evolve)


def defaults(package):
    """Return the lines of a package: "optics.psf: tolerance = 0.01"."""
    lines = []
    for name in public(package):
        callable_ = package
        for part in name.split("."):
            callable_ = getattr(callable_, part)
        for each in inspect.signature(callable_).parameters.values():
            if each.default is not inspect.Parameter.empty:
                value = re.sub(r" at 0x[0-9a-f]+", "", repr(each.default))
                lines.append(f"{package.__name__}.{name}: {each.name} = {' '.join(value.split())}")
    return sorted(lines)


@pytest.mark.parametrize("package", PACKAGES, ids=lambda package: package.__name__)
def test_defaults_are_those_of_the_list(package):
    stored = [line for line in STORED.read_text().splitlines() if line.startswith(f"{package.__name__}.")]
    assert defaults(package) == stored
    assert len(stored) > 20


if __name__ == "__main__":
    STORED.write_text("".join(f"{line}\n" for package in PACKAGES for line in defaults(package)))
