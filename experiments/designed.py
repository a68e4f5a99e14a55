"""Designed experiments: animals that do not evolve are trained several times for several tasks."""

from __future__ import annotations

import itertools
import math
import tempfile
from argparse import Namespace
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Any

from evolve.config.assemble import assemble
from evolve.config.run_config import EyeConfig, RunConfig
from evolve.genome.phenotype import NEURONS_PER_FEATURE, Phenotype
from evolve.learning.training_rung import TrainingRung
from evolve.search.job import Job
from evolve.search.local_executor import LocalExecutor
from evolve.search.worker import evaluate_candidate, prepare_device
from evolve.store.evaluation import Evaluation
from experiments.glass import paraboloid
from experiments.page import Page, exit_code, parser
from experiments.store import Origin, read_answer, read_rows, rounded, write_answer, write_rows

__all__ = ["Design", "Experiment", "HeldOut", "Trained", "crossed", "evaluate_and_test", "main", "train_all"]


INDEX = 1.9  # refractive index of glass; strong lenses then stay within the maximum height of reliefs
RHABDOM_LENGTH_UM = 200.0  # choice: rhabdoms of compound eyes, as in the preset


@dataclass(frozen=True)
class Design:
    """An animal, its task and light, and the seed of its training run.

    relative_aperture: pupil diameter / retina width of eyes with a paraboloid of glass; 0: eyes with perfect lenses
    glass_power: power of the glass, 1 in focus (see experiments.glass)
    vertical_fov_deg: vertical field of view of an eye; 0: that of square receptors
    features: features per eye, the width of its encoder; 0: a quarter of the neurons
    own: settings of this design alone, "section.name=value" separated by spaces
    facet_diameter_um: width of the facets of compound eyes; 0: camera eyes
    rhabdom_diameter_um, f_number: of the ommatidia of compound eyes

    Raises:
        ValueError: a number has more digits than a CSV file stores, so that the stored training run of this design
            would not be recognised.
    """

    task: str
    n_eyes: int
    height: int
    width: int
    placement_range_deg: float
    noise_sigma: float
    seed: int
    fov_deg: float = 45.0
    memory_frames: int = 5
    neurons: int = 64
    relative_aperture: float = 0.0
    glass_power: float = 0.0
    vertical_fov_deg: float = 0.0
    features: int = 0
    own: str = ""
    facet_diameter_um: float = 0.0
    rhabdom_diameter_um: float = 0.0
    f_number: float = 0.0

    def __post_init__(self) -> None:
        for f in fields(Design):
            value = getattr(self, f.name)
            if isinstance(value, float) and value != rounded(value):
                raise ValueError(f"Design: {f.name} = {value!r}: must be a stored number, such as {rounded(value)!r}")

    @property
    def animal(self) -> Phenotype:
        return Phenotype(
            n_eyes=self.n_eyes,
            placement_range_deg=self.placement_range_deg,
            fov_deg=self.fov_deg,
            resolution=(self.height, self.width),
            memory_frames=self.memory_frames,
            neurons=self.neurons,
            encoder=self.features or math.ceil(self.neurons / NEURONS_PER_FEATURE),
            vertical_fov_deg=self.vertical_fov_deg or None,
            **self._optics(),
        )

    def _optics(self) -> dict[str, Any]:
        if not self.relative_aperture:
            return {"relative_aperture": None, "relief": None, "refractive_index": None, **self._ommatidia()}
        relief = paraboloid(self.glass_power, self.relative_aperture, self.fov_deg, INDEX, EyeConfig())
        return {"relative_aperture": self.relative_aperture, "relief": relief, "refractive_index": INDEX}

    def _ommatidia(self) -> dict[str, float]:
        if not self.facet_diameter_um:
            return {}
        own = {name: getattr(self, name) for name in ("facet_diameter_um", "rhabdom_diameter_um", "f_number")}
        return {**own, "rhabdom_length_um": RHABDOM_LENGTH_UM, "acute_zone": 1.0}

    def config(self, settings: Sequence[str]) -> RunConfig:
        """Return the configuration of a run in which this animal could be a candidate."""
        own = [f"eye.optics={str(self.relative_aperture + self.facet_diameter_um > 0).lower()}"]
        own += ["eye.compound=true"] if self.facet_diameter_um else []
        own += [f"eye.noise_sigma={self.noise_sigma}"]
        return assemble(self.task, assignments=(*own, *settings, *self.own.split()))


@dataclass(frozen=True)
class Trained(Design):
    """A design and the result of its training run.

    fitness, success_rate: means over evaluation episodes
    episodes: number of these episodes
    steps: number of training steps
    seconds: wall time of the worker
    held_out, held_out_success_rate: means over episodes in the test set of layouts
    held_out_episodes: number of these episodes; 0: none were played
    """

    failed: int = 0
    fitness: float = 0.0
    success_rate: float = 0.0
    episodes: int = 0
    steps: int = 0
    seconds: float = 0.0
    held_out: float = 0.0
    held_out_success_rate: float = 0.0
    held_out_episodes: int = 0

    @property
    def design(self) -> Design:
        return Design(**{f.name: getattr(self, f.name) for f in fields(Design)})

    @classmethod
    def from_outcome(cls, design: Design, outcome: Evaluation) -> Trained:
        return cls(
            **asdict(design),
            failed=int(outcome.failure is not None),
            fitness=outcome.fitness,
            success_rate=outcome.success_rate,
            episodes=len(outcome.returns),
            steps=outcome.steps,
            seconds=outcome.seconds,
            **(outcome.test_columns if isinstance(outcome, HeldOut) else {}),
        )


