"""The run directory: a run's only memory. Plain text and plain tensors; nothing in it is code.

config.toml        every setting
versions.json      with which software the run was started, and continued
candidates.jsonl   one line per evaluated candidate, and per rung of a ladder, in the order in which they finished
policies/          trained policies
trainings/         as they stand on the rungs of a ladder, until their generation is done
lock               held by the process that works on the run
"""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path

from evolve.config.assemble import from_toml, to_toml
from evolve.config.run_config import RunConfig
from evolve.genome.genotype import Genotype
from evolve.store.atomic_files import UNFINISHED, sweep, write_whole
from evolve.store.candidate import Candidate
from evolve.store.lock import RunLock
from evolve.store.versions import FILE as VERSIONS
from evolve.store.versions import fingerprint, record_start

__all__ = ["Candidate", "Run", "RunError", "next_directory"]

CONFIG = "config.toml"
CANDIDATES = "candidates.jsonl"
POLICIES = "policies"
TRAININGS = "trainings"


class RunError(ValueError):
    """A run directory that cannot be used as asked; the message is one line that says why."""


@dataclass
class Run:
    """A run directory; `candidates` are in order of their ids, each as it is on the highest rung that it has reached.

    `notice` is one line on what had to be left out when reading (a line that was being written when the power went).
    """

    path: Path
    config: RunConfig
    candidates: tuple[Candidate, ...] = ()
    notice: str | None = None
    _lines: dict[tuple[int, int], Candidate] = field(default_factory=dict, repr=False)
    _whole_bytes: int = field(default=0, repr=False)

    @classmethod
    def create(cls, path: Path | str, config: RunConfig, origin: str | None = None) -> Run:
        """New run in a directory that does not exist or is empty; `origin` names the animal that it starts from.

        Raises:
            RunError: the directory holds something already, or cannot be written.
            LockedError: another process creates a run there.
        """
        path = Path(path)
        try:
            path.mkdir(parents=True, exist_ok=True)
            _require_no_run(path)  # before the lock, which leaves a file
            with RunLock(path):
                _require_no_run(path)
                (path / POLICIES).mkdir(exist_ok=True)
                (path / CANDIDATES).touch()
                text = to_toml(config)
                record_start(path, 0, origin, fingerprint(text))
                write_whole(path / CONFIG, text.encode())
        except OSError as error:
            raise RunError(f"{path} cannot be written: {error.strerror}") from error
        return cls(path, config)

    @classmethod
    def open(cls, path: Path | str) -> Run:
        """A run as it is on disk.

        Raises:
            RunError: no run there, or its candidates cannot be read; names file and line.
            ConfigError: its config cannot be used.
        """
        path = Path(path)
        if not path.is_dir():
            raise RunError(f"{path} is no run: there is no such directory")
        if not (path / CONFIG).is_file():
            raise RunError(f"{path} is no run: it holds no {CONFIG}")
        run = cls(path, from_toml(path / CONFIG))
        run._read()
        return run

    def lock(self) -> RunLock:
        """The right to write to this run, as a context manager.

        Raises:
            LockedError: another process has it.
        """
        return RunLock(self.path)

    def repair(self) -> None:
        """Cut off an unfinished last line and remove files half written (after `lock`); read the rest anew."""
        self._read()
        try:
            sweep(self.path)
            sweep(self.path / POLICIES)
            sweep(self.path / TRAININGS)
            with (self.path / CANDIDATES).open("r+b") as file:
                file.truncate(self._whole_bytes)
                os.fsync(file.fileno())
        except OSError as error:
            raise RunError(f"{self.path / CANDIDATES}: cannot be written: {error.strerror}") from error

    def append(self, candidate: Candidate) -> None:
        """Write a candidate down for good.

        Raises:
            RunError: the candidate is there already, somebody else has changed the record, or it cannot be written;
                what was there before still is.
        """
        if (candidate.id, candidate.rung) in self._lines:
            raise RunError(f"{self.path}: candidate {candidate.id} has been evaluated already")
        line = candidate.to_line().encode()
        try:
            with (self.path / CANDIDATES).open("ab") as file:
                if file.tell() != self._whole_bytes:  # the directory was deleted, say, and another run begun in it
                    raise RunError(f"{self.path / CANDIDATES}: is no longer as this process left it; nothing is added")
                file.write(line)
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            raise RunError(f"{self.path / CANDIDATES}: cannot be written: {error.strerror}") from error
        self._whole_bytes += len(line)
        self._take({**self._lines, (candidate.id, candidate.rung): candidate})

    def policy_path(self, candidate_id: int) -> Path:
        """Where a candidate's trained policy is kept."""
        return self.path / POLICIES / f"{candidate_id:06d}.safetensors"

    def checkpoint_path(self, candidate_id: int, rung: int) -> Path:
        """Where a candidate's training is kept as it stands on a rung, until its generation is done."""
        return self.path / TRAININGS / f"{candidate_id:06d}-{rung}.safetensors"

    def forget_trainings(self, generation: int) -> None:
        """Remove what trainings of a generation have left, now that none of them goes on."""
        for candidate in self.generation(generation):
            for rung in range(self.config.search.rungs):
                self.checkpoint_path(candidate.id, rung).unlink(missing_ok=True)

    @property
    def best(self) -> Candidate | None:
        """The candidate of highest fitness, the earliest where several have it; None before one has succeeded."""
        done = [candidate for candidate in self.candidates if candidate.failure is None]
        return max(done, key=lambda candidate: (candidate.fitness, -candidate.id), default=None)

    def candidate(self, identity: int | None = None) -> Candidate:
        """The candidate with this id; None: the best.

        Raises:
            RunError: it has not been evaluated, or none has succeeded.
        """
        if identity is None:
            if self.best is None:
                raise RunError(f"{self.path}: no candidate has been evaluated successfully yet")
            return self.best
        for candidate in self.candidates:
            if candidate.id == identity:
                return candidate
        raise RunError(f"{self.path}: there is no candidate {identity}; {len(self.candidates)} have been evaluated")

    def generation(self, number: int) -> list[Candidate]:
        """Candidates of one generation that have been evaluated."""
        return [candidate for candidate in self.candidates if candidate.generation == number]

    @property
    def in_order_of_finish(self) -> list[Candidate]:
        """Candidates in the order in which they were evaluated and written down, on a ladder once for each rung."""
        return list(self._lines.values())

    def on_record(self, candidate_id: int, rung: int) -> Candidate | None:
        """The candidate as it was on a rung; None where it has not been evaluated there."""
        return self._lines.get((candidate_id, rung))

    def steps_of(self, candidate_id: int) -> int:
        """Steps that a candidate has been trained so far, as far as is on record."""
        return max((line.steps for (identity, _), line in self._lines.items() if identity == candidate_id), default=0)

    def on_rung(self, rung: int) -> set[int]:
        """Ids of all candidates that have been evaluated on a rung."""
        return {identity for identity, reached in self._lines if reached == rung}

    def _read(self) -> None:
        file = self.path / CANDIDATES
        try:
            content = file.read_bytes()
        except OSError as error:
            raise RunError(f"{file}: cannot be read: {error.strerror}") from error
        self._whole_bytes = content.rfind(b"\n") + 1
        lines = content[: self._whole_bytes].splitlines()
        if len(content) > self._whole_bytes:
            self.notice = (
                f"{file}: line {len(lines) + 1} is unfinished and is left out; its candidate counts as unevaluated"
            )
        found: dict[tuple[int, int], Candidate] = {}
        for number, line in enumerate(lines, start=1):
            try:
                candidate = Candidate.from_line(line.decode())
                self._check(candidate, found)
            except ValueError as error:
                raise RunError(f"{file}, line {number}: is damaged: {error}") from error
            found[candidate.id, candidate.rung] = candidate
        self._take(found)

    def _take(self, lines: dict[tuple[int, int], Candidate]) -> None:
        """These are the record's lines, in its order."""
        self._lines = lines
        furthest = {identity: lines[identity, rung] for identity, rung in sorted(lines)}
        self.candidates = tuple(furthest.values())

    def _check(self, candidate: Candidate, found: dict[tuple[int, int], Candidate]) -> None:
        population, dimension = self.config.search.population, Genotype(self.config.genome).dimension
        if (candidate.id, candidate.rung) in found:
            raise ValueError(f"candidate {candidate.id} is there twice")
        if not 0 <= candidate.rung < self.config.search.rungs:
            raise ValueError(f"rung {candidate.rung} is none of a ladder of {self.config.search.rungs}")
        if candidate.rung and (candidate.id, candidate.rung - 1) not in found:
            raise ValueError(f"candidate {candidate.id} is on rung {candidate.rung}, but has not been one below")
        if candidate.id != candidate.generation * population + candidate.index or not 0 <= candidate.index < population:
            raise ValueError(
                f"candidate {candidate.id} can't be number {candidate.index} of generation {candidate.generation} "
                f"with a population of {population}"
            )
        if len(candidate.genome) != dimension:
            raise ValueError(f"genome has {len(candidate.genome)} values, {dimension} genes are open")


def _require_no_run(path: Path) -> None:
    """A directory must be empty, or as a process leaves it that is killed while it creates a run: config.toml, which
    makes it one, is written last."""
    begun = {RunLock.NAME, VERSIONS, CANDIDATES, POLICIES}
    names = {entry.name for entry in path.iterdir() if not entry.name.endswith(UNFINISHED)}
    record, policies = path / CANDIDATES, path / POLICIES
    filled = (record.exists() and record.stat().st_size) or (policies.exists() and any(policies.iterdir()))
    if filled or not names <= begun:
        raise RunError(f"{path} is not empty: choose another name, or continue it with: evolve resume {path}")


def next_directory(task: str, preset: str, base: Path = Path("runs")) -> Path:
    """runs/<task>-<preset>-<n>, n the first that is free."""
    n = 1
    while (base / f"{task}-{preset}-{n}").exists():
        n += 1
    return base / f"{task}-{preset}-{n}"
