"""evolve: evolution of eyes and brains in the worlds of `sim`.

run, resume                     functions that start and complete a run, and complete an interrupted run
Run                             an opened run directory: candidates, tables, figures, reports and replays
Candidate                       a genome, its animal, and the outcome of training and evaluation
RunConfig                       all settings of a run, with the sections EyeConfig, SearchConfig, LearningConfig,
                                EvaluationConfig and CostsConfig
GENES, Gene, GeneConfig         quantities that evolution can change, and their settings in a run
Genotype, Phenotype, develop    encoding of genes in a genome, eyes and brain of an animal, and development of a genome
load_policy                     trained policy from a file
ConfigError, RunError           errors in settings, and in operations on run directories

Each name is imported on first use.
"""

from __future__ import annotations

import rhabdom  # noqa: F401 (makes `import optics` and `import sim` find rhabdom's packages)

TYPE_CHECKING = False
if TYPE_CHECKING:  # avoids importing `typing`, since Ctrl-C is not yet handled during these milliseconds
    from typing import Any

_HOME = {
    "RunConfig": "evolve.config.run_config",
    "EyeConfig": "evolve.config.run_config",
    "GeneConfig": "evolve.config.run_config",
    "SearchConfig": "evolve.config.run_config",
    "LearningConfig": "evolve.config.run_config",
    "EvaluationConfig": "evolve.config.run_config",
    "CostsConfig": "evolve.config.run_config",
    "ConfigError": "evolve.config.run_config",
    "GENES": "evolve.genome.genes",
    "Gene": "evolve.genome.genes",
    "Genotype": "evolve.genome.genotype",
    "Phenotype": "evolve.genome.phenotype",
    "develop": "evolve.genome.phenotype",
    "Run": "evolve.interactive.opened_run:OpenedRun",
    "run": "evolve.interactive.run_from_python",
    "resume": "evolve.interactive.run_from_python",
    "RunError": "evolve.store.directory",
    "Candidate": "evolve.store.candidate",
    "load_policy": "evolve.learning.policy",
}

__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'evolve' has no attribute {name!r}")
    from importlib import import_module

    module, _, own_name = _HOME[name].partition(":")
    return getattr(import_module(module), own_name or name)


def __dir__() -> list[str]:
    return __all__
