"""`evolve.Run`: a run directory opened in Python, to analyse or resume the run."""

from __future__ import annotations

import os
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from types import NoneType
from typing import TYPE_CHECKING, Any

import numpy as np

from evolve.analysis.fitness_parts import fitness_label
from evolve.analysis.statistics import generation_statistics
from evolve.config.checks import ConfigError, quoted
from evolve.config.run_config import EyeConfig
from evolve.interactive.callbacks import Callback, Callbacks
from evolve.interactive.summary import animal_as_html, run_as_html
from evolve.interactive.table import candidate_table
from evolve.runs.resume import resuming
from evolve.store.candidate import Candidate
from evolve.store.directory import Run

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from evolve.learning.played_episodes import Episodes
    from sim.tasks.encounter import Frozen
    from sim.tasks.task import Task

__all__ = ["OpenedCandidate", "OpenedRun"]


@dataclass(frozen=True, repr=False)
class OpenedCandidate(Candidate):
    """A candidate of an opened run, with the settings that are needed to show its eyes.

    eye: settings shared by all eyes of the run
    medium: medium of the run's worlds: "air", "clear_ocean", "coastal_water" or "fog"
    """

    eye: EyeConfig = field(default_factory=EyeConfig)
    medium: str = "air"

    @classmethod
    def of_run(cls, candidate: Candidate, run: Run) -> OpenedCandidate:
        """Return the candidate, with the eye settings and the medium of its run added."""
        return cls(
            **{f.name: getattr(candidate, f.name) for f in fields(Candidate)},
            eye=run.config.eye,
            medium=run.config.world.medium,
        )

    def to_line(self) -> str:
        """Return the candidate's line in the record of its run."""
        return Candidate(**{f.name: getattr(self, f.name) for f in fields(Candidate)}).to_line()

    def show_eye(self) -> Figure:
        """Return a figure of the eyes' fields of view around the head, and of the relief and PSF of the pupil.

        For a perfect lens, only the fields of view are drawn. For compound eyes, the acceptance function is drawn
        instead of relief and PSF.

        Raises:
            optics.AccuracyError: the PSF cannot be computed accurately enough.
            optics.BackendError: Dr.Jit finds no usable LLVM library or GPU.
        """
        from evolve.interactive.eye_picture import eye_picture

        return eye_picture(self.phenotype, self.eye, self.medium)

    def _repr_html_(self) -> str:
        return animal_as_html(self).markup


