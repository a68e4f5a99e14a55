"""Tables of the candidates of a run, and of a run's comparison with simulated searches whose fitness is random."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from evolve.analysis.acuity import acuity_cpd, acuity_vertical_cpd
from evolve.analysis.statistics import gene_values
from evolve.store.candidate import Candidate

if TYPE_CHECKING:
    import pandas as pd

    from evolve.report.gene_drift import Drift

__all__ = ["candidate_table", "drift_table"]

FITNESS = ("fitness", "task_fitness", "costs")
OUTCOME = ("generation", "index", *FITNESS, "success_rate", "steps", "seconds", "seed", "failure", "parents")


def candidate_table(candidates: Sequence[Candidate]) -> pd.DataFrame:
    """Return a table with one row per candidate, indexed by its id.

    The columns are the outcome, the acuities [cycles/degree], and the values of all genes that an animal expresses.
    Genes that an animal lacks are NaN. For a failed candidate, fitness, task fitness and costs are NaN, and `failure`
    contains the reason.
    """
    import pandas as pd

    rows = [_row(candidate) for candidate in candidates]
    return pd.DataFrame(rows, index=pd.Index([candidate.id for candidate in candidates], name="id"))


def drift_table(drift: Drift) -> pd.DataFrame:
    """Return a table that compares a run with searches whose fitness is random. Each row is a quantity, such as a gene.

    Column `run` is the quantity's mean in the run's last generations. The quantity has such a mean in each search, too:
    `median` is the median of the searches' means, and 95 % of them lie between `low` and `high`. `p` is the p-value of
    `run`.
    """
    import pandas as pd

    rows = [(one.mean, one.median, one.low, one.high, one.p) for one in drift.moved]
    names = pd.Index([one.quantity for one in drift.moved], name="quantity")
    return pd.DataFrame(rows, columns=["run", "median", "low", "high", "p"], index=names)


def _row(candidate: Candidate) -> dict[str, object]:
    outcome = {name: getattr(candidate, name) for name in OUTCOME}
    if candidate.failure is not None:
        outcome |= dict.fromkeys(FITNESS, float("nan"))
    animal = candidate.phenotype
    acuities = {"acuity_cpd": acuity_cpd(animal), "acuity_vertical_cpd": acuity_vertical_cpd(animal)}
    return {**outcome, **acuities, **gene_values(animal)}
