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
    """Return a table with a row per candidate, indexed by id.

    Columns are the outcome, the acuity [cycles/degree], and the values of all genes that the animal expresses. A failed
    candidate has a fitness of NaN and the reason in `failure`.
    """
    import pandas as pd

    rows = [_row(candidate) for candidate in candidates]
    return pd.DataFrame(rows, index=pd.Index([candidate.id for candidate in candidates], name="id"))


def drift_table(drift: Drift) -> pd.DataFrame:
    """Return a table with a row per quantity: its mean at the end of the run, and in searches with random fitness."""
    import pandas as pd

    rows = [(one.mean, one.median, one.low, one.high, one.p) for one in drift.moved]
    names = pd.Index([one.quantity for one in drift.moved], name="quantity")
    return pd.DataFrame(rows, columns=["run", "median", "low", "high", "p"], index=names)


def _row(candidate: Candidate) -> dict[str, object]:
    outcome = {name: getattr(candidate, name) for name in OUTCOME}
    if candidate.failure is not None:
        outcome["fitness"] = float("nan")
    return {**outcome, "acuity_cpd": acuity_cpd(candidate.phenotype), **gene_values(candidate.phenotype)}
