"""Check that a rebuilt search proposes the candidates on record. Only such a search can continue a run.

To continue a run, its search is rebuilt: all proposals are repeated, and the recorded fitness is reported again. If
processor and libraries are the same as at the start of the run, the proposed genomes equal those on record bit for bit.
Another processor may round differently, and the difference can grow, because pycma recognises its own solutions by
their bits. If the last bit of a solution differs, pycma treats the solution as injected from outside. If this solution
is far from the mean of the search distribution, pycma then moves it closer.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from evolve.search.search import Proposal
from evolve.store.candidate import Candidate
from evolve.store.directory import Run, RunError
from evolve.store.versions import present, recorded

__all__ = ["SameSearch"]

# Largest differences of a coordinate in [0, 1] that are accepted. Seventeen records of a processor with AVX-512 were
# repeated on a processor without it (tests/experiments/test_records.py). The differences were at most 2e-12; if pycma
# treated a solution as injected, they were at most 4e-3. The tolerances are 500 and 5 times as large, as a margin for
# longer runs.
ROUNDING, TAKEN_FOR_ANOTHERS = 1e-9, 0.02
LIBRARIES = ("nevergrad", "cma", "numpy")


class SameSearch:
    """Comparison of a search's proposals with a run's record.

    A genome is a vector of coordinates in [0, 1]. The tolerance is the largest accepted difference between a coordinate
    of the proposed genome and the same coordinate on record.

    The first generation follows from the settings alone, so its tolerance is 10⁻⁹. Later generations have the wider
    tolerance 0.02, but only if the optimizer's libraries have the same versions as at the start of the run. With other
    versions, the tolerance of all generations is 10⁻⁹.
    """

    def __init__(self, run: Run) -> None:
        self._run, self._then, self._now = run, recorded(run.path), present()
        self._same_libraries = all(self._then.get(name) == self._now[name] for name in LIBRARIES)

    def require(self, proposal: Proposal | None, candidate: Candidate) -> None:
        """Check that a proposal agrees with the candidate on record.

        proposal: proposal of the search; None if it proposes no candidate with this id

        Raises:
            RunError: the search proposes a different candidate, or none.
        """
        allowed = TAKEN_FOR_ANOTHERS if self._same_libraries and candidate.generation > 0 else ROUNDING
        if proposal is not None and np.abs(proposal.vector - candidate.vector).max() <= allowed:
            return
        before, after = (
            ", ".join(f"{name} {versions.get(name, '?')}" for name in LIBRARIES) for versions in (self._then, self._now)
        )
        raise RunError(
            f"{self._run.path} cannot be continued: candidate {candidate.id} differs from the search's proposal "
            f"here (started with {before}; here {after}). Continue it with the versions that started it, and an "
            f"unchanged config.toml"
        )

    def require_complete(self, generation: int, missing: Collection[int]) -> None:
        """Check, before any training, that no candidate of a generation is missing if later generations are on record.

        missing: ids of candidates that still have to be evaluated

        Raises:
            RunError: candidates of this generation are missing although later generations are on record.
        """
        if missing and any(candidate.generation > generation for candidate in self._run.candidates):
            raise RunError(
                f"{self._run.path} cannot be continued: generation {generation} lacks evaluations (candidate "
                f"{min(missing)}), but later ones are on record. Continue it with an unchanged config.toml and record"
            )
