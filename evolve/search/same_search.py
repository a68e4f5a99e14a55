"""Check that a rebuilt search proposes the candidates on record; a different search cannot continue a run.

A search is rebuilt by repeating all proposals and fitness values, so it must give the same genomes. On the processor
that started the run they are equal bit for bit. Another processor rounds differently, which can have a larger effect:
pycma identifies its solutions by their bits. It treats a solution whose last bit differs as an injected one, and
shortens it if it is long.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from evolve.search.search import Proposal
from evolve.store.candidate import Candidate
from evolve.store.directory import Run, RunError
from evolve.store.versions import present, recorded

__all__ = ["SameSearch"]

# Tolerances of a coordinate in [0, 1], with margins for longer runs: 500 and 5 times the largest observed differences.
# Seventeen records of a processor with AVX-512 were repeated on one without. The differences were at most 2e-12, and
# 4e-3 if a solution was treated as injected (tests/experiments/test_records.py).
ROUNDING, TAKEN_FOR_ANOTHERS = 1e-9, 0.02
LIBRARIES = ("nevergrad", "cma", "numpy")


class SameSearch:
    """Comparison of a search's proposals with a run's record.

    The first generation follows from the settings alone and may differ only by rounding. With other libraries than at
    the start of the run, the same tolerance applies to all generations.
    """

    def __init__(self, run: Run) -> None:
        self._run, self._then, self._now = run, recorded(run.path), present()
        self._same_libraries = all(self._then.get(name) == self._now[name] for name in LIBRARIES)

    def require(self, proposal: Proposal | None, candidate: Candidate) -> None:
        """Check that a proposal equals the candidate on record.

        Raises:
            RunError: the search proposes another candidate than the one on record.
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
        """Check, before any training, that a generation with later generations on record is complete.

        Raises:
            RunError: candidates of a generation are missing although later ones are on record.
        """
        if missing and any(candidate.generation > generation for candidate in self._run.candidates):
            raise RunError(
                f"{self._run.path} cannot be continued: generation {generation} lacks evaluations (candidate "
                f"{min(missing)}), but later ones are on record. Continue it with an unchanged config.toml and record"
            )
