"""Public names for the reference: packages load lazily, so that griffe, which reads source, finds no imports in them.

Their tables of contents (`_CONTENTS`, `_HOME`: name to module, or to module:name) become aliases: `::: optics.psf` then
finds optics.point_spread.psf.psf.
"""

from __future__ import annotations

import ast
from typing import Any

import griffe

TABLES = ("_CONTENTS", "_HOME")


class PublicNames(griffe.Extension):
    """Adds to a package an alias for every name in its table of contents."""

    def on_package(self, *, pkg: griffe.Module, **_: Any) -> None:
        for table in TABLES:
            if table in pkg.members:
                for name, home in ast.literal_eval(str(pkg[table].value)).items():
                    module, _, own_name = home.partition(":")
                    module = module if module.startswith(f"{pkg.name}.") else f"{pkg.name}.{module}"
                    if name not in pkg.members:
                        pkg.set_member(name, griffe.Alias(name, f"{module}.{own_name or name}"))
