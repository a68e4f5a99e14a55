"""`evolve.Run`: a run directory opened in Python, for analysis and resumption."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING

from evolve.analysis.statistics import generation_statistics
from evolve.config.run_config import EyeConfig
from evolve.interactive.callbacks import Callback, Callbacks
from evolve.interactive.summary import animal_as_html, run_as_html
from evolve.interactive.table import candidate_table
from evolve.runs.resume import resuming
from evolve.store.candidate import Candidate
from evolve.store.directory import Run, RunError
from evolve.store.policies import require_policy

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from sim.tasks.encounter import Frozen
    from sim.tasks.task import Task

__all__ = ["OpenedCandidate", "OpenedRun"]


@dataclass(frozen=True, repr=False)
class OpenedCandidate(Candidate):
    """A candidate of an opened run, with the settings shared by all eyes of the run."""

    eye: EyeConfig = field(default_factory=EyeConfig)

    @classmethod
    def of_run(cls, candidate: Candidate, run: Run) -> OpenedCandidate:
        """Return the candidate with its run's settings of eyes."""
        return cls(**{f.name: getattr(candidate, f.name) for f in fields(Candidate)}, eye=run.config.eye)

    def to_line(self) -> str:
        """Return the candidate's line of a record."""
        return Candidate(**{f.name: getattr(self, f.name) for f in fields(Candidate)}).to_line()

    def show_eye(self) -> Figure:
        """Draw the fields of view of the eyes on the head, and the relief and PSF of their pupil."""
        from evolve.interactive.eye_picture import eye_picture

        return eye_picture(self.phenotype, self.eye)

    def _repr_html_(self) -> str:
        return animal_as_html(self).markup


class OpenedRun(Run):
    """A run directory: its config, its candidates, and tables and figures of them."""

    @property
    def best(self) -> OpenedCandidate | None:
        """Candidate of highest fitness, the earliest of equal ones; None before a candidate has succeeded."""
        best = super().best
        return None if best is None else OpenedCandidate.of_run(best, self)

    def candidate(self, candidate_id: int | None = None) -> OpenedCandidate:
        """Return the candidate with this id; None: the best.

        Raises:
            RunError: the candidate has not been evaluated, or no candidate has succeeded.
        """
        return OpenedCandidate.of_run(super().candidate(candidate_id), self)

    def frozen(self, task: Task, candidate_id: int | None = None) -> Frozen:
        """Return a candidate (None: the best) as an animal with a fixed policy, for the `others` of another task.

        task: task with the body of the run's task; it receives the candidate's eyes

        Raises:
            RunError: the candidate does not exist, or its policy is missing or damaged.
            ValueError: the eyes that the task places differ from the candidate's.
        """
        from evolve.learning.animal_task import with_phenotype
        from evolve.learning.policy import load_policy
        from sim.tasks.encounter import Frozen

        candidate = self.candidate(candidate_id)
        path = self.policy_path(candidate.id)
        require_policy(candidate, path)
        try:
            policy = load_policy(path)
        except ValueError as error:
            raise RunError(str(error)) from error
        return Frozen(with_phenotype(task, candidate.phenotype, self.config), policy)

    def resume(self, callbacks: Sequence[Callback] = (), progress: bool = True) -> None:
        """Carry an interrupted run to its end; a finished run stays unchanged. See `evolve.run` for the arguments.

        Raises:
            LockedError: another process works on the run.
            RunError: the run has a former format.
            ConfigError: the user task has not been named or fails at its start, or callbacks are not functions.
        """
        watchers = Callbacks(callbacks, progress)
        with resuming(self) as unfinished:
            if unfinished:
                watchers.carry_on(self)

    def to_dataframe(self) -> pd.DataFrame:
        """Return a table with a row per candidate: its outcome, and the values of all genes that it expresses."""
        return candidate_table(self.candidates)

    def drift(self, searches: int = 200) -> pd.DataFrame:
        """Return a comparison of the last generations with searches with random fitness.

        Each open gene, the acuity and the number of receptors have a row with the mean of the run, the median and the
        95 % range of the searches with random fitness, and the p-value of the run's mean.

        Raises:
            RunError: no generation is complete yet.
            ValueError: there are fewer than two searches.
        """
        from evolve.interactive.table import drift_table
        from evolve.report.gene_drift import drift_of

        return drift_table(drift_of([self], searches))

    def plot_fitness(self, axes: Axes | None = None) -> Axes:
        """Plot fitness over the generations: all candidates, the median of each generation, and the best so far.

        Return the axes, which are new if none are given.
        """
        from matplotlib import pyplot
        from matplotlib.ticker import MaxNLocator

        if axes is None:
            axes = pyplot.subplots(layout="constrained")[1]
        rows = generation_statistics(self.candidates)
        done = [candidate for candidate in self.candidates if candidate.failure is None]
        axes.plot([c.generation for c in done], [c.fitness for c in done], ".", color="0.6", label="candidates")
        generations = [row.generation for row in rows]
        axes.plot(generations, [row.median for row in rows], color="0.4", label="median")
        axes.plot(generations, [row.best_so_far for row in rows], "o-", label="best so far")
        axes.set(xlabel="generation", ylabel="fitness (mean return)")
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        axes.legend(frameon=False)
        return axes

    def report(self) -> Path:
        """Write the report, one HTML page, and return its path.

        Raises:
            RunError: the best candidate's policy is missing or damaged.
        """
        from evolve.report.write import write

        return write(self)

    def _repr_html_(self) -> str:
        return run_as_html(self).markup