@dataclass(frozen=True)
class HeldOut(Evaluation):
    """Outcome of a training run, with episodes in the test set of layouts."""

    test_columns: Mapping[str, Any] = field(default_factory=dict)


def evaluate_and_test(
    phenotype: Phenotype, config: RunConfig, seed: int, policy_path: Path, rung: TrainingRung | None = None, **how: Any
) -> Evaluation:
    """Train an animal, then play further episodes in the mode "test"; for use in a worker process.

    In tasks without layouts, these episodes differ from those of the fitness only in their starts and objects.
    """
    outcome = evaluate_candidate(phenotype, config, seed, policy_path, rung, **how)
    if outcome.failure is not None:
        return outcome
    from evolve.learning.final_figures import final_episodes
    from evolve.learning.policy import load_policy

    final = final_episodes(phenotype, config, load_policy(policy_path), seed)
    columns = {
        "held_out": float(final.returns.mean()),
        "held_out_success_rate": float(final.successes.mean()),
        "held_out_episodes": len(final.returns),
    }
    return HeldOut(**{f.name: getattr(outcome, f.name) for f in fields(Evaluation)}, test_columns=columns)


def train_all(
    designs: Iterable[Design],
    settings: Sequence[str],
    path: Path,
    workers: int = 0,
    tested: bool = False,
    needed: Iterable[Design] | None = None,
) -> list[Trained]:
    """Return the stored rows of the designs in their order, after training the missing ones.

    Each row is written as soon as it is complete. After an interruption, a repeated call trains only the designs that
    are still missing. The total hours are stored in a JSON file of the same name.

    settings: "section.name=value" for all designs, in addition to the tasks' settings
    workers: number of processes; 0: one per core
    tested: True if each trained animal also plays in the test set of layouts
    needed: designs to train, in this order; None: all
    """
    designs = list(designs)
    wanted = designs if needed is None else list(needed)
    known = {row.design: row for row in read_rows(Trained, path)}
    goes_on = bool(known)
    waiting = dict(enumerate(design for design in wanted if design not in known))
    team = LocalExecutor(evaluate_and_test if tested else evaluate_candidate, workers, prepare_device)
    with tempfile.TemporaryDirectory() as folder, team as executor:
        jobs = [
            Job(number, design.animal, design.config(settings), design.seed, Path(folder) / f"{number}.safetensors")
            for number, design in waiting.items()
        ]
        for job, outcome in executor.run(jobs):
            row = Trained.from_outcome(waiting[job.id], outcome)
            known[row.design] = row
            hours = sum(each.seconds for each in known.values()) / 3600
            made, here = path.with_suffix(".json"), Origin.here(hours, "worker")
            (here.after(made) if goes_on else here).write(made)
            write_rows([known[design] for design in designs if design in known], path)
            print(f"{len(known)} of {len(designs)}: {row}", flush=True)
    written = {row.design: row for row in read_rows(Trained, path)}
    return [written[design] for design in designs if design in written]


def crossed(
    animals: Iterable[Design], tasks: Iterable[str], noises: Iterable[float], seeds: Iterable[int]
) -> list[Design]:
    """Return all combinations of animals, tasks, noises and seeds. In navigation, each eye is one row of receptors."""
    return [
        replace(animal, task=task, height=animal.width if task != "navigation" else 1, noise_sigma=sigma, seed=seed)
        for seed, sigma, task, animal in itertools.product(seeds, noises, tasks, animals)
    ]


@dataclass(frozen=True)
class Experiment:
    """A designed experiment.

    name: name of page and data
    text: description of the program for `--help`
    designs: all training runs
    settings: settings of all training runs, "section.name=value"
    page: function that returns the page, from the stored rows, their origin and the written answer
    tested: True if each trained animal also plays in the test set of layouts
    needed: function that returns the training runs that the stored rows still lack, in order; None: all designs
    """

    name: str
    text: str
    designs: Callable[[], list[Design]]
    settings: Sequence[str]
    page: Callable[[Sequence[Trained], Origin, str], Page]
    tested: bool = False
    needed: Callable[[Sequence[Trained]], Sequence[Design]] | None = None


def main(experiment: Experiment, arguments: Sequence[str] | None = None) -> int:
    """Train missing animals if requested; make the page from the stored rows."""
    options = parser(experiment.text)
    options.add_argument("--compute", action="store_true", help="train the animals that the stored numbers lack")
    options.add_argument("--workers", type=int, default=0, help="processes; 0: one per core")
    options.add_argument("--answer", help="answer on the page; stored for later calls")
    chosen = options.parse_args(arguments)
    return exit_code(experiment.name, lambda: _made(experiment, chosen))


def _made(experiment: Experiment, chosen: Namespace) -> None:
    data = chosen.docs / "data" / f"{experiment.name}.csv"
    data.parent.mkdir(parents=True, exist_ok=True)
    if chosen.compute:
        _train(experiment, data, chosen.workers)
    rows = read_rows(Trained, data)
    if not rows:
        raise ValueError(f"{data} holds no animals; train some with --compute")
    if chosen.answer:
        write_answer(data, chosen.answer)
    experiment.page(rows, Origin.read(data.with_suffix(".json")), read_answer(data)).publish(chosen.docs)


def _train(experiment: Experiment, data: Path, workers: int) -> None:
    """Train the missing animals; new results may make further training runs unnecessary or necessary."""
    every = experiment.designs()
    while True:
        needed = every if experiment.needed is None else experiment.needed(read_rows(Trained, data))
        train_all(every, experiment.settings, data, workers, experiment.tested, needed)
        if experiment.needed is None or not needed:
            return
