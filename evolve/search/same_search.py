"""Whether a search proposes what is on record. The same one goes on; another is refused.

A search is rebuilt by proposing and telling again what was proposed and told before, so it must come to the same
genomes. On the processor that began the run it does, bit for bit. Another processor rounds otherwise, and once in a
while that counts for more than rounding: pycma knows the solutions that come back by their bits, takes one whose last
bit differs for somebody else's, and shortens it if it is long.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from evolve.search.search import Proposal
from evolve.store.candidate import Candidate
from evolve.store.directory import Run, RunError
from evolve.store.versions import present, recorded

__all__ = ["SameSearch"]

# Of a coordinate in [0, 1], with room for longer runs: 500 and 5 times what was seen. Seventeen records of a processor
# with AVX-512, proposed again on one without: 2e-12 at most where no solution was taken for another's, 4e-3 where one
# was (tests/experiments/test_records.py).
ROUNDING, TAKEN_FOR_ANOTHERS = 1e-9, 0.02
LIBRARIES = ("nevergrad", "cma", "numpy")


class SameSearch:
    """Holds what a search proposes against a run's record.

    The first generation follows from the settings alone and may differ by rounding only; so may all of them where the
    libraries are not those that began the run.
    """

    def __init__(self, run: Run) -> None:
        self._run, self._then, self._now = run, recorded(run.path), present()
        self._same_libraries = all(self._then.get(name) == self._now[name] for name in LIBRARIES)

    def require(self, proposal: Proposal | None, candidate: Candidate) -> None:
        """Refuse to go on with another search than the one that began.

        Raises:
            RunError: the search does not propose what is on record.
        """
        allowed = TAKEN_FOR_ANOTHERS if self._same_libraries and candidate.generation > 0 else ROUNDING
        if proposal is not None and np.abs(proposal.vector - candidate.vector).max() <= allowed:
            return
        before, after = (
            ", ".join(f"{name} {versions.get(name, '?')}" for name in LIBRARIES) for versions in (self._then, self._now)
        )
        raise RunError(
            f"{self._run.path} cannot be continued: candidate {candidate.id} is not what the search proposes here "
            f"(started with {before}; here {after}). Continue it with the versions that began it, and an unchanged "
            f"config.toml"
        )

    def require_complete(self, generation: int, missing: Collection[int]) -> None:
        """Before anybody is trained for it: a search that has gone on from a generation knew all of it.

        Raises:
            RunError: candidates of a generation are missing although there are later ones.
        """
        if missing and any(candidate.generation > generation for candidate in self._run.candidates):
            raise RunError(
                f"{self._run.path} cannot be continued: generation {generation} lacks evaluations (candidate "
                f"{min(missing)}), but later ones are on record. Continue it with an unchanged config.toml and record"
            )
