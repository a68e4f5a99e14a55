"""The run directory, which contains the complete state of a run as text and tensors, but no code.

config.toml        every setting
versions.json      versions of the software at each start of the run
candidates.jsonl   the record: one line for each evaluation of a candidate, in order of completion
policies/          trained policies
trainings/         checkpoints after parts (rungs) of training, from which the next part can start
lock               file that the process working on the run has locked
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from evolve.config.assemble import from_text, to_toml
from evolve.config.formats import FORMAT, LAST_OF_FORMER, OLDEST_CONTINUED, format_of
from evolve.config.numbering import generation_ids
from evolve.config.run_config import RunConfig
from evolve.config.sources import LARGEST_TOML, parsed_toml
from evolve.store.atomic_files import POLICIES, TRAININGS, UNFINISHED, sweep, write_whole
from evolve.store.candidate import Candidate
from evolve.store.checksums import harmed
from evolve.store.lock import LONGEST, RunLock
from evolve.store.policies import lost
from evolve.store.record import Record, RunError
from evolve.store.regular_files import folder, folders, opened, read, require_folder, require_regular
from evolve.store.versions import CONFIG, config_change, record_start
from evolve.store.versions import FILE as VERSIONS

__all__ = ["Candidate", "Run", "RunError", "next_directory"]

CANDIDATES = "candidates.jsonl"
EXR = "exr"  # folder of exported images
PRODUCTS = (EXR, "tensorboard")  # folders of exported files


@dataclass
class Run:
    """A run directory: its config, its record of evaluated candidates, and the paths of its other files."""

    path: Path
    config: RunConfig
    record: Record
    _lock: RunLock | None = None

    def __repr__(self) -> str:
        """Return a short description, without the candidates, of which there may be thousands."""
        best = "" if self.best is None else f", best fitness {self.best.fitness:.4g}"
        evaluated = f"{len(self.candidates)} of {self.config.candidates} candidates evaluated"
        return f"<Run {str(self.path)!r}: {self.config.task}, {evaluated}{best}>"

    @classmethod
    def create(cls, path: Path | str, config: RunConfig, origin: str | None = None) -> Self:
        """Create a run in a directory that is missing, empty, or has only files that an interrupted `create` left.

        origin: "RUN:ID", the animal whose genes the search starts from; None if it does not start from an animal

        Raises:
            RunError: the directory contains other files, or cannot be written.
            LockedError: another process is creating a run there, or the lock cannot be written.
        """
        path = Path(path)
        try:
            folders(path)
            _require_no_run(path)  # checked first, because locking creates a file
            with RunLock(path):
                _require_no_run(path)
                folder(path / POLICIES)
                opened(path / CANDIDATES, "ab", create=True).close()
                text = to_toml(config).encode()
                (path / VERSIONS).unlink(missing_ok=True)  # a process that was killed at this point may have left them
                record_start(path, 0, origin, text)
                write_whole(path / CONFIG, text)
        except OSError as error:
            raise RunError(f"{error.filename or path} cannot be written: {error.strerror}") from error
        return cls(path, config, Record(path / CANDIDATES))

    @classmethod
    def open(cls, path: Path | str, task: str | None = None, before_damage: bool = False) -> Self:
        """Open a run directory.

        task: "FILE.py:CLASS" of a user task, whose code is executed only if the task is named here. The code is needed
            to continue the run and to play episodes. None: open the run without code
        before_damage: True to use only the lines of the record before the first damaged line, if there is one

        Raises:
            RunError: the directory does not exist or contains no run, or the record cannot be read. Without
                `before_damage`, a damaged line of the record is also an error; the message names the line.
            ConfigError: the config is invalid, or the named task differs from the run's, cannot be read or has changed.
            StrangeFileError: a path of the run is not the file or folder that it must be, or config.toml is too large.
            OSError: config.toml cannot be read.
        """
        path = Path(path)
        if not path.is_dir():
            raise RunError(f"{path} is not a run: there is no such directory")
        _require_plain(path)
        try:
            config = from_text(read(path / CONFIG, LARGEST_TOML), str(path / CONFIG))
        except FileNotFoundError:
            raise RunError(f"{path} is not a run: it contains no {CONFIG}") from None
        if task is not None:
            config = config.with_code(task)
        return cls(path, config, Record.read(path / CANDIDATES, config, before_damage))

    @classmethod
    def create_next(cls, config: RunConfig, preset: str, origin: str | None = None) -> Self:
        """Create a run in the next free directory runs/TASK-PRESET-N, even if other processes create runs meanwhile.

        Raises:
            RunError: the directory cannot be written.
            LockedError: another process is creating a run there, or the lock cannot be written.
        """
        path, tried = next_directory(config.task_name, preset), None
        while path != tried:  # a broken link seems to be free, but cannot be created: stop
            try:
                folders(path, exist_ok=False)  # fails if another process has created it
                break
            except FileExistsError:
                path, tried = next_directory(config.task_name, preset), path
            except OSError as error:
                raise RunError(f"{path} cannot be written: {error.strerror}") from error
        return cls.create(path, config, origin)

    def require_present_light(self) -> None:
        """Check that the run can be continued: this version must compute light in the same way as at the run's start.

        Raises:
            RunError: the format of config.toml is too old; the message names the version that can continue the run.
            OSError: config.toml cannot be read.
        """
        number = format_of(parsed_toml(read(self.path / CONFIG, LARGEST_TOML), str(self.path / CONFIG)).tree)
        if number < OLDEST_CONTINUED:
            raise RunError(
                f"{self.path} has format {number}: must be {OLDEST_CONTINUED} to {FORMAT} to be continued; rhabdom at "
                f"commit {LAST_OF_FORMER} continues it, and status, report, replay and export read it here"
            )

    def lock(self) -> RunLock:
        """Return the lock of this run, a context manager. A process must hold it to write to the run.

        Raises:
            LockedError: on entry into the context, another process holds the lock, or the lock cannot be written.
        """
        self._lock = RunLock(self.path)
        return self._lock

    def repair(self) -> None:
        """Read the record again, and remove an unfinished last line and incomplete files.

        If the run was opened with `before_damage`, the first damaged line and all lines after it are also removed, and
        a copy of the damaged record is kept. The caller must hold the lock.

        Raises:
            RunError: the record cannot be read or written, an incomplete file cannot be removed, config.toml cannot be
                read, or the settings in config.toml have changed since the run was opened. If the run was opened
                without `before_damage`, a damaged line is also an error.
            ConfigError: config.toml is invalid.
        """
        try:
            text = read(self.path / CONFIG, LARGEST_TOML)
        except OSError as error:
            raise RunError(f"{self.path / CONFIG}: cannot be read: {error.strerror}") from error
        if from_text(text, str(self.path / CONFIG)) != self.config:
            raise RunError(f"{self.path / CONFIG} has changed since the run was opened; open it again")
        self.record = Record.read(self.record.path, self.config, self.record.before_damage)
        try:
            for folder in (self.path, self.path / POLICIES, self.path / TRAININGS):
                sweep(folder)
        except OSError as error:
            raise RunError(f"{self.record.path}: cannot be written: {error.strerror}") from error
        self.record.cut_off_unused()

    def append(self, candidate: Candidate) -> None:
        """Append a candidate to the record, and synchronise the file with the disk.

        Raises:
            RunError: the record contains the candidate already, the candidate has a value that would make its line
                unreadable, another process has changed the record, or the record cannot be written. Earlier lines
                remain intact.
        """
        if self._lock is not None and not self._lock.stands:
            raise RunError(f"{self.record.path}: was changed by another process; nothing is added")
        self.record.append(candidate)

    def policy_path(self, candidate_id: int) -> Path:
        """Return the path of a candidate's trained policy. The file need not exist."""
        return self.path / POLICIES / f"{candidate_id:06d}.safetensors"

    def checkpoint_path(self, candidate_id: int, rung: int) -> Path:
        """Return the path of a candidate's checkpoint after a rung (part of its training). The file need not exist."""
        return self.path / TRAININGS / f"{candidate_id:06d}-{rung}.safetensors"

    def forget_trainings(self, candidate_ids: Iterable[int]) -> None:
        """Remove the checkpoints of candidates whose training will not continue; OSError if one cannot be removed."""
        for candidate_id in candidate_ids:
            for path in (self.path / TRAININGS).glob(f"{candidate_id:06d}-*.safetensors"):
                path.unlink(missing_ok=True)

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """Evaluated candidates by id, each as recorded after the last rung (part of training) that it has completed."""
        return self.record.candidates

    @property
    def notice(self) -> str | None:
        """Message about damage, in one line; None if there is none.

        It lists ignored lines of the record, lost policies, a config.toml that has changed since the last start, and
        EXR files that do not match their checksums. An OSError means that config.toml cannot be read.
        """
        found = (
            self.record.notice,
            lost(self.candidates, self.policy_path),
            config_change(self.path, len(self.candidates)),
            harmed(self.path / EXR),
        )
        return "; ".join(filter(None, found)) or None

    @property
    def best(self) -> Candidate | None:
        """Candidate with the highest fitness (of several, the one with the smallest id); None if none has succeeded."""
        done = [candidate for candidate in self.candidates if candidate.failure is None]
        return max(done, key=lambda candidate: (candidate.fitness, -candidate.id), default=None)

    def candidate(self, candidate_id: int | None = None) -> Candidate:
        """Return the candidate with this id, or the best candidate if the id is None.

        Raises:
            RunError: no evaluated candidate has this id, or, for None, no candidate has succeeded.
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
        """Return the evaluated candidates of one generation, in the order of their ids; [] if there are none."""
        ids = generation_ids(number, self.config.search.population)
        first, end = (bisect_left(self.candidates, one, key=lambda c: c.id) for one in (ids.start, ids.stop))
        return list(self.candidates[first:end])

    @property
    def in_order_of_finish(self) -> list[Candidate]:
        """Candidates in order of evaluation; each occurs once for each rung (part of training) it has completed."""
        return list(self.record.lines.values())

    def on_record(self, candidate_id: int, rung: int) -> Candidate | None:
        """Return the record of a candidate after a rung (part of its training); None if there is no such record."""
        return self.record.lines.get((candidate_id, rung))

    def steps_of(self, candidate_id: int) -> int:
        """Return the number of steps in the recorded parts (rungs) of a candidate's training; 0 if none is recorded."""
        steps = rung = 0
        while (line := self.on_record(candidate_id, rung)) is not None:
            steps, rung = max(steps, line.steps), rung + 1
        return steps

    def evaluated_at(self, rung: int) -> set[int]:
        """Return the ids of all candidates that have been evaluated after a rung (part of their training)."""
        return {candidate_id for candidate_id, reached in self.record.lines if reached == rung}


