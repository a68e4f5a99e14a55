"""Every setting and every gene changes an output; an option without any effect would mislead users.

The tables name each field of each config dataclass, and each gene, with a change to it and the output that must change.
A field or gene that is missing here fails the test, so a new one needs an entry that shows its effect.
"""

from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from evolve.config.assemble import assemble
from evolve.config.run_config import SECTIONS, GeneConfig, RunConfig
from evolve.genome.genes import (
    ALL_GENES,
    FACETS,
    LAMBDA_MAX,
    OPTIONAL,
    RHABDOM,
    SIDE,
    TIME_CONSTANT,
    VERTICAL,
    gene_table,
)
from evolve.genome.genotype import GENES, Genotype
from evolve.genome.phenotype import develop
from optics.numerics import backend
from tests.parameter_outputs import (
    budget_stages,
    charges,
    hired,
    history,
    layouts,
    life,
    moving_sight,
    own_sight,
    point_image,
    rides,
    sight,
    throughput,
    views,
)

# One training run of two updates and one evaluation episode. The preset freezes the field of view, which is open here.
SMALL = (
    "eye.relief_symmetric=false",
    "genome.doe.open=false",
    "genome.fov_deg.open=true",
    "learning.n_envs=4",
    "learning.n_steps=8",
    "learning.total_steps=64",
    "learning.batch_size=16",
    "learning.n_epochs=2",
    "learning.eval_interval=1000",
    "evaluation.episodes=1",
    "search.population=3",
    "search.generations=2",
    "genome.placement_range_deg.start=60",
)
# Genes that square eyes do not have.
OBLONG = (
    "eye.square=false",
    *(f"genome.resolution_{side}.{key}" for side in ("height", "width") for key in ("low=2", "start=4")),
)
PERFECT = ("eye.optics=false",)
SQUARE = ("eye.square=true", "genome.resolution.start=4", *PERFECT)
TEXTURED = f"{Path(__file__).parent / 'evolve' / 'grey_floor.py'}:GreyFloor"
OWN = f"{Path(__file__).parents[1] / 'examples' / 'find_ball.py'}:FindBall"
FOUR_TYPES = ("eye.receptors=genes", "genome.receptor_types.start=4", *PERFECT)


@pytest.fixture(scope="module", autouse=True)
def _device(short_episodes):
    backend.require()


@dataclass(frozen=True)
class Case:
    """A small run of `task` with settings `given`: applying `change` must change `output`."""

    change: str
    output: Callable
    given: tuple[str, ...] = PERFECT
    task: str = "detection"


