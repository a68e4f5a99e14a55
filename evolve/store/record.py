"""The record of a run, candidates.jsonl: one line per evaluated candidate and rung, in the order of completion.

When a record is read, every line is checked. Writing only appends lines.
"""

from __future__ import annotations

import os
from bisect import bisect_left
from dataclasses import dataclass, field
from pathlib import Path

from evolve.config.numbering import Place
from evolve.config.run_config import RunConfig
from evolve.genome.genotype import Genotype
from evolve.store.candidate import Candidate
from evolve.store.regular_files import opened, read

__all__ = ["Record", "RunError"]

LAST_LINE = "; it is the last line: if you delete it, the run can continue and evaluates this candidate again"
Lines = dict[tuple[int, int], Candidate]  # (candidate id, rung) -> the candidate after this rung


class RunError(ValueError):
    """An operation on a run directory is impossible; the message states the reason in one line."""


@dataclass
class Record:
    """The lines of a record on disk.

    lines: candidates by (id, rung), in the order of the file
    candidates: candidates in the order of their ids, each as recorded after the last rung that it has reached
    notice: message about an unfinished last line that was skipped, for example after a power failure; None without one
    """

    path: Path
    lines: Lines = field(default_factory=dict)
    candidates: tuple[Candidate, ...] = ()
    notice: str | None = None
    _whole_bytes: int = 0

    @classmethod
    def read(cls, path: Path, config: RunConfig) -> Record:
        """Read a record, and check that each line agrees with `config` and with earlier lines.

        Raises:
            RunError: the file cannot be read, or a line is damaged; the message names the file and the line.
        """
        try:
            content = read(path)
        except OSError as error:
            raise RunError(f"{path}: cannot be read: {error.strerror}") from error
        whole_bytes = content.rfind(b"\n") + 1
        texts = content[:whole_bytes].splitlines()
        notice = None
        if len(content) > whole_bytes:
            notice = f"{path}: line {len(texts) + 1} is unfinished and is left out; its candidate counts as unevaluated"
        lines: Lines = {}
        dimension = Genotype(config.genome).dimension
        for number, text in enumerate(texts, start=1):
            try:
                candidate = Candidate.from_line(text.decode())
                _require_agreement(candidate, config, dimension, lines)
            except ValueError as error:
                hint = LAST_LINE if number == len(texts) else ""
                raise RunError(f"{path}, line {number}: is damaged: {error}{hint}") from error
            lines[candidate.id, candidate.rung] = candidate
        return cls(path, lines, _furthest(lines), notice, whole_bytes)

    def append(self, candidate: Candidate) -> None:
        """Append a candidate, and synchronise the file with the disk.

        Raises:
            RunError: the candidate is already on record or cannot be restored from it, another process has changed the
                record, or the record cannot be written; earlier lines remain intact.
        """
        if (candidate.id, candidate.rung) in self.lines:
            raise RunError(f"{self.path.parent}: candidate {candidate.id} has been evaluated already")
        _require_readable(candidate, self.path)
        line = candidate.to_line().encode()
        try:
            with opened(self.path, "ab") as file:
                if file.tell() != self._whole_bytes:  # another run may have been started in the directory
                    raise RunError(f"{self.path}: was changed by another process; nothing is added")
                file.write(line)
                file.flush()
                os.fsync(file.fileno())
        except FileNotFoundError:
            raise RunError(f"{self.path}: was changed by another process; nothing is added") from None
        except OSError as error:
            raise RunError(f"{self.path}: cannot be written: {error.strerror}") from error
        self._whole_bytes += len(line)
        self.lines[candidate.id, candidate.rung] = candidate
        self.candidates = _with(self.candidates, candidate)

    def cut_off_unfinished(self) -> None:
        """Remove an unfinished last line from the file.

        Raises:
            RunError: the file cannot be written.
        """
        try:
            with opened(self.path, "r+b") as file:
                file.truncate(self._whole_bytes)
                os.fsync(file.fileno())
        except OSError as error:
            raise RunError(f"{self.path}: cannot be written: {error.strerror}") from error


def _require_readable(candidate: Candidate, path: Path) -> None:
    """Check that a candidate will read back equal; `Candidate.recordable` returns such candidates.

    Raises:
        RunError: it would read back differently, or be refused.
    """
    try:
        if candidate == candidate.recordable():
            return
        reason = "it would read back differently"
    except ValueError as error:
        reason = str(error)
    raise RunError(f"{path}: candidate {candidate.id} cannot be written: {reason}; nothing is added")


def _furthest(lines: Lines) -> tuple[Candidate, ...]:
    """Return each candidate as recorded after the last rung that it has reached, in the order of ids."""
    furthest = {candidate_id: lines[candidate_id, rung] for candidate_id, rung in sorted(lines)}
    return tuple(furthest.values())


def _with(candidates: tuple[Candidate, ...], new: Candidate) -> tuple[Candidate, ...]:
    """Return the candidates after one more line, as `_furthest` would, but without a pass over all lines."""
    at = bisect_left(candidates, new.id, key=lambda candidate: candidate.id)
    known = at < len(candidates) and candidates[at].id == new.id
    if known and candidates[at].rung > new.rung:
        return candidates
    return (*candidates[:at], new, *candidates[at + known :])


def _require_agreement(candidate: Candidate, config: RunConfig, dimension: int, earlier: Lines) -> None:
    """Check that a line of the record agrees with the run's settings and with earlier lines.

    A comparison with the search's proposals is not part of this check; see `evolve.search.same_search`.

    Raises:
        ValueError: the line disagrees; the message states the reason.
    """
    population, rungs = config.search.population, config.search.rungs
    if (candidate.id, candidate.rung) in earlier:
        raise ValueError(f"candidate {candidate.id} is there twice")
    if not 0 <= candidate.rung < rungs:
        raise ValueError(f"rung = {candidate.rung}: must be at least 0 and below search.rungs = {rungs}")
    if candidate.rung and (candidate.id, candidate.rung - 1) not in earlier:
        raise ValueError(f"candidate {candidate.id} is on rung {candidate.rung}, but the rung below is missing")
    if candidate.place != Place.from_id(candidate.id, population):
        raise ValueError(
            f"candidate {candidate.id} can't be number {candidate.index} of generation {candidate.generation} "
            f"with a population of {population}"
        )
    if len(candidate.genome) != dimension:
        raise ValueError(f"genome has {len(candidate.genome)} values, {dimension} genes are open")