def _require_no_run(path: Path) -> None:
    """Check that a run can be created in a directory.

    The directory must be empty, or contain only files of a process that was killed while it created a run. Such a
    directory has no config.toml, because this file is written last.
    """
    begun = {RunLock.NAME, VERSIONS, CANDIDATES, POLICIES}
    names = {entry.name for entry in path.iterdir() if not entry.name.endswith(UNFINISHED)}
    _require_plain(path)
    most = {CANDIDATES: 0, RunLock.NAME: LONGEST}  # bytes
    filled = any((path / name).exists() and (path / name).stat().st_size > size for name, size in most.items())
    filled = filled or ((path / POLICIES).exists() and any((path / POLICIES).iterdir()))
    if filled or not names <= begun:
        raise RunError(f"{path} is not empty: choose another name, or continue it with: evolve resume {path}")


def _require_plain(path: Path) -> None:
    """Check that a run's existing files are regular files, and that its existing folders are directories."""
    for name in (CONFIG, VERSIONS, CANDIDATES, RunLock.NAME):
        require_regular(path / name)
    for name in (POLICIES, TRAININGS, *PRODUCTS):
        require_folder(path / name)


def next_directory(task: str, preset: str, base: Path = Path("runs")) -> Path:
    """Return the first of the paths BASE/TASK-PRESET-N, with N = 1, 2, ..., that does not exist."""
    n = 1
    while (base / f"{task}-{preset}-{n}").exists():
        n += 1
    return base / f"{task}-{preset}-{n}"
