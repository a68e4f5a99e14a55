"""Immutable configuration of a run. All values are checked."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from evolve.config.checks import ConfigError, check_gene_use, check_values, quoted
from evolve.config.eye_checks import check_eye, check_wiring
from evolve.config.layout_checks import check_layouts
from evolve.config.settings import (
    SECTIONS,
    CostsConfig,
    EvaluationConfig,
    EyeConfig,
    LearningConfig,
    SearchConfig,
    WiringConfig,
    WorldConfig,
    setting,
)
from evolve.config.task_card import (
    OF_COURSES,
    OF_LAYOUTS,
    OF_MAZES,
    OF_SLIDING_AGENTS,
    OF_USER_TASKS,
    OPTIONAL_GENES,
    PATH_WIDTH,
    TaskCard,
    tasks_with,
)
from evolve.config.task_choice import TaskChoice
from evolve.config.task_code import TaskCode
from evolve.genome import anatomy
from evolve.genome.genes import CLUSTERS, FACETS, GENES, INHERITED, RHABDOM, Gene, GeneConfig
from evolve.genome.interval import Interval
from optics.elements.turbid_medium import MEDIA_OF_WORLDS
from sim.worlds.catalog import SUBSTEPS, TASKS

__all__ = [
    "SECTIONS",
    "TASKS",
    "ConfigError",
    "CostsConfig",
    "EvaluationConfig",
    "EyeConfig",
    "GeneConfig",
    "LearningConfig",
    "RunConfig",
    "SearchConfig",
    "WiringConfig",
    "WorldConfig",
]


@dataclass(frozen=True)
class RunConfig:
    """All settings that determine the outcome of a run, and the number of its processes.

    task: name of a built-in task, or FILE.py:CLASS of a user task
    seed: seed of search, training and evaluation
    workers: number of worker processes; 0: one per core
    task_sha256: SHA-256 of a user task's file; "" for a built-in task
    genome: settings of each gene of the animals (`GeneConfig`), by name. The search must vary at least one gene
    code: code of the user task, if the user has named the task on the command line or in a Python call; else None. The
        code of a task that is named only in a file is never executed

    The other fields are sections of settings; the classes of the sections describe them.

    Raises:
        ConfigError: a value is invalid or out of range, settings contradict each other, or a setting differs from its
            default although it has no effect. The message is one line.
    """

    task: str
    seed: int = setting(0, Interval(0, 2**63 - 1), "seed of search, training and evaluation")
    workers: int = setting(0, Interval(0, 1024), "worker processes; 0: one per core")
    task_sha256: str = setting("", None, "SHA-256 of a user task's file; a changed file is a different task")
    eye: EyeConfig = field(default_factory=EyeConfig)
    world: WorldConfig = field(default_factory=WorldConfig)
    genome: Mapping[str, GeneConfig] = field(default_factory=lambda: _default_genome())
    search: SearchConfig = field(default_factory=SearchConfig)
    learning: LearningConfig = field(default_factory=LearningConfig)
    wiring: WiringConfig = field(default_factory=WiringConfig)
    evaluation: EvaluationConfig = field(default_factory=EvaluationConfig)
    costs: CostsConfig = field(default_factory=CostsConfig)
    code: TaskCode | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        check_values(self, ("seed", "workers"))
        for section, kind in SECTIONS.items():
            if not isinstance(getattr(self, section), kind):
                raise ConfigError(f"{section} = {quoted(getattr(self, section))}: must be a {kind.__name__}", section)
            check_values(getattr(self, section), prefix=f"{section}.")
        self._check_task()
        if self.world.medium not in MEDIA_OF_WORLDS:
            known = ", ".join(MEDIA_OF_WORLDS)
            raise ConfigError(f"world.medium = {self.world.medium!r}: must be one of {known}", "world.medium")
        check_eye(self.eye)
        check_wiring(self.eye, self.wiring)
        self._check_world()
        for name, gene in self.genes.items():
            check_gene_use(gene, self.genome[name])
        self._check_clusters()
        self._check_phases()
        rollout = self.learning.n_envs * self.learning.n_steps
        if self.learning.batch_size > rollout:
            raise ConfigError(
                f"learning.batch_size = {self.learning.batch_size}: must be at most n_envs x n_steps = {rollout}",
                *("learning.batch_size", "learning.n_envs", "learning.n_steps"),
            )
        self._check_rungs(rollout)
        if self.eye.receptor_pitch > 0 and self.eye.sensor_width != EyeConfig.sensor_width:
            raise ConfigError(
                f"eye.sensor_width = {self.eye.sensor_width:g}: eye.receptor_pitch = {self.eye.receptor_pitch:g} "
                "already determines the width of retinas: set one of the two",
                *("eye.sensor_width", "eye.receptor_pitch"),
            )
        if self.eye.compound and (missing := [name for name in (*FACETS, RHABDOM) if name not in self.genome]):
            raise ConfigError(f"genome: must have {missing[0]}, a gene of compound eyes", "genome", "eye.compound")
        if (cramped := anatomy.contradiction(self.genome, self.eye)) is not None:
            message, keys = cramped
            raise ConfigError(message, *keys)

    def _check_task(self) -> None:
        """Check that the run's genes, settings and number of rendered frames per action suit the task.

        Raises:
            ConfigError: the genome contains a gene that the task lacks, or a setting that the task lacks differs from
                its default, or the task does not allow the number `eye.frames` of rendered frames per action.
        """
        for name in OPTIONAL_GENES:
            if name in self.genome and not self.card.has_gene(name):
                raise ConfigError(
                    f"genome.{name}: is for user tasks; in {self.task} eyes look along the floor",
                    *(f"genome.{name}", "task"),
                )
        self._check_settings((*OF_SLIDING_AGENTS, *OF_USER_TASKS))
        if not self.card.has_file and self.eye.frames and SUBSTEPS % self.eye.frames:
            raise ConfigError(
                f"eye.frames = {self.eye.frames}: must be 0, or a divisor of the {SUBSTEPS} physics steps of an action",
                "eye.frames",
            )

    def _check_world(self) -> None:
        """Check the settings of layouts. A setting that the task lacks must have its default value."""
        self._check_settings((*OF_MAZES, *OF_COURSES, *OF_LAYOUTS, PATH_WIDTH))
        check_layouts(self.world)

    def _check_settings(self, keys: tuple[str, ...]) -> None:
        """Check that each of these settings has its default value, unless the task has this setting.

        keys: dotted names of settings

        Raises:
            ConfigError: a setting that the task lacks has another value.
        """
        for key in keys:
            section, name = key.split(".")
            default = getattr(SECTIONS[section], name)
            if key not in self.card.settings and getattr(getattr(self, section), name) != default:
                others = tasks_with(key)
                named = " and ".join(others) if len(others) < len(TASKS) else "built-in tasks"
                whose = f"the task {others[0]}" if len(others) == 1 else named or "user tasks"
                raise ConfigError(f"{key}: is for {whose}, not for {self.task}", key, "task")

    def _check_clusters(self) -> None:
        """Check that the search varies a gene, and that the optical and spectral genes that it varies have an effect.

        Optical genes have an effect only with optics, and spectral genes only if receptor types are inherited.

        Raises:
            ConfigError: one of these conditions is not met.
        """
        genes = [gene for name, gene in self.genes.items() if self.genome[name].open]
        opened = {
            cluster: [f"genome.{gene.name}.open" for gene in genes if gene.cluster == cluster] for cluster in CLUSTERS
        }
        if not self.eye.optics and opened["optical"]:
            raise ConfigError(
                "eye.optics = false leaves no optical gene to evolve: set genome.optical.open = false",
                *("eye.optics", *opened["optical"]),
            )
        if self.eye.receptors != INHERITED and opened["spectral"]:
            raise ConfigError(
                f"eye.receptors = {self.eye.receptors!r} leaves no spectral gene to evolve: set eye.receptors = "
                f"{INHERITED!r}, or genome.spectral.open = false",
                *("eye.receptors", *opened["spectral"]),
            )
        if not any(use.open for use in self.genome.values()):
            keys = [f"genome.{name}.open" for name in self.genome]
            raise ConfigError("genome: every gene is frozen; open at least one (genome.NAME.open = true)", *keys)

    def _check_rungs(self, rollout: int) -> None:
        """Check the settings of successive halving, in which only the better candidates continue after each rung.

        A rung is a stage of training. Successive halving compares the candidates of a generation, so the search must
        propose candidates generation by generation. The first rung must be at least one rollout long.

        rollout: number of steps in a rollout

        Raises:
            ConfigError: one of these conditions is not met.
        """
        search = self.search
        if search.rungs == 1:
            return
        if search.steady_state:
            raise ConfigError(
                f"search.rungs = {search.rungs}: successive halving needs generations; set search.steady_state = false",
                *("search.rungs", "search.steady_state"),
            )
        first = self.learning.total_steps * search.promoted ** (search.rungs - 1)
        if first < rollout:
            raise ConfigError(
                f"search.rungs = {search.rungs}: the first rung, {first:.0f} steps, is less than one rollout "
                f"of {rollout} (learning.n_envs x n_steps)",
                *("search.rungs", "search.promoted", "learning.total_steps"),
            )

    def _check_phases(self) -> None:
        """Check `opens_at` of the open genes: the first generation in which the search varies the gene.

        This generation must come before the end of the run, and must be 0, the first, for at least one gene.

        Raises:
            ConfigError: one of these conditions is not met.
        """
        opening = {name: use.opens_at for name, use in self.genome.items() if use.open}
        for name, generation in opening.items():
            if generation >= self.search.generations:
                raise ConfigError(
                    f"genome.{name}.opens_at = {generation}: must be below search.generations = "
                    f"{self.search.generations}, else the gene never opens",
                    *(f"genome.{name}.opens_at", "search.generations"),
                )
        if min(opening.values()) > 0:
            raise ConfigError(
                f"genome: no gene opens before generation {min(opening.values())}; one must open at 0",
                *(f"genome.{name}.opens_at" for name in opening),
            )

    def __repr__(self) -> str:
        """Return a short description, because there are some 150 settings."""
        search, steps = self.search, self.learning.total_steps
        plan = f"{search.generations} generations x {search.population} candidates x {steps:,} steps"
        return f"<RunConfig {self.task}, seed {self.seed}, {plan}>"

    @property
    def genes(self) -> Mapping[str, Gene]:
        """All genes of the run's animals, by name."""
        return {name: gene for name, gene in self.eye.genes.items() if name in self.genome}

    @property
    def choice(self) -> TaskChoice:
        """Task of the run. It includes the code of a user task only if the user has named this code.

        The user names it in a command or call. Code that is named only in a file is never executed.
        """
        return TaskChoice(self.task, self.task_sha256, self.code)

    @property
    def card(self) -> TaskCard:
        """Properties of the task."""
        return self.choice.card

    @property
    def task_name(self) -> str:
        """Short name of the task, such as "detection"; for a user task, the name of its class."""
        return self.card.name

    def with_code(self, named: str) -> RunConfig:
        """Return a copy of this configuration that contains the code of the user task.

        named: file and class of the task, "FILE.py:CLASS"

        Raises:
            ConfigError: the run has no user task, the class has another name, the file cannot be read, or its content
                has changed since the run began.
        """
        return replace(self, code=self.choice.read(named))

    @property
    def candidates(self) -> int:
        """Number of candidates of the whole run: population times generations."""
        return self.search.population * self.search.generations


def _default_genome() -> Mapping[str, GeneConfig]:
    """Return the default settings of the genes of animals in the built-in tasks, by name."""
    return {name: gene.default for name, gene in GENES.items() if name not in OPTIONAL_GENES}