# The steps are too small to change a weight. Evaluations differ only by the adaptation of the receptors, and
# improvement soon stops.
STAGNANT = ("learning.learning_rate=1e-30", "learning.total_steps=256", "learning.eval_interval=32", *PERFECT)
# Eyes whose receptors are one or two rhabdoms wide.
FOCUSED = ("eye.receptor_pitch=4e-6",)
GUIDED = ("eye.rhabdoms=true", *FOCUSED)
HIGH = ("eye.vertical_fov=gene", *PERFECT)
OF_FAMILY = (
    *("world.layouts=family", "world.training_layouts=1", "world.selection_layouts=1", "world.test_layouts=1"),
    *("world.layout_rows=9", "world.layout_columns=17", *PERFECT),
)
# Receptors that see one frame per action.
INSTANT = ("eye.rays_per_receptor=1", "eye.noise_sigma=0", *PERFECT)
IN_TIME = ("eye.temporal_order=1", "genome.time_constant_ms.start=200", "eye.frames=1", *INSTANT)
COMPOUND = ("eye.compound=true", "eye.illuminance=100")
NAVIGATING = ("genome.resolution_height.start=1", "eye.rays_per_receptor=1", *PERFECT)
FIELDS = {
    "task": Case("task=tracking", rides),
    "seed": Case("seed=1", history),
    "workers": Case("workers=2", hired),
    "eye.optics": Case("eye.optics=false", sight, ()),
    "eye.sensor_width": Case("eye.sensor_width=100e-6", point_image, ()),
    "eye.noise_sigma": Case("eye.noise_sigma=0.1", sight),
    "eye.illuminance": Case("eye.illuminance=100", sight),
    "eye.integration_time": Case("eye.integration_time=0.5", sight, ("eye.illuminance=100", *PERFECT)),
    "eye.receptors": Case("eye.receptors=honeybee", sight),
    "eye.bands": Case("eye.bands=3", sight),
    "eye.relief_height": Case("eye.relief_height=80e-6", point_image, ()),
    "eye.rays_per_receptor": Case("eye.rays_per_receptor=3", views),
    "eye.relief_points": Case("eye.relief_points=5", history, ("genome.doe.open=true",)),
    "eye.relief_symmetric": Case("eye.relief_symmetric=true", history, ("genome.doe.open=true",)),
    "eye.pupil_turned": Case("eye.pupil_turned=true", point_image, ("genome.doe_01.start=0.9",)),
    "eye.square": Case("eye.square=true", history, ("eye.square=false", *PERFECT)),
    "eye.vertical_fov": Case("eye.vertical_fov=horizontal", sight, ("genome.resolution_height.start=3", *PERFECT)),
    "eye.receptor_pitch": Case("eye.receptor_pitch=40e-6", point_image, ()),
    "eye.rhabdoms": Case("eye.rhabdoms=true", point_image, FOCUSED),
    "eye.rhabdom_index": Case("eye.rhabdom_index=1.38", point_image, GUIDED),
    "eye.rhabdom_surround": Case("eye.rhabdom_surround=1.33", point_image, GUIDED),
    "eye.rhabdom_length": Case("eye.rhabdom_length=100e-6", sight, GUIDED),
    "eye.rhabdom_absorption": Case("eye.rhabdom_absorption=1e4", point_image, ("eye.rhabdom_length=1e-4", *GUIDED)),
    "eye.head_radius": Case("eye.head_radius=100e-6", sight),
    "eye.receptor_width": Case("eye.receptor_width=100e-6", sight),
    "eye.compound": Case("eye.compound=true", sight, ("eye.compound=false",)),
    "eye.facet_area": Case("eye.facet_area=5e-9", sight, COMPOUND),
    "eye.temporal_order": Case("eye.temporal_order=1", moving_sight, INSTANT),
    "eye.latency_ms": Case("eye.latency_ms=200", moving_sight, IN_TIME),
    "eye.adaptation": Case("eye.adaptation=naka_rushton", moving_sight, IN_TIME),
    "eye.adaptation_ms": Case("eye.adaptation_ms=100", moving_sight, ("eye.adaptation=logarithmic", *IN_TIME)),
    "eye.event_threshold": Case("eye.event_threshold=0.1", moving_sight, IN_TIME),
    "eye.motion_detectors": Case("eye.motion_detectors=barlow_levick", moving_sight, IN_TIME),
    "eye.motion_ms": Case("eye.motion_ms=500", moving_sight, ("eye.motion_detectors=hassenstein_reichardt", *IN_TIME)),
    "eye.frames": Case("eye.frames=2", moving_sight, IN_TIME),
    "world.mazes": Case("world.mazes=2", views, NAVIGATING, "maze"),
    "world.unseen": Case("world.unseen=true", views, NAVIGATING, "maze"),
    "world.course": Case("world.course=long", views, NAVIGATING, "navigation"),
    "world.evaluation_course": Case("world.evaluation_course=long", views, NAVIGATING, "navigation"),
    "world.layouts": Case("world.layouts=family", views, NAVIGATING, "navigation"),
    "world.family_seed": Case("world.family_seed=1", layouts, OF_FAMILY, "maze"),
    "world.training_layouts": Case("world.training_layouts=2", layouts, OF_FAMILY, "maze"),
    "world.selection_layouts": Case("world.selection_layouts=2", layouts, OF_FAMILY, "maze"),
    "world.test_layouts": Case("world.test_layouts=2", layouts, OF_FAMILY, "maze"),
    "world.layout_rows": Case("world.layout_rows=11", layouts, OF_FAMILY, "maze"),
    "world.layout_columns": Case("world.layout_columns=19", layouts, OF_FAMILY, "maze"),
    "world.layout_actions": Case("world.layout_actions=8", layouts, OF_FAMILY, "maze"),
    "world.path_width": Case("world.path_width=1", layouts, OF_FAMILY, "navigation"),
    "world.selection_set": Case("world.selection_set=training", layouts, OF_FAMILY, "maze"),
    "world.wall_height": Case("world.wall_height=0.5", views),
    "world.least_light": Case("world.least_light=0.01", views),
    "world.medium": Case("world.medium=fog", views),
    "world.encoded_textures": Case("world.encoded_textures=false", own_sight, task=TEXTURED),
    "search.optimizer": Case("search.optimizer=mutation", history),
    "search.steady_state": Case("search.steady_state=true", history),
    "search.population": Case("search.population=4", history),
    "search.generations": Case("search.generations=3", history),
    "search.active": Case("search.active=true", history),
    "search.sigma": Case("search.sigma=0.1", history),
    "search.rungs": Case("search.rungs=2", budget_stages),
    "search.promoted": Case("search.promoted=0.7", budget_stages, ("search.rungs=2", *PERFECT)),
    "learning.total_steps": Case("learning.total_steps=96", life),
    "learning.n_envs": Case("learning.n_envs=2", views),
    "learning.n_steps": Case("learning.n_steps=16", life),
    "learning.batch_size": Case("learning.batch_size=32", life),
    "learning.n_epochs": Case("learning.n_epochs=3", life),
    "learning.least_epochs": Case("learning.least_epochs=1", life, ("learning.decay_after=16",)),
    "learning.learning_rate": Case("learning.learning_rate=1e-2", life),
    "learning.decay_after": Case("learning.decay_after=50", life),
    "learning.gamma": Case("learning.gamma=0.5", life),
    "learning.gae_lambda": Case("learning.gae_lambda=0.5", life),
    "learning.value_weight": Case("learning.value_weight=0.5", life),
    "learning.first_speed": Case("learning.first_speed=0.25", life),
    "learning.contact_ramp": Case("learning.contact_ramp=1000", life),
    "learning.rays_per_receptor": Case("learning.rays_per_receptor=1", views),
    "learning.least_return": Case("learning.least_return=-0.5", rides),
    "learning.eval_interval": Case("learning.eval_interval=32", life),
    "learning.patience": Case("learning.patience=1", life, STAGNANT),
    "wiring.shared_encoder": Case("wiring.shared_encoder=true", life, ("genome.n_eyes.start=2", *PERFECT)),
    "wiring.pool_side": Case("wiring.pool_side=1", life, ("genome.resolution_width.start=3", *PERFECT)),
    "wiring.repeat_side": Case("wiring.repeat_side=5", life),
    "evaluation.episodes": Case("evaluation.episodes=2", views),
    "costs.per_receptor": Case("costs.per_receptor=0.5", charges),
    "costs.per_eye": Case("costs.per_eye=0.5", charges),
    "costs.per_neuron": Case("costs.per_neuron=0.5", charges),
    "genome.GENE.open": Case("genome.fov_deg.open=false", history),
    "genome.GENE.low": Case("genome.fov_deg.low=20", history),
    "genome.GENE.high": Case("genome.fov_deg.high=90", history),
    "genome.GENE.start": Case("genome.fov_deg.start=50", history),
    "genome.GENE.opens_at": Case("genome.fov_deg.opens_at=1", history),
}
DOE = {name: point_image for name in GENES if name.startswith("doe_")}
GENE_OUTPUTS = {
    "n_eyes": sight,
    "placement_range_deg": sight,
    "elevation_deg": own_sight,
    "fov_deg": sight,
    "vertical_fov_deg": sight,
    "resolution_height": sight,
    "resolution_width": sight,
    "resolution": sight,
    "relative_aperture": point_image,
    **DOE,
    "refractive_index": point_image,
    "dispersion": point_image,
    "aperture_shape": point_image,
    "rhabdom_diameter_um": sight,
    "time_constant_ms": moving_sight,
    **dict.fromkeys(FACETS, sight),
    "memory_frames": life,
    "neurons": life,
    "layers": life,
    "receptor_types": sight,
    **dict.fromkeys(LAMBDA_MAX, sight),
}


