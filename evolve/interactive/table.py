"""A run's candidates as a table."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from evolve.analysis.statistics import acuity_cpd, gene_values
from evolve.store.candidate import Candidate

if TYPE_CHECKING:
    import pandas as pd

    from evolve.report.gene_drift import Drift

__all__ = ["candidate_table", "drift_table"]

OUTCOME = ("generation", "index", "fitness", "success_rate", "steps", "seconds", "seed", "failure", "parents")


def candidate_table(candidates: Sequence[Candidate]) -> pd.DataFrame:
    """A row per candidate, by its id: how it fared, its acuity [cycles/degree], and the value of every gene that shows
    in the animal. A failed one has a fitness of NaN, and says why under `failure`."""
    import pandas as pd

    rows = [_row(candidate) for candidate in candidates]
    return pd.DataFrame(rows, index=pd.Index([candidate.id for candidate in candidates], name="id"))


def drift_table(drift: Drift) -> pd.DataFrame:
    """A row per quantity, by its name: where the run ended, and searches with random fitness."""
    import pandas as pd

    rows = [(one.mean, one.median, one.low, one.high, one.p) for one in drift.moved]
    names = pd.Index([one.quantity for one in drift.moved], name="quantity")
    return pd.DataFrame(rows, columns=["run", "median", "low", "high", "p"], index=names)


def _row(candidate: Candidate) -> dict[str, object]:
    outcome = {name: getattr(candidate, name) for name in OUTCOME}
    if candidate.failure is not None:
        outcome["fitness"] = float("nan")
    return {**outcome, "acuity_cpd": acuity_cpd(candidate.phenotype), **gene_values(candidate.phenotype)}
