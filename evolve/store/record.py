"""The record of a run, candidates.jsonl: one line per evaluated candidate and budget stage, in order of finishing.

It is read whole, checked line by line, and only ever added to.
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

LAST_LINE = "; it is the last line: without it, the run goes on, and evaluates this candidate again"
Lines = dict[tuple[int, int], Candidate]  # (candidate id, rung) -> the candidate as it was there


class RunError(ValueError):
    """A run directory that cannot be used as asked; the message is one line that says why."""


@dataclass
class Record:
    """The lines of a record, as they are on disk.

    lines: candidates by (id, rung), in the order of the file
    candidates: in order of their ids, each as it is on the highest rung that it has reached
    notice: one line on what had to be left out when reading: a line that was being written when the power went
    """

    path: Path
    lines: Lines = field(default_factory=dict)
    candidates: tuple[Candidate, ...] = ()
    notice: str | None = None
    _whole_bytes: int = 0

    @classmethod
    def read(cls, path: Path, config: RunConfig) -> Record:
        """The record in a file, each line of which must agree with `config` and with the lines before it.

        Raises:
            RunError: the file cannot be read, or a line is damaged; names file and line.
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
        """Write a candidate down for good.

        Raises:
            RunError: the candidate is there already, somebody else has changed the record, or it cannot be written;
                what was there before still is.
        """
        if (candidate.id, candidate.rung) in self.lines:
            raise RunError(f"{self.path.parent}: candidate {candidate.id} has been evaluated already")
        line = candidate.to_line().encode()
        try:
            with opened(self.path, "ab") as file:
                if file.tell() != self._whole_bytes:  # the directory was deleted, say, and another run begun in it
                    raise RunError(f"{self.path}: is no longer as this process left it; nothing is added")
                file.write(line)
                file.flush()
                os.fsync(file.fileno())
        except FileNotFoundError:
            raise RunError(f"{self.path}: is no longer as this process left it; nothing is added") from None
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


def _furthest(lines: Lines) -> tuple[Candidate, ...]:
    """Each candidate as it is on the highest rung that it has reached, in order of ids."""
    furthest = {candidate_id: lines[candidate_id, rung] for candidate_id, rung in sorted(lines)}
    return tuple(furthest.values())


def _with(candidates: tuple[Candidate, ...], new: Candidate) -> tuple[Candidate, ...]:
    """The same as `_furthest` makes of all lines, one more among them, without a look at each."""
    at = bisect_left(candidates, new.id, key=lambda candidate: candidate.id)
    known = at < len(candidates) and candidates[at].id == new.id
    if known and candidates[at].rung > new.rung:
        return candidates
    return (*candidates[:at], new, *candidates[at + known :])


def _require_agreement(candidate: Candidate, config: RunConfig, dimension: int, earlier: Lines) -> None:
    """A line must agree with the run's settings and with the lines before it; what the search would have proposed is
    for the search to compare.

    Raises:
        ValueError: says what does not agree.
    """
    population, rungs = config.search.population, config.search.rungs
    if (candidate.id, candidate.rung) in earlier:
        raise ValueError(f"candidate {candidate.id} is there twice")
    if not 0 <= candidate.rung < rungs:
        raise ValueError(f"rung = {candidate.rung}: must be at least 0 and below search.rungs = {rungs}")
    if candidate.rung and (candidate.id, candidate.rung - 1) not in earlier:
        raise ValueError(f"candidate {candidate.id} is on rung {candidate.rung}, but has not been one below")
    if candidate.place != Place.of(candidate.id, population):
        raise ValueError(
            f"candidate {candidate.id} can't be number {candidate.index} of generation {candidate.generation} "
            f"with a population of {population}"
        )
    if len(candidate.genome) != dimension:
        raise ValueError(f"genome has {len(candidate.genome)} values, {dimension} genes are open")
