"""The vertical field of view in a run: its setting, its gene, and receptors that are high enough."""

import json
from dataclasses import replace

import numpy as np
import pytest

from evolve.analysis.statistics import gene_values
from evolve.config.assemble import assemble, from_text, to_toml
from evolve.config.checks import ConfigError
from evolve.genome.genes import VERTICAL
from evolve.genome.genotype import Genotype
from evolve.genome.phenotype import Phenotype, develop
from evolve.report.tables import field_of_view

OPEN = ("genome.morphological.open=true", "genome.resolution_height.high=16", "genome.resolution_width.high=16")


def config_of(kind, *settings):
    return assemble("detection", assignments=[f"eye.vertical_fov={kind}", *OPEN, *settings])


def animals(config, n=200):
    rng = np.random.default_rng(0)
    size = len(Genotype(config.genome).start)
    return [develop(genome, config) for genome in rng.random((n, size))]


@pytest.mark.parametrize("kind", ["receptors", "horizontal", "gene"])
@pytest.mark.parametrize("sizes", [(), ("eye.receptor_pitch=9e-6",)])
def test_receptors_are_never_too_low(kind, sizes):
    """Every random genome has receptors at least as high and as wide as `eye.receptor_width`."""
    config = config_of(kind, "eye.receptor_width=8e-6", "genome.fov_deg.low=5", *sizes)
    for animal in animals(config):
        assert min(animal.eyes(config.eye).eye().receptor_size) >= 8e-6 * (1 - 1e-6)


def test_each_kind_has_its_field():
    for animal in animals(config_of("receptors"), 20):
        assert animal.vertical_fov_deg is None
    for animal in animals(config_of("horizontal"), 20):
        assert animal.vertical_fov_deg == animal.fov_deg
    config = config_of("gene")
    found = animals(config, 50)
    assert np.ptp([animal.vertical_fov_deg for animal in found]) > 50
    assert all(animal.eyes(config.eye).fovy_deg == animal.vertical_fov_deg for animal in found)


def test_the_field_is_kept_if_receptors_are_high_enough():
    config = config_of("gene", f"genome.{VERTICAL}.start=20", "genome.fov_deg.start=60")
    animal = develop(Genotype(config.genome).start, config)
    assert (animal.vertical_fov_deg, animal.fov_deg) == pytest.approx((20, 60))


def test_records_come_back():
    config = config_of("gene")
    assert from_text(to_toml(config)) == config
    animal = animals(config, 1)[0]
    assert Phenotype.from_json(json.loads(json.dumps(animal.to_json()))) == animal
    assert gene_values(animal, config.eye)[VERTICAL] == animal.vertical_fov_deg
    assert VERTICAL not in gene_values(animal, replace(config.eye, vertical_fov="horizontal"))
    former = animal.to_json()
    del former[VERTICAL]
    assert Phenotype.from_json(former).vertical_fov_deg is None
    with pytest.raises(ValueError, match=VERTICAL):
        Phenotype.from_json({**animal.to_json(), VERTICAL: 180.0})


def test_reports_say_how_high():
    animal = animals(config_of("receptors"), 1)[0]
    assert "high" not in field_of_view(animal)
    assert field_of_view(replace(animal, fov_deg=45.0, vertical_fov_deg=30.0)) == "45.0° wide, 30.0° high"


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        (("eye.vertical_fov=square",), r"eye\.vertical_fov = 'square': must be one of receptors, horizontal, gene"),
        (
            (f"genome.{VERTICAL}.start=30",),
            r"only eyes whose height evolves have this gene; set eye\.vertical_fov = gene",
        ),
        (("eye.vertical_fov=gene", f"genome.{VERTICAL}.high=180"), r"vertical_fov_deg\.high"),
        (
            (
                *("eye.vertical_fov=gene", f"genome.{VERTICAL}.open=false", f"genome.{VERTICAL}.start=1"),
                *(
                    "genome.fov_deg.open=false",
                    "genome.resolution_height.open=false",
                    "genome.resolution_height.start=9",
                ),
            ),
            r"9 rows of receptors at least 1e-06 m high \(eye\.receptor_width\) do not fit on a retina 0\.0002 m wide",
        ),
    ],
)
def test_contradictions(settings, says):
    with pytest.raises(ConfigError, match=says):
        assemble("detection", assignments=settings)