def small(task, settings):
    """A small run with these settings. The preset "quick" has a lens, which compound eyes do not have."""
    preset = None if any(setting.startswith("eye.compound") for setting in settings) else "quick"
    oblong = () if any(setting.startswith("eye.square") for setting in settings) else OBLONG
    return assemble(task, preset, assignments=(*SMALL, *oblong, *settings))


@cache
def _settled(output, task, given):
    """The output before the change. It is computed twice, because an output that varies on its own could not show an
    effect."""
    config = small(task, given)
    animal = develop(Genotype(config.genome).start, config)
    first = output(config, animal)
    assert output(config, animal) == first, "the output does not repeat"
    return first


def _names(cls, prefix=""):
    """Dotted names of all settings below a config dataclass."""
    for f in fields(cls):
        if f.name == "genome":
            yield from (f"genome.GENE.{part.name}" for part in fields(GeneConfig))
        elif f.name in ("own", "code", "task_sha256"):
            continue  # source of a user task and its hash: tests/evolve/config/test_task_choice.py
        elif f.name in SECTIONS:
            yield from _names(SECTIONS[f.name], f"{f.name}.")
        else:
            yield f"{prefix}{f.name}"


def test_tables_name_every_setting_and_every_gene():
    assert set(FIELDS) == set(_names(RunConfig))
    assert set(GENE_OUTPUTS) == set(GENES) | set(gene_table(square=True, optional=frozenset(OPTIONAL)))
    assert all(is_dataclass(section) for section in SECTIONS.values())


