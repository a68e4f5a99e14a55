"""Plan of a run that has not started: its genes, evaluations and steps, and the predicted time and disk space."""

from __future__ import annotations

import shutil
from dataclasses import asdict, dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from evolve.cli.pace import Pace, measure_pace
from evolve.config.lint import lint
from evolve.config.numbering import Place
from evolve.config.run_config import RunConfig
from evolve.genome.genes import CLUSTERS
from evolve.genome.genotype import Genotype
from evolve.genome.phenotype import Phenotype, develop
from evolve.search.local_executor import cores
from evolve.search.successive_halving import budgets, evaluations, sizes, trained_steps
from evolve.search.successive_halving import steps as total_steps
from evolve.store.candidate import Candidate
from evolve.store.evaluation import Evaluation

__all__ = ["RunPlan", "steps_each"]

# [bytes] Allowance for the report. For comparison, `evolve report` writes 0.6 MB for a run with eight candidates.
REPORT_BYTES = 5_000_000
# Number of actions, actions per EXR file, and pixels along the longer side, for the exported episode. They are copied
# from evolve.episodes.recorder, whose import would load torch. A test checks that they are equal.
EPISODE_ACTIONS, EXR_EVERY, EXR_PIXELS = 256, 8, 60


@dataclass(frozen=True)
class RunPlan:
    """Plan of a run.

    config: settings of the run
    directory: run directory
    workers: number of worker processes
    paces: how fast a worker trains and evaluates an animal, by the name of the animal: "start", whose genes have their
        start values, and "middle", whose genes are in the middle of their ranges; {} if this has not been measured
    """

    config: RunConfig
    directory: Path
    workers: int
    paces: dict[str, Pace] = field(default_factory=dict)

    @classmethod
    def from_config(cls, config: RunConfig, directory: Path) -> RunPlan:
        return cls(config, directory, config.workers or cores())

    def measured(self) -> RunPlan:
        """Return the plan with measured `paces`: how fast a worker on this machine trains and evaluates an animal.

        The measurement takes a few seconds.

        Raises:
            BackendError: Dr.Jit finds no usable LLVM library or GPU.
            ConfigError: an animal cannot be evaluated on this machine; see `measure_pace`.
            ExecutorError: a worker process died.
        """
        paces = measure_pace(self.config, self.animals, self.workers)
        return RunPlan(self.config, self.directory, self.workers, paces)

    @property
    def animals(self) -> dict[str, Phenotype]:
        """Two animals that represent all others, "start" and "middle".

        The genes of "start" have their start values. The genes of "middle" are in the middle of their ranges.
        """
        genotype = Genotype(self.config.genome)
        middle = np.full(genotype.dimension, 0.5)
        return {"start": develop(genotype.start, self.config), "middle": develop(middle, self.config)}

    @property
    def hours(self) -> dict[str, float]:
        """Predicted wall times of the run [h], one for each measured animal, by the animal's name.

        A prediction assumes that all candidates take the same time as the animal, and that no training stops early. If
        training is divided into rungs, each rung is counted only for the candidates that reach it.
        """
        search, learning = self.config.search, self.config.learning
        if search.steady_state:
            busy = min(self.workers, search.population)  # maximum number of candidates that train at the same time
            rounds = -(-self.config.candidates // busy)
            return {name: rounds * pace.candidate_s(self.config) / 3600 for name, pace in self.paces.items()}
        rungs = list(zip(sizes(search), pairwise((0, *budgets(search, learning))), strict=True))
        return {
            name: search.generations
            * sum(-(-size // self.workers) * pace.rung_s(learning, *span) for size, span in rungs)
            / 3600
            for name, pace in self.paces.items()
        }

    @property
    def disk_bytes(self) -> int:
        """Predicted size of policies, record, report and EXR files of the run [bytes].

        Two animals represent all others: one whose genes have their start values, and one whose genes are in the middle
        of their ranges. Their policies and EXR files differ in size, and the larger size is used for each kind of file.
        Sizes of policies are known only after a short training, so the plan must be a result of the method `measured`.
        """
        policy = max(pace.policy_bytes for pace in self.paces.values())
        pictures = max(_exr_bytes(animal, self.config.eye.bands) for animal in self.animals.values())
        lines = evaluations(self.config.search) * self._line_bytes()
        return self.config.candidates * policy + lines + REPORT_BYTES + pictures

    @property
    def free_bytes(self) -> int:
        """Free space on the disk that contains the run directory [bytes]."""
        existing = next(path for path in (self.directory.resolve(), *self.directory.resolve().parents) if path.exists())
        return shutil.disk_usage(existing).free

    def _rung_lines(self) -> list[str]:
        """Return a list of one line with the candidates and steps of all rungs; [] if there is only one rung.

        A rung is a stage of training, after which only the better candidates continue.
        """
        search = self.config.search
        ends = zip(sizes(search), budgets(search, self.config.learning), strict=True)
        rungs = ", ".join(f"{size} candidates for {steps:,} steps" for size, steps in ends)
        return [f"rungs          {rungs}"] if search.rungs > 1 else []

    def _line_bytes(self) -> int:
        """Return the size of a candidate's line in the record [bytes]."""
        config, genotype = self.config, Genotype(self.config.genome)
        plays = -(-config.learning.total_steps // config.learning.eval_interval)
        value = np.pi
        outcome = Evaluation(value, (value,) * config.evaluation.episodes, 1.0, 1, value, ((1_000_000, value),) * plays)
        genome = (value / 4,) * genotype.dimension
        animal = self.animals["middle"]
        parents = tuple(range(config.search.population // 2))
        return len(Candidate.from_evaluation(Place(1, 1, 1), genome, animal, 2**31, outcome, parents).to_line())

    def lines(self) -> list[str]:
        """Return the plan as lines of text."""
        config = self.config
        search, genotype = config.search, Genotype(config.genome)
        order = "steady state" if search.steady_state else "generation by generation"
        lines = [
            f"task           {config.task}, seed {config.seed}",
            f"search         {search.optimizer}, {order}, on {self.workers} workers",
            f"evaluations    {search.generations} generations x {search.population} candidates = {config.candidates:,}",
            *self._rung_lines(),
            f"steps          up to {steps_each(config)} each, {total_steps(config):,} in all",
            f"genes open     {genotype.dimension} of {len(config.genome)}",
            *_gene_lines(config),
        ]
        for name, pace in self.paces.items():
            what = {"start": "are like the first", "middle": "have genes in the middle of their ranges"}[name]
            whole = config.learning.total_steps
            speed = whole / pace.training_s(config.learning, 0, whole)
            lines.append(
                f"predicted      {_duration(self.hours[name])} if animals {what}: {speed:,.0f} steps/s "
                f"per worker, {pace.candidate_s(config):,.0f} s per candidate"
            )
        if self.paces:
            lines.append(f"disk           {_size(self.disk_bytes)} in {self.directory}, {_size(self.free_bytes)} free")
        return lines + [f"note           {note}" for note in self.notes()]

    def notes(self) -> list[str]:
        """Return warnings about settings and disk space."""
        short = self.paces and self.disk_bytes > self.free_bytes
        return [*lint(self.config), *(["the disk is too small for this run"] if short else [])]

    def record(self) -> dict[str, Any]:
        """Return the plan as JSON values by name.

        The predicted time ("hours") and disk space ("disk_bytes") follow from the measured speed of training ("pace").
        Before this measurement, "hours" and "pace" are {}, and "disk_bytes" is None.
        """
        config = self.config
        opening = {g.name: config.genome[g.name].opens_at for g in Genotype(config.genome).open_genes}
        return {
            "task": config.task,
            "directory": str(self.directory),
            "workers": self.workers,
            "genes": opening,
            "evaluations": config.candidates,
            "steps": total_steps(config),
            "hours": self.hours,
            "pace": {name: asdict(pace) for name, pace in self.paces.items()},
            "disk_bytes": self.disk_bytes if self.paces else None,
            "free_bytes": self.free_bytes,
            "notes": self.notes(),
        }


def steps_each(config: RunConfig) -> str:
    """Return the number of steps of a training run as text.

    If the number was rounded up to whole rollouts, the text also contains the configured number.
    """
    learning = config.learning
    trained = trained_steps(learning, 0, learning.total_steps)
    rounded = f" ({learning.total_steps:,} rounded up to rollouts of {learning.n_envs * learning.n_steps:,})"
    return f"{trained:,}{rounded if trained != learning.total_steps else ''}"


def _gene_lines(config: RunConfig) -> list[str]:
    """Return lines that list the open genes, which are the genes that the search varies.

    Each cluster (morphological, optical, neural or spectral genes) has its own line. If the search varies some genes of
    a cluster only from a later generation on, these genes have a separate line, which states the generation.
    """
    genes = Genotype(config.genome).open_genes
    lines = []
    for cluster in CLUSTERS:
        for opens_at in Genotype(config.genome).phases:
            names = [g.name for g in genes if g.cluster == cluster and config.genome[g.name].opens_at == opens_at]
            relief = [name for name in names if name.startswith("doe_")]
            names = [name for name in names if name not in relief]
            names += [f"{relief[0]} … {relief[-1]} ({len(relief)})"] if relief else []
            since = f" from generation {opens_at}" if opens_at else ""
            lines += [f"  {cluster}{since}: {', '.join(names)}"] if names else []
    return lines


def _exr_bytes(animal: Phenotype, bands: int) -> int:
    """Return the uncompressed size of an episode's EXR files [bytes], which contain bands and a preview as float32."""
    factor = max(1, -(-EXR_PIXELS // max(animal.resolution)))
    pixels = animal.n_eyes * animal.resolution[0] * animal.resolution[1] * factor**2
    return EPISODE_ACTIONS // EXR_EVERY * pixels * (bands + 3) * 4


def _duration(hours: float) -> str:
    return f"{hours:.1f} hours" if hours >= 1 else f"{60 * hours:.0f} minutes"


def _size(count: float) -> str:
    for unit in ("B", "kB", "MB", "GB"):
        if count < 1000:
            return f"{count:.3g} {unit}"
        count /= 1000
    return f"{count:,.1f} TB"
