"""`evolve.Run`: a run directory to look at in Python, and to carry on."""

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
    """A candidate of a run that is open: it knows what all eyes of its run have in common."""

    eye: EyeConfig = field(default_factory=EyeConfig)

    @classmethod
    def of_run(cls, candidate: Candidate, run: Run) -> OpenedCandidate:
        """The candidate, with its run's settings of eyes."""
        return cls(**{f.name: getattr(candidate, f.name) for f in fields(Candidate)}, eye=run.config.eye)

    def to_line(self) -> str:
        """Its line of a record."""
        return Candidate(**{f.name: getattr(self, f.name) for f in fields(Candidate)}).to_line()

    def show_eye(self) -> Figure:
        """The eyes on the head with their fields of view, and the pupil's relief and PSF of each of them."""
        from evolve.interactive.eye_picture import eye_picture

        return eye_picture(self.phenotype, self.eye)

    def _repr_html_(self) -> str:
        return animal_as_html(self).markup


class OpenedRun(Run):
    """A run directory: its config, its candidates, and what can be made of them."""

    @property
    def best(self) -> OpenedCandidate | None:
        """The candidate of highest fitness, the earliest where several have it; None before one has succeeded."""
        best = super().best
        return None if best is None else OpenedCandidate.of_run(best, self)

    def candidate(self, candidate_id: int | None = None) -> OpenedCandidate:
        """The candidate with this id; None: the best.

        Raises:
            RunError: it has not been evaluated, or none has succeeded.
        """
        return OpenedCandidate.of_run(super().candidate(candidate_id), self)

    def frozen(self, task: Task, candidate_id: int | None = None) -> Frozen:
        """A candidate (None: the best) as an animal that learns no more, for the `others` of another task.

        task: its body, as in the run's own task; its eyes are the candidate's

        Raises:
            RunError: there is no such candidate, or its policy is missing or no policy.
            ValueError: the task places other eyes than the candidate has.
        """
        from evolve.learning.animal_task import embodied
        from evolve.learning.policy import load_policy
        from sim.tasks.encounter import Frozen

        candidate = self.candidate(candidate_id)
        path = self.policy_path(candidate.id)
        require_policy(candidate, path)
        try:
            policy = load_policy(path)
        except ValueError as error:
            raise RunError(str(error)) from error
        return Frozen(embodied(task, candidate.phenotype, self.config), policy)

    def resume(self, callbacks: Sequence[Callback] = (), progress: bool = True) -> None:
        """Carry an interrupted run to its end, and leave a finished one as it is; see `evolve.run` for the
        arguments.

        Raises:
            LockedError: another process works on it.
            RunError: its format is a former one.
            ConfigError: its task is somebody's own and has not been named, or cannot be begun; or callbacks are none.
        """
        watchers = Callbacks(callbacks, progress)
        with resuming(self) as unfinished:
            if unfinished:
                watchers.carry_on(self)

    def to_dataframe(self) -> pd.DataFrame:
        """A row per candidate, by its id: how it fared, and the value of every gene that shows in it."""
        return candidate_table(self.candidates)

    def drift(self, searches: int = 200) -> pd.DataFrame:
        """A row per open gene, for the acuity and for the number of receptors: its mean over the last generations, that
        of searches with random fitness (median, and the range of 95 % of them), and the p of the run's.

        Raises:
            RunError: no generation is complete yet.
            ValueError: fewer than two searches.
        """
        from evolve.interactive.table import drift_table
        from evolve.report.gene_drift import drift_of

        return drift_table(drift_of([self], searches))

    def plot_fitness(self, axes: Axes | None = None) -> Axes:
        """Fitness over the generations: every candidate, the generations' medians, the best so far. Returns the axes,
        new ones unless given."""
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
        """Write the report, one HTML page, and return where it is.

        Raises:
            RunError: the best candidate's policy is missing or damaged.
        """
        from evolve.report.write import write

        return write(self)

    def _repr_html_(self) -> str:
        return run_as_html(self).markup
