"""Receptors with memory in a run: their gene, their settings, and the medium of the worlds."""

import json

import pytest

import optics
import sim
from evolve.analysis.statistics import gene_values
from evolve.config.assemble import assemble, from_text, to_toml
from evolve.config.checks import ConfigError
from evolve.config.lint import lint
from evolve.genome.genes import TIME_CONSTANT
from evolve.genome.genotype import Genotype
from evolve.genome.phenotype import Phenotype, develop
from evolve.learning.animal_task import animal_task


def config_of(*settings):
    return assemble("detection", "quick", assignments=settings)


def animal_of(config):
    return develop(Genotype(config.genome).start, config)


SLOW = ("eye.temporal_order=2", f"genome.{TIME_CONSTANT}.start=80")


def test_settings_and_gene_become_the_dynamics_of_receptors():
    config = config_of(
        *SLOW,
        "eye.latency_ms=30",
        "eye.adaptation=logarithmic",
        "eye.adaptation_ms=500",
        "eye.frames=5",
        "eye.motion_detectors=barlow_levick",
        "eye.motion_ms=12",
    )
    assert animal_of(config).eyes(config.eye).eye().dynamics == optics.ReceptorDynamics(
        80.0, 2, 30.0, "logarithmic", 500.0, motion="barlow_levick", motion_ms=12.0, frames=5
    )
    counting = config_of(*SLOW, "eye.event_threshold=0.2")
    assert animal_of(counting).dynamics(counting.eye).event_threshold == 0.2


def test_the_gene_is_optional_and_comes_back_from_records():
    plain, config = config_of(), config_of(*SLOW, f"genome.{TIME_CONSTANT}.open=true")
    assert TIME_CONSTANT not in plain.genome
    assert animal_of(plain).dynamics(plain.eye) is None
    assert TIME_CONSTANT not in animal_of(plain).to_json()
    assert Genotype(config.genome).dimension == Genotype(plain.genome).dimension + 1
    assert from_text(to_toml(config)) == config
    animal = animal_of(config)
    assert Phenotype.from_json(json.loads(json.dumps(animal.to_json()))) == animal
    assert gene_values(animal)[TIME_CONSTANT] == pytest.approx(80.0)
    with pytest.raises(ValueError, match=TIME_CONSTANT):
        Phenotype.from_json({**animal.to_json(), TIME_CONSTANT: 1e6})


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (("eye.latency_ms=5",), r"eye\.latency_ms: is for receptors with memory: set eye\.temporal_order"),
        (("eye.frames=5",), r"eye\.frames: is for receptors with memory"),
        ((f"genome.{TIME_CONSTANT}.open=true",), r"eye\.temporal_order"),
        ((*SLOW, "eye.adaptation=fast"), r"eye\.adaptation = 'fast': must be one of none, naka_rushton, logarithmic"),
        ((*SLOW, "eye.motion_detectors=emd"), r"eye\.motion_detectors = 'emd': must be one of none, hassenstein"),
        ((*SLOW, "eye.adaptation_ms=5"), r"eye\.adaptation_ms: has no effect with eye\.adaptation = none"),
        ((*SLOW, "eye.motion_ms=5"), r"eye\.motion_ms: has no effect with eye\.motion_detectors = none"),
        (
            (*SLOW, "eye.event_threshold=0.1", "eye.adaptation=naka_rushton"),
            r"eye\.event_threshold = 0\.1: must be 0 with eye\.adaptation = naka_rushton",
        ),
        ((*SLOW, "eye.event_threshold=1e-4"), r"eye\.event_threshold = 0\.0001: must be 0, or at least 0\.001"),
        ((*SLOW, "eye.frames=3"), r"eye\.frames = 3: must be 0, or a divisor of the 10 physics steps of an action"),
        (("eye.temporal_order=3",), r"eye\.temporal_order = 3: must be in \[0, 2\]"),
        (("world.medium=milk",), r"world\.medium = 'milk': must be one of air, clear_ocean, coastal_water, fog"),
    ],
)
def test_contradictions_are_refused_in_one_line(settings, message):
    with pytest.raises(ConfigError, match=message) as raised:
        config_of(*settings)
    assert "\n" not in str(raised.value)


def test_a_medium_fills_the_worlds_and_the_eyes():
    config = config_of("world.medium=coastal_water")
    animal = animal_of(config)
    assert animal_task(animal, config).world.medium == optics.sea_water(1.0)
    wet, dry = animal.eye(config.eye, config.world.medium), animal.eye(config.eye)
    assert wet.pupil.index_behind(550e-9) == pytest.approx(1.335, abs=1e-3)
    assert dry.pupil.index_behind(550e-9) == 1.0
    scene = sim.BatchedRenderer(animal_task(animal, config).world, animal.eyes(config.eye), 1, sim.Fidelity(1, 4)).eye
    assert repr(scene.pupil) == repr(wet.pupil)  # reports draw the eye that is rendered


def test_few_bands_for_the_medium_give_a_warning():
    quiet = ("eye.noise_sigma=0.005", "eye.optics=false")
    assert not any("eye.bands" in line for line in lint(config_of("world.medium=fog", *quiet)))
    (line,) = (line for line in lint(config_of("world.medium=clear_ocean", *quiet)) if "eye.bands" in line)
    assert "6 bands are enough" in line or "8 bands are enough" in line
