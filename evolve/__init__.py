"""evolve: eyes and brains that evolve in the worlds of `sim`.

Table of contents; everything loads on first use.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

_HOME = {
    "RunConfig": "evolve.config",
    "EyeConfig": "evolve.config",
    "GeneConfig": "evolve.config",
    "SearchConfig": "evolve.config",
    "LearningConfig": "evolve.config",
    "EvaluationConfig": "evolve.config",
    "ConfigError": "evolve.config",
    "GENES": "evolve.genes",
    "Gene": "evolve.genes",
    "Genotype": "evolve.genotype",
    "Phenotype": "evolve.development",
    "develop": "evolve.development",
    "Run": "evolve.store",
    "RunError": "evolve.store",
    "Candidate": "evolve.candidate",
    "load_policy": "evolve.policy",
}

__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'evolve' has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return __all__
