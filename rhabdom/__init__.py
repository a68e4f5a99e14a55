"""rhabdom: evolving eyes, simulated with physical optics.

optics    wave optics, from light to photoreceptor signals
sim       simulated worlds, and the signals of eyes in them
evolve    evolutionary search: genomes, learning, runs

`rhabdom.optics` and `optics` are the same package. Each package is imported on first use. This package contains three
modules:

importing  locations of the three packages, and conflicts with other packages of the same names
command    entry point of the command `evolve`
streams    standard streams that stay usable if they are closed, full or badly encoded
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
