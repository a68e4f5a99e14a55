"""The run directory: a run's only memory. Plain text and plain tensors; nothing in it is code.

config.toml        every setting
versions.json      with which software the run was started, and continued
candidates.jsonl   the record: one line per evaluated candidate and budget stage, in the order in which they finished
policies/          trained policies
trainings/         as they stand after each budget stage, until none of them goes on
lock               held by the process that works on the run
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from evolve.config.assemble import from_text, to_toml
from evolve.config.formats import FORMAT, LAST_OF_FORMER, format_of
from evolve.config.run_config import RunConfig
from evolve.config.sources import parsed_toml
from evolve.store.atomic_files import POLICIES, TRAININGS, UNFINISHED, sweep, write_whole
from evolve.store.candidate import Candidate
from evolve.store.lock import LONGEST, RunLock
from evolve.store.policies import lost
from evolve.store.record import Record, RunError
from evolve.store.regular_files import folder, opened, read, require_folder, require_regular
from evolve.store.versions import FILE as VERSIONS
from evolve.store.versions import fingerprint, record_start

__all__ = ["Candidate", "Run", "RunError", "next_directory"]

CONFIG = "config.toml"
CANDIDATES = "candidates.jsonl"
PRODUCTS = ("exr", "tensorboard")  # folders of what is made from a run


@dataclass
class Run:
    """A run directory: its config, its record, and where its other files are."""

    path: Path
    config: RunConfig
    record: Record
    _lock: RunLock | None = None

    def __repr__(self) -> str:
        """Short: a record is long."""
        best = "" if self.best is None else f", best fitness {self.best.fitness:.4g}"
        evaluated = f"{len(self.candidates)} of {self.config.candidates} candidates evaluated"
        return f"<Run {str(self.path)!r}: {self.config.task}, {evaluated}{best}>"

    @classmethod
    def create(cls, path: Path | str, config: RunConfig, origin: str | None = None) -> Self:
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
                folder(path / POLICIES)
                opened(path / CANDIDATES, "ab", create=True).close()
                text = to_toml(config)
                (path / VERSIONS).unlink(missing_ok=True)  # of an attempt that was killed here
                record_start(path, 0, origin, fingerprint(text))
                write_whole(path / CONFIG, text.encode())
        except OSError as error:
            raise RunError(f"{error.filename or path} cannot be written: {error.strerror}") from error
        return cls(path, config, Record(path / CANDIDATES))

    @classmethod
    def open(cls, path: Path | str, task: str | None = None) -> Self:
        """A run as it is on disk.

        task: FILE.py:CLASS, where the run evolves a task of somebody's own: its code runs only if it is named, and is
            needed to carry on the run, and to let its animals play

        Raises:
            RunError: no run there, or its candidates cannot be read; names file and line.
            ConfigError: its config cannot be used, or another task is named than the run's, or its file has changed.
            StrangeFileError: a link, FIFO or device bears the name of one of its files or folders.
        """
        path = Path(path)
        if not path.is_dir():
            raise RunError(f"{path} is no run: there is no such directory")
        _require_plain(path)
        try:
            config = from_text(read(path / CONFIG), str(path / CONFIG))
        except FileNotFoundError:
            raise RunError(f"{path} is no run: it holds no {CONFIG}") from None
        if task is not None:
            config = config.with_code(task)
        return cls(path, config, Record.read(path / CANDIDATES, config))

    @classmethod
    def create_next(cls, config: RunConfig, preset: str, origin: str | None = None) -> Self:
        """New run in the next free directory, also where others are begun at the same time.

        Raises:
            RunError: it cannot be written.
        """
        path, tried = next_directory(config.task_name, preset), None
        while path != tried:  # a name that is neither free nor taken is that of a link to nowhere
            try:
                path.mkdir(parents=True)  # whose it is
                break
            except FileExistsError:
                path, tried = next_directory(config.task_name, preset), path
            except OSError as error:
                raise RunError(f"{path} cannot be written: {error.strerror}") from error
        return cls.create(path, config, origin)

    def require_present_format(self) -> None:
        """Trainings can be carried on in the light in which they began, and in no other.

        Raises:
            RunError: the run's format is a former one; names the version that carries it on.
        """
        number = format_of(parsed_toml(read(self.path / CONFIG), str(self.path / CONFIG)).tree)
        if number != FORMAT:
            raise RunError(
                f"{self.path} has format {number}: must be {FORMAT} to be continued; rhabdom at commit "
                f"{LAST_OF_FORMER} continues it, and status, report, replay and export read it here"
            )

    def lock(self) -> RunLock:
        """The right to write to this run, as a context manager.

        Raises:
            LockedError: another process has it.
        """
        self._lock = RunLock(self.path)
        return self._lock

    def repair(self) -> None:
        """Cut off an unfinished last line and remove files half written (after `lock`); read the rest anew.

        Raises:
            RunError: the record is damaged or cannot be written, or config.toml is no longer as it was opened.
        """
        try:
            text = read(self.path / CONFIG)
        except OSError as error:
            raise RunError(f"{self.path / CONFIG}: cannot be read: {error.strerror}") from error
        if from_text(text, str(self.path / CONFIG)) != self.config:
            raise RunError(f"{self.path / CONFIG} has changed since the run was opened; open it again")
        self.record = Record.read(self.record.path, self.config)
        try:
            for folder in (self.path, self.path / POLICIES, self.path / TRAININGS):
                sweep(folder)
        except OSError as error:
            raise RunError(f"{self.record.path}: cannot be written: {error.strerror}") from error
        self.record.cut_off_unfinished()

    def append(self, candidate: Candidate) -> None:
        """Write a candidate down for good.

        Raises:
            RunError: the candidate is there already, somebody else has changed the record, or it cannot be written;
                what was there before still is.
        """
        if self._lock is not None and not self._lock.stands:
            raise RunError(f"{self.record.path}: is no longer as this process left it; nothing is added")
        self.record.append(candidate)

    def policy_path(self, candidate_id: int) -> Path:
        """Where a candidate's trained policy is kept."""
        return self.path / POLICIES / f"{candidate_id:06d}.safetensors"

    def checkpoint_path(self, candidate_id: int, stage: int) -> Path:
        """Where a candidate's training is kept as it stands after a budget stage, until it goes on no more."""
        return self.path / TRAININGS / f"{candidate_id:06d}-{stage}.safetensors"

    def forget_trainings(self, candidate_ids: Iterable[int]) -> None:
        """Remove what the trainings of these candidates have left, now that none of them goes on."""
        for candidate_id in candidate_ids:
            for path in (self.path / TRAININGS).glob(f"{candidate_id:06d}-*.safetensors"):
                path.unlink(missing_ok=True)

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """Evaluated candidates in order of their ids, each as it is after the last budget stage that it has reached."""
        return self.record.candidates

    @property
    def notice(self) -> str | None:
        """One line on what was left out when the record was read, or on policies that are lost; None if neither."""
        return self.record.notice or lost(self.candidates, self.policy_path)

    @property
    def best(self) -> Candidate | None:
        """The candidate of highest fitness, the earliest where several have it; None before one has succeeded."""
        done = [candidate for candidate in self.candidates if candidate.failure is None]
        return max(done, key=lambda candidate: (candidate.fitness, -candidate.id), default=None)

    def candidate(self, candidate_id: int | None = None) -> Candidate:
        """The candidate with this id; None: the best.

        Raises:
            RunError: it has not been evaluated, or none has succeeded.
        """
        if candidate_id is None:
            if self.best is None:
                raise RunError(f"{self.path}: no candidate has been evaluated successfully yet")
            return self.best
        for candidate in self.candidates:
            if candidate.id == candidate_id:
                return candidate
        raise RunError(f"{self.path}: there is no candidate {candidate_id}; {len(self.candidates)} have been evaluated")

    def generation(self, number: int) -> list[Candidate]:
        """Candidates of one generation that have been evaluated."""
        return [candidate for candidate in self.candidates if candidate.generation == number]

    @property
    def in_order_of_finish(self) -> list[Candidate]:
        """Candidates in the order in which they were evaluated and written down, once for each budget stage."""
        return list(self.record.lines.values())

    def on_record(self, candidate_id: int, stage: int) -> Candidate | None:
        """The candidate as it was after a budget stage; None where it has not been evaluated there."""
        return self.record.lines.get((candidate_id, stage))

    def steps_of(self, candidate_id: int) -> int:
        """Steps that a candidate has been trained so far, as far as is on record."""
        steps = stage = 0
        while (line := self.on_record(candidate_id, stage)) is not None:
            steps, stage = max(steps, line.steps), stage + 1
        return steps

    def evaluated_at(self, stage: int) -> set[int]:
        """Ids of all candidates that have been evaluated after a budget stage."""
        return {candidate_id for candidate_id, reached in self.record.lines if reached == stage}