class OpenedRun(Run):
    """A run directory: its configuration, its candidates, and tables and figures of the candidates."""

    @property
    def best(self) -> OpenedCandidate | None:
        """Candidate with the highest fitness (the earliest of several); None before a candidate has succeeded."""
        best = super().best
        return None if best is None else OpenedCandidate.of_run(best, self)

    def candidate(self, candidate_id: int | None = None) -> OpenedCandidate:
        """Return the candidate with this id; if the id is None, the best candidate.

        Raises:
            RunError: no evaluated candidate has this id, or, for None, no candidate has succeeded.
        """
        return OpenedCandidate.of_run(super().candidate(candidate_id), self)

    def frozen(self, task: Task, candidate_id: int | None = None) -> Frozen:
        """Return a candidate as an animal with a fixed policy. The `others` of another task can contain this animal.

        task: task of the animal, with the same body as the run's task; a copy of `task` receives the animal's eyes
        candidate_id: id of the candidate; None: the best candidate

        Raises:
            RunError: the candidate does not exist, or its policy is missing or damaged.
            ValueError: `task` is not a `sim.Task`, or it defines no mounts, or it defines several kinds of eyes, or its
                method `place` fails or does not return one mount for each eye.
            OSError: the policy's file cannot be read.
        """
        from evolve.episodes.recorder import trained_policy
        from evolve.learning.animal_task import with_phenotype
        from sim.tasks.encounter import Frozen

        candidate = self.candidate(candidate_id)
        return Frozen(with_phenotype(task, candidate.phenotype, self.config), trained_policy(self, candidate))

    def held_out(self, candidate_id: int | None = None, seed: int = 0, episodes: int | None = None) -> Episodes:
        """Play episodes in the test set of layouts, which neither training nor selection has used.

        A user task determines these layouts itself, in its mode "test". The result has `returns`, sums of rewards, and
        `verdicts` (1: solved, -1: not solved, 0: undecided), (episode,) each.

        candidate_id: id of the candidate; None: the best candidate
        seed: seed of the episodes
        episodes: number of episodes; None: the run's setting `evaluation.episodes`

        Raises:
            RunError: the candidate does not exist, or its policy is missing or damaged.
            ConfigError: the run has no test set, or was opened without the "FILE.py:CLASS" of its user task, or the
                task's code cannot be executed.
            ValueError: `episodes` is below 1, or `seed` is negative.
            RuntimeError: a method of the user task fails at the start of an episode.
            optics.BackendError: Dr.Jit finds no usable LLVM library or GPU.
            OSError: the policy's file cannot be read.
        """
        from evolve.episodes.held_out import held_out_episodes

        return held_out_episodes(self, candidate_id, seed, episodes)

    def resume(self, callbacks: Sequence[Callback] = (), progress: bool = True) -> None:
        """Continue an interrupted run to its end. A finished run stays unchanged.

        callbacks, progress: see `evolve.run`

        Raises:
            LockedError: another process is working on the run.
            RunError: the record is damaged or cannot be written, config.toml has changed since the run was opened, its
                format is too old, or the search proposes candidates that differ from those on record.
            ConfigError: config.toml is invalid, the optimizer is unknown or rejects the settings, `callbacks` is not a
                list of functions, the run was opened without the name of its user task, or a trial of the task fails.
            optics.BackendError: Dr.Jit finds no usable LLVM library or GPU.
            ExecutorError: no worker can evaluate candidates.
            OSError: a file of the run cannot be read or written.
        """
        watchers = Callbacks(callbacks, progress)
        with resuming(self) as unfinished:
            if unfinished:
                watchers.carry_on(self)

    def to_dataframe(self) -> pd.DataFrame:
        """Return a table with one row per candidate, indexed by its id: outcome, acuities and values of genes.

        Acuities are in cycles/degree. Genes that an animal lacks are NaN. For a failed candidate, fitness, task fitness
        and costs are NaN, and `failure` contains the reason.
        """
        return candidate_table(self.candidates)

    def drift(self, searches: int = 200) -> pd.DataFrame:
        """Return a table that compares the last generations of the run with simulated searches with random fitness.

        Each row is a quantity: a gene that the search varies, an acuity or the number of receptors. `run` is its mean
        in the run. `median` is the median of its means in the searches, and 95 % of these means lie between `low` and
        `high`. `p` is the p-value of `run`. Quantities that do not vary are omitted.

        searches: number of searches with random fitness

        Raises:
            RunError: no generation is complete yet.
            ValueError: `searches` is below 2 or above 100,000.
        """
        from evolve.interactive.table import drift_table
        from evolve.report.gene_drift import drift_of

        return drift_table(drift_of([self], searches))

    def plot_fitness(self, axes: Axes | None = None) -> Axes:
        """Plot fitness over the generations, and return the axes.

        The plot shows all successful candidates, the median of each generation, and the best fitness so far.

        axes: axes to draw on; None: new axes
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
        axes.set(xlabel="generation", ylabel=fitness_label(not self.config.costs.free))
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        axes.legend(frameon=False)
        return axes

    def report(self) -> Path:
        """Write the report as one HTML page, without an episode if no candidate has succeeded. Return its path.

        Raises:
            RunError: the best candidate's policy is missing or damaged.
            ConfigError: the run was opened without the "FILE.py:CLASS" of its user task, or this code cannot be run.
            RuntimeError: a method of the user task fails at the start of an episode.
            optics.BackendError: Dr.Jit finds no usable LLVM library or GPU.
            OSError: a file cannot be read or written.
        """
        from evolve.report.write import write

        return write(self)

    def replay(
        self,
        candidate_id: int | None = None,
        seed: int = 0,
        *,
        every: int | None = None,
        also: Collection[str] = (),
        out: Path | str | None = None,
        mode: str = "evaluation",
    ) -> list[Path]:
        """Play an episode of a candidate, and write a page of it, like `evolve replay`. Return the paths of all files.

        candidate_id: id of the candidate; None: the best candidate
        seed: seed of the episode
        every: a Rerun recording has one image of the scene per `every` actions; requires "rrd" in `also`; None: 8
        also: formats of additional files next to the page: "rrd" (a recording for Rerun), "gif" and "mp4"
        out: path of the page; None: a name in the run directory
        mode: "evaluation", or "test" for the layouts of the test set

        Raises:
            RunError: the candidate does not exist, or its policy is missing or damaged.
            ConfigError: an argument is invalid, a program that `also` needs is not installed, the run has no test set
                or was opened without the "FILE.py:CLASS" of its user task, or the task's code cannot be executed.
            ValueError: `every` is not a whole number from 1 to 1,000,000.
            RuntimeError: a method of the user task fails at the start of the episode.
            optics.BackendError: Dr.Jit finds no usable LLVM library or GPU.
            OSError: a file cannot be read or written.
        """
        from evolve.report.replay import write_replay

        return write_replay(self, candidate_id, _seed(seed), every, also, _path(out), mode)[1]

    def export(
        self, candidate_id: int | None = None, seed: int = 0, *, every: int = 8, out: Path | str | None = None
    ) -> list[Path]:
        """Play an episode of a candidate, write the views of its eyes as spectral EXR files, and return their paths.

        candidate_id: id of the candidate; None: the best candidate
        seed: seed of the episode
        every: number of actions from one file to the next, 1 to 1,000,000
        out: folder of the files; None: `exr` in the run directory. The command `evolve export` writes the same files.
            `sim.read_exr` reads them

        Raises:
            RunError: the candidate does not exist, or its policy is missing or damaged.
            ConfigError: an argument is invalid, the run has a user task but was opened without its "FILE.py:CLASS", or
                the code of the user task cannot be executed.
            ValueError: `every` is not a whole number from 1 to 1,000,000.
            RuntimeError: a method of the user task fails at the start of the episode.
            optics.BackendError: Dr.Jit finds no usable LLVM library or GPU.
            OSError: a file cannot be read or written.
        """
        from evolve.report.exr_export import export_run

        return export_run(self, candidate_id, _seed(seed), every, _path(out))

    def _repr_html_(self) -> str:
        return run_as_html(self).markup


def _seed(seed: Any) -> int:
    """Return the seed of an episode after a check.

    Raises:
        ConfigError: `seed` is not a whole number, or is negative.
    """
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or seed < 0:
        raise ConfigError(f"seed = {quoted(seed)}: must be a whole number, 0 or more")
    return int(seed)


def _path(out: Any) -> Path | None:
    """Return the path of a file or folder after a check; None for None.

    Raises:
        ConfigError: `out` is not a path.
    """
    if not isinstance(out, str | os.PathLike | NoneType):
        raise ConfigError(f"out = {quoted(out)}: must be a path")
    return None if out is None else Path(out)
