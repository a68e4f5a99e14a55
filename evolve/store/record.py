"""The record of a run, candidates.jsonl: one line for each evaluation of a candidate, in order of completion.

A candidate is evaluated after each part (rung) of its training. When a record is read, the values of every line are
checked. If a line has a checksum (`evolve.store.chain`), this is also checked. Candidates are appended. Only the repair
of a run removes lines: an unfinished last line, or a damaged line and all lines after it.
"""

from __future__ import annotations

import os
import shutil
from bisect import bisect_left
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

from evolve.config.numbering import Place
from evolve.config.run_config import RunConfig
from evolve.genome.genotype import Genotype
from evolve.store.atomic_files import unfinished
from evolve.store.candidate import Candidate
from evolve.store.chain import Chain, without_checksum
from evolve.store.regular_files import opened, require_size

__all__ = ["Record", "RunError"]

LARGEST_RECORD, LONGEST_LINE = 2**31, 2**25  # maximum sizes [bytes]; a candidate's line has some thousands
Lines = dict[tuple[int, int], Candidate]  # (candidate id, rung) -> the candidate after this rung


class RunError(ValueError):
    """An operation on a run directory is impossible; the message states the reason in one line."""


@dataclass
class Record:
    """The lines of a record on disk.

    path: the file candidates.jsonl
    lines: dict from (id of the candidate, rung) to the candidate on this line, in the order of the file. A rung is a
        part of training, after which the candidate is evaluated
    candidates: candidates in the order of their ids, each as recorded after the last rung that it has completed
    notice: message about ignored lines; None if there are none. Ignored lines are an unfinished last line, for example
        after a power failure, or a damaged line and all lines after it
    before_damage: True if only the lines before the first damaged line are used; otherwise, damage is an error
    """

    path: Path
    lines: Lines = field(default_factory=dict)
    candidates: tuple[Candidate, ...] = ()
    notice: str | None = None
    before_damage: bool = False
    _whole_bytes: int = 0
    _chain: Chain = field(default_factory=Chain)
    _damaged: bool = False

    @classmethod
    def read(cls, path: Path, config: RunConfig, before_damage: bool = False) -> Record:
        """Read a record, and check each line's values, its checksum if present, and its agreement with earlier lines.

        config: settings of the run, with which the lines must agree
        before_damage: True to use only the lines before the first damaged line, if there is one

        Raises:
            RunError: the file cannot be read. If `before_damage` is False, a damaged line is also an error; the message
                names the line.
        """
        record = cls(path, before_damage=before_damage)
        torn = False
        try:
            with opened(path) as file:
                require_size(file, path, LARGEST_RECORD)
                torn = record._read_lines(file, config)
        except OSError as error:
            raise RunError(f"{path}: cannot be read: {error.strerror}") from error
        except ValueError as error:
            record._leave_out(f"{path}, line {len(record.lines) + 1}: is damaged: {error}")
        if torn:
            name = f"{path}: line {len(record.lines) + 1}"
            record.notice = f"{name} is unfinished and is left out; its candidate counts as unevaluated"
        record.candidates = _furthest(record.lines)
        return record

    def _read_lines(self, file: BinaryIO, config: RunConfig) -> bool:
        """Read all lines of a file, and return whether its last line is unfinished.

        Raises:
            ValueError: a line is damaged; the message states the reason. `lines` then contains the lines before it.
        """
        dimension = Genotype(config.genome).dimension
        while text := file.readline(LONGEST_LINE + 1):
            if len(text) > LONGEST_LINE:
                raise ValueError(f"it has more than {LONGEST_LINE:,} bytes")
            if not text.endswith(b"\n"):
                return True
            candidate = Candidate.from_line(without_checksum(text).decode())
            _require_agreement(candidate, config, dimension, self.lines)
            self._chain = self._chain.after(text)
            self.lines[candidate.id, candidate.rung] = candidate
            self._whole_bytes += len(text)
        return False

    def _leave_out(self, damage: str) -> None:
        """Ignore a damaged line and all lines after it, if the field `before_damage` is True.

        damage: message about the damaged line

        Raises:
            RunError: `before_damage` is False, so that a damaged line is an error.
        """
        if not self.before_damage:
            raise RunError(f"{damage}; --before-damage uses only the {len(self.lines)} lines before it")
        self.notice, self._damaged = f"{damage}; this line and all after it are left out", True

    @property
    def unchecked(self) -> int:
        """Number of lines without a checksum. They precede all others; an older version of rhabdom wrote them."""
        return self._chain.unchecked

    def append(self, candidate: Candidate) -> None:
        """Append a candidate, and synchronise the file with the disk.

        Raises:
            RunError: the record contains the candidate already, the candidate has a value that would make its line
                unreadable, another process has changed the record, or the record cannot be written. Earlier lines
                remain intact.
        """
        if (candidate.id, candidate.rung) in self.lines:
            raise RunError(f"{self.path.parent}: candidate {candidate.id} has been evaluated already")
        _require_readable(candidate, self.path)
        line = self._chain.sealed(candidate.to_line().encode())
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
        self._chain = self._chain.after(line)
        self.lines[candidate.id, candidate.rung] = candidate
        self.candidates = _with(self.candidates, candidate)

    def cut_off_unused(self) -> None:
        """Remove from the file the lines that were ignored when it was read.

        These are an unfinished last line, or a damaged line and all lines after it. If there is a damaged line, the
        file is first copied to `candidates.jsonl.damaged-N`.

        Raises:
            RunError: the file cannot be written.
        """
        try:
            with opened(self.path, "r+b") as file:
                if self._damaged:
                    self._copy(file)
                file.truncate(self._whole_bytes)
                os.fsync(file.fileno())
        except OSError as error:
            raise RunError(f"{self.path}: cannot be written: {error.strerror}") from error

    def _copy(self, file: BinaryIO) -> None:
        """Copy the damaged file to `candidates.jsonl.damaged-N`, with the first free number N."""
        number = 1
        while os.path.lexists(copy := self.path.with_name(f"{self.path.name}.damaged-{number}")):
            number += 1
        with unfinished(copy) as path, path.open("r+b") as target:
            shutil.copyfileobj(file, target)


