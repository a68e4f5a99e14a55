"""rhabdom: eyes that evolve, seen through real optics.

optics    light to photoreceptor signal by wave optics
sim       worlds, and what eyes see in them
evolve    the search: genomes, learning, runs

`rhabdom.optics` and `optics` are the same package; all of it loads on first use. The modules here:

importing  finds the three packages, and says who else bears their names
command    the command `evolve`
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

from rhabdom.importing import NAMES, come_first

__all__ = ["__version__", "evolve", "optics", "sim"]

__version__ = "0.1.0"

come_first()


def __getattr__(name: str) -> Any:
    if name not in NAMES:
        raise AttributeError(f"module 'rhabdom' has no attribute {name!r}")
    return import_module(f"rhabdom.{name}")


def __dir__() -> list[str]:
    return __all__
