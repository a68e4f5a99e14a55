"""Scalars of a run for TensorBoard: fitness over the generations, learning curves of training runs, and genes.

TensorBoard's own writer writes them to the folder `tensorboard/` of the run directory. All scalars follow from the
record, so the files are deleted and written again when a run is resumed with `--tensorboard`.
"""

from __future__ import annotations

import math
import shutil
import time
from pathlib import Path
from typing import Any

from evolve.analysis.acuity import acuity_cpd, acuity_vertical_cpd
from evolve.analysis.statistics import gene_values, generation_statistics
from evolve.search.job import ExecutorError
from evolve.search.successive_halving import complete
from evolve.store.candidate import Candidate
from evolve.store.directory import Run
from evolve.store.regular_files import folder

__all__ = ["TensorBoardWriter", "require_tensorboard"]

FOLDER = "tensorboard"


class TensorBoardWriter:
    """Writer of a run's scalars (fitness, learning curves and genes) for TensorBoard, a context manager.

    It is a watcher: the search calls its methods while candidates train (see `evolve.search.loop`).

    Raises:
        ExecutorError: TensorBoard is not installed.
    """

    def __init__(self, run: Run) -> None:
        self._run = run
        self._writers: dict[str, Any] = {}
        self._shown: set[int] = set()  # generations that have been written
        _writer_class()
        shutil.rmtree(run.path / FOLDER, ignore_errors=True)

    def __enter__(self) -> TensorBoardWriter:
        folder(self._run.path / FOLDER)
        for candidate in self._run.in_order_of_finish:
            self.evaluated(candidate)
        return self

    def __exit__(self, *_: object) -> None:
        for writer in self._writers.values():
            writer.close()

    def training(self, candidate_id: int, steps: int, planned: int) -> None:
        """Do nothing while a candidate trains: its scalars are written after its evaluation."""

    def evaluated(self, candidate: Candidate) -> None:
        """Write the scalars of a candidate that has completed a rung, a stage of its training.

        For a failed candidate, no scalars are written.

        Outcome and genes are plotted against the candidate's id, and the learning curve against training steps. If the
        candidate's generation is complete, statistics of its successful candidates are written too.
        """
        if candidate.failure is None:
            values = {"fitness": candidate.fitness, "success_rate": candidate.success_rate}
            if not self._run.config.costs.free:
                values |= {"task_fitness": candidate.task_fitness, "costs": candidate.costs}
            genes = {
                **gene_values(candidate.phenotype, self._run.config.eye),
                "acuity_cpd": acuity_cpd(candidate.phenotype),
                "acuity_vertical_cpd": acuity_vertical_cpd(candidate.phenotype),
            }
            values |= {f"genes/{name}": value for name, value in genes.items() if math.isfinite(value)}
            self._add("candidates", values, candidate.id)
            learning = f"learning/{candidate.id:06d}"
            for steps, value in candidate.curve:
                self._add(learning, {"return": value}, steps)
            self._close(learning)  # each open writer uses a thread and an open file
        if candidate.generation not in self._shown and complete(self._run, candidate.generation):
            self._shown.add(candidate.generation)
            rows = {row.generation: row for row in generation_statistics(self._run.candidates)}
            row = rows[candidate.generation]
            if row.evaluated > row.failed:
                values = {"best": row.best, "median": row.median, "best_so_far": row.best_so_far}
                self._add("generations", {f"fitness/{name}": v for name, v in values.items()}, candidate.generation)

    def _close(self, name: str) -> None:
        """Close a writer. Later values are written to a new file, and TensorBoard reads both files."""
        if name in self._writers:
            self._writers.pop(name).close()

    def _add(self, name: str, values: dict[str, float], step: int) -> None:
        from tensorboard.compat.proto.event_pb2 import Event
        from tensorboard.compat.proto.summary_pb2 import Summary

        if name not in self._writers:
            self._writers[name] = _writer_class()(str(self._run.path / FOLDER / Path(name)))
        summary = Summary(value=[Summary.Value(tag=tag, simple_value=value) for tag, value in values.items()])
        self._writers[name].add_event(Event(wall_time=time.time(), step=step, summary=summary))
        self._writers[name].flush()


def require_tensorboard() -> None:
    """Check that TensorBoard is installed.

    Raises:
        ExecutorError: TensorBoard is not installed.
    """
    _writer_class()


def _writer_class() -> Any:
    try:
        from tensorboard.summary.writer.event_file_writer import EventFileWriter
    except ImportError:
        raise ExecutorError("--tensorboard needs TensorBoard: pip install 'rhabdom[tensorboard]'") from None
    return EventFileWriter
