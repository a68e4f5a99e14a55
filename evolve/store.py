"""The run directory: a run's only memory. Plain text and plain tensors; nothing in it is code.

config.toml        every setting
versions.json      with which software the run was started, and continued
candidates.jsonl   one line per evaluated candidate, in the order in which they finished
policies/          trained policies
lock               held by the process that works on the run
"""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path

from evolve.candidate import Candidate
from evolve.config import RunConfig
from evolve.config_source import from_toml, to_toml
from evolve.files import UNFINISHED, sweep, write_whole
from evolve.genotype import Genotype
from evolve.lock import RunLock
from evolve.versions import FILE as VERSIONS
from evolve.versions import record_start

__all__ = ["Candidate", "Run", "RunError", "next_directory"]

CONFIG = "config.toml"
CANDIDATES = "candidates.jsonl"
POLICIES = "policies"


class RunError(ValueError):
    """A run directory that cannot be used as asked; the message is one line that says why."""


@dataclass
class Run:
    """A run directory; `candidates` are in order of their ids.

    `notice` is one line on what had to be left out when reading (a line that was being written when the power went).
    """

    path: Path
    config: RunConfig
    candidates: tuple[Candidate, ...] = ()
    notice: str | None = None
    _finished: tuple[int, ...] = field(default=(), repr=False)
    _whole_bytes: int = field(default=0, repr=False)

    @classmethod
    def create(cls, path: Path | str, config: RunConfig, origin: str | None = None) -> Run:
        """New run in a directory that does not exist or is empty; `origin` names the animal that it starts from.

        Raises:
            RunError: the directory holds something already, or cannot be written.
        """
        path = Path(path)
        try:
            path.mkdir(parents=True, exist_ok=True)
            if not _holds_no_run(path):
                raise RunError(f"{path} is not empty: choose another name, or continue it with: evolve resume {path}")
            (path / POLICIES).mkdir(exist_ok=True)
            (path / CANDIDATES).touch()
            record_start(path, 0, origin)
            write_whole(path / CONFIG, to_toml(config).encode())
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
        """The right to write to this run, as a context manager; raises LockedError if another process has it."""
        return RunLock(self.path)

    def repair(self) -> None:
        """Cut off an unfinished last line and remove files half written (after `lock`); read the rest anew."""
        self._read()
        try:
            sweep(self.path)
            sweep(self.path / POLICIES)
            with (self.path / CANDIDATES).open("r+b") as file:
                file.truncate(self._whole_bytes)
                os.fsync(file.fileno())
        except OSError as error:
            raise RunError(f"{self.path / CANDIDATES}: cannot be written: {error.strerror}") from error

    def append(self, candidate: Candidate) -> None:
        """Write a candidate down for good.

        Raises:
            RunError: the candidate is there already, or cannot be written; what was there before still is.
        """
        if any(known.id == candidate.id for known in self.candidates):
            raise RunError(f"{self.path}: candidate {candidate.id} has been evaluated already")
        line = candidate.to_line().encode()
        try:
            with (self.path / CANDIDATES).open("ab") as file:
                file.write(line)
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            raise RunError(f"{self.path / CANDIDATES}: cannot be written: {error.strerror}") from error
        self._whole_bytes += len(line)
        self._finished += (candidate.id,)
        self.candidates = tuple(sorted((*self.candidates, candidate), key=lambda known: known.id))

    def policy_path(self, candidate_id: int) -> Path:
        """Where a candidate's trained policy is kept."""
        return self.path / POLICIES / f"{candidate_id:06d}.safetensors"

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
        """Candidates in the order in which they were evaluated and written down."""
        by_id = {candidate.id: candidate for candidate in self.candidates}
        return [by_id[identity] for identity in self._finished]

    @property
    def finished(self) -> bool:
        return len(self.candidates) == self.config.candidates

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
        found: dict[int, Candidate] = {}
        for number, line in enumerate(lines, start=1):
            try:
                candidate = Candidate.from_line(line.decode())
                self._check(candidate, found)
            except ValueError as error:
                raise RunError(f"{file}, line {number}: is damaged: {error}") from error
            found[candidate.id] = candidate
        self.candidates = tuple(found[key] for key in sorted(found))
        self._finished = tuple(found)

    def _check(self, candidate: Candidate, found: dict[int, Candidate]) -> None:
        population, dimension = self.config.search.population, Genotype(self.config.genome).dimension
        if candidate.id in found:
            raise ValueError(f"candidate {candidate.id} is there twice")
        if candidate.id != candidate.generation * population + candidate.index or not 0 <= candidate.index < population:
            raise ValueError(
                f"candidate {candidate.id} can't be number {candidate.index} of generation {candidate.generation} "
                f"with a population of {population}"
            )
        if len(candidate.genome) != dimension:
            raise ValueError(f"genome has {len(candidate.genome)} values, {dimension} genes are open")


def _holds_no_run(path: Path) -> bool:
    """Whether a directory is empty, or as a process leaves it that is killed while it creates a run: config.toml, which
    makes it one, is written last."""
    begun = {RunLock.NAME, VERSIONS, CANDIDATES, POLICIES}
    names = {entry.name for entry in path.iterdir() if not entry.name.endswith(UNFINISHED)}
    if not names <= begun:
        return False
    record, policies = path / CANDIDATES, path / POLICIES
    return not (record.exists() and record.stat().st_size) and not (policies.exists() and any(policies.iterdir()))


def next_directory(task: str, preset: str, base: Path = Path("runs")) -> Path:
    """runs/<task>-<preset>-<n>, n the first that is free."""
    n = 1
    while (base / f"{task}-{preset}-{n}").exists():
        n += 1
    return base / f"{task}-{preset}-{n}"