@pytest.mark.parametrize("name", FIELDS)
def test_every_setting_moves_its_output(name):
    case = FIELDS[name]
    before = _settled(case.output, case.task, case.given)
    task = case.change.removeprefix("task=") if name == "task" else case.task
    change = () if name == "task" else (case.change,)
    config = small(task, (*case.given, *change))
    assert case.output(config, develop(Genotype(config.genome).start, config)) != before


@pytest.mark.parametrize("name", GENE_OUTPUTS)
def test_every_gene_moves_its_output(name):
    output = GENE_OUTPUTS[name]
    spectral = ALL_GENES[name].cluster == "spectral"
    task = "foraging" if spectral else OWN if output is own_sight else "detection"  # only foraging has colours
    special = {SIDE: SQUARE, RHABDOM: GUIDED, VERTICAL: HIGH, TIME_CONSTANT: IN_TIME, **dict.fromkeys(FACETS, COMPOUND)}
    given = FOUR_TYPES if spectral else special.get(name, () if output is point_image else PERFECT)
    before = _settled(output, task, given)
    config = small(task, (*given, f"genome.{name}.open=true"))
    genotype = Genotype(config.genome)
    genome = genotype.start
    place = [gene.name for gene in genotype.open_genes].index(name)
    genome[place] += 0.3 if genome[place] < 0.5 else -0.3
    assert output(config, develop(genome, config)) != before


def test_pupil_lets_light_in_by_its_area():
    """A wider pupil changes more than the sharpness: throughput goes with the square of the relative aperture."""
    config = small("detection", ())
    animal = develop(Genotype(config.genome).start, config)
    assert np.isclose(throughput(config, animal), animal.relative_aperture**2)