def _require_readable(candidate: Candidate, path: Path) -> None:
    """Check that a candidate stays the same if it is written as a line of the record and read back from this line.

    Results of `Candidate.recordable` pass the check.

    path: file of the record, for the message

    Raises:
        RunError: reading the line back would give a different candidate, or would fail.
    """
    try:
        if candidate == candidate.recordable():
            return
        reason = "it would read back differently"
    except ValueError as error:
        reason = str(error)
    raise RunError(f"{path}: candidate {candidate.id} cannot be written: {reason}; nothing is added")


def _furthest(lines: Lines) -> tuple[Candidate, ...]:
    """Return the latest record of each candidate, in the order of ids.

    A record has a line for each rung (part of training) that a candidate has completed; the line of the last rung
    counts.
    """
    furthest = {candidate_id: lines[candidate_id, rung] for candidate_id, rung in sorted(lines)}
    return tuple(furthest.values())


def _with(candidates: tuple[Candidate, ...], new: Candidate) -> tuple[Candidate, ...]:
    """Return the candidates of a run's record, in the order of ids, after `new` has been appended to the record.

    A record has a line for each rung (part of training) that a candidate has completed. The last of them counts.
    `_furthest` would return the same candidates, but would read all lines again.

    candidates: result of `_furthest` before `new` is appended
    """
    at = bisect_left(candidates, new.id, key=lambda candidate: candidate.id)
    known = at < len(candidates) and candidates[at].id == new.id
    if known and candidates[at].rung > new.rung:
        return candidates
    return (*candidates[:at], new, *candidates[at + known :])


def _require_agreement(candidate: Candidate, config: RunConfig, dimension: int, earlier: Lines) -> None:
    """Check that a line of the record agrees with the run's settings and with earlier lines.

    The genome is not compared with the search's proposals here; see `evolve.search.same_search`.

    Raises:
        ValueError: the line disagrees; the message states the reason.
    """
    population, rungs = config.search.population, config.search.rungs
    if (candidate.id, candidate.rung) in earlier:
        raise ValueError(f"candidate {candidate.id} occurs twice")
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