def _require_no_run(path: Path) -> None:
    """A directory must be empty, or as a process leaves it that is killed while it creates a run: config.toml, which
    makes it one, is written last."""
    begun = {RunLock.NAME, VERSIONS, CANDIDATES, POLICIES}
    names = {entry.name for entry in path.iterdir() if not entry.name.endswith(UNFINISHED)}
    _require_plain(path)
    most = {CANDIDATES: 0, RunLock.NAME: LONGEST}  # bytes
    filled = any((path / name).exists() and (path / name).stat().st_size > size for name, size in most.items())
    filled = filled or ((path / POLICIES).exists() and any((path / POLICIES).iterdir()))
    if filled or not names <= begun:
        raise RunError(f"{path} is not empty: choose another name, or continue it with: evolve resume {path}")


def _require_plain(path: Path) -> None:
    """What bears the name of a run's file must be a file, and of a folder a folder: named before anything is read."""
    for name in (CONFIG, VERSIONS, CANDIDATES, RunLock.NAME):
        require_regular(path / name)
    for name in (POLICIES, TRAININGS, *PRODUCTS):
        require_folder(path / name)


def next_directory(task: str, preset: str, base: Path = Path("runs")) -> Path:
    """runs/<task>-<preset>-<n>, n the first that is free."""
    n = 1
    while (base / f"{task}-{preset}-{n}").exists():
        n += 1
    return base / f"{task}-{preset}-{n}"
