"""Rhabdoms in a run: their gene, their settings, and contradictions between settings."""

import json

import numpy as np
import pytest

from evolve.analysis.statistics import gene_values
from evolve.config.assemble import assemble, from_text, to_toml
from evolve.config.checks import ConfigError
from evolve.genome.genes import RHABDOM
from evolve.genome.genotype import Genotype
from evolve.genome.phenotype import Phenotype, develop, repaired

GUIDED = ("eye.rhabdoms=true", "eye.receptor_pitch=4e-6", f"genome.{RHABDOM}.open=true")


def config_of(*settings):
    return assemble("detection", "quick", assignments=[*GUIDED, *settings])


def grown(config, diameter):
    genotype = Genotype(config.genome)
    place = [gene.name for gene in genotype.open_genes].index(RHABDOM)
    genome = genotype.start
    genome[place] = genotype.open_genes[place].encode(diameter, config.genome[RHABDOM])
    return genome, develop(genome, config)


def test_settings_and_gene_become_a_waveguide():
    config = config_of("eye.rhabdom_length=200e-6", "eye.rhabdom_absorption=7e3", "eye.rhabdom_index=1.37")
    guide = grown(config, 3.0)[1].eyes(config.eye).eye().waveguide
    assert guide.diameter == pytest.approx(3e-6)
    assert (guide.n_core, guide.n_clad, guide.length, guide.absorption) == (1.37, 1.34, 200e-6, 7e3)
    assert grown(config_of(), 2.0)[1].waveguide(config_of().eye).length is None


def test_rhabdoms_are_no_wider_than_receptors():
    config = config_of()
    genome, animal = grown(config, 5.5)
    assert animal.rhabdom_diameter_um == pytest.approx(4.0)
    assert RHABDOM in repaired(genome, config)
    assert RHABDOM not in repaired(grown(config, 3.9)[0], config)


def test_wider_rhabdoms_take_more_light():
    config = config_of()
    thin, wide = (grown(config, at)[1].eyes(config.eye).eye() for at in (1.2, 3.6))
    assert wide.white_signal > 3 * thin.white_signal
    assert wide.throughput == thin.throughput


def test_squares_have_no_such_gene_and_animals_of_before_none():
    plain = assemble("detection", "quick", assignments=["genome.optical.open=true"])
    assert RHABDOM not in plain.genome
    animal = develop(Genotype(plain.genome).start, plain)
    assert animal.rhabdom_diameter_um is None
    assert animal.eyes(plain.eye).waveguide is None
    record = animal.to_json()
    del record["rhabdom_diameter_um"]
    assert Phenotype.from_json(record) == animal


def test_records_come_back():
    config = config_of("eye.rhabdom_length=1e-4")
    assert from_text(to_toml(config)) == config
    animal = grown(config, 1.7)[1]
    assert Phenotype.from_json(json.loads(json.dumps(animal.to_json()))) == animal
    assert gene_values(animal)[RHABDOM] == pytest.approx(1.7)
    with pytest.raises(ValueError, match=RHABDOM):
        Phenotype.from_json({**animal.to_json(), RHABDOM: 99.0})
    assert np.isclose(Genotype(config.genome).decode(grown(config, 1.7)[0])[RHABDOM], 1.7)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (("genome.rhabdom_diameter_um.start=3",), r"only eyes with rhabdoms have this gene; set eye\.rhabdoms = true"),
        (("eye.rhabdom_length=1e-4",), r"eye\.rhabdom_length: is for rhabdoms"),
        (("eye.rhabdom_index=1.4",), r"eye\.rhabdom_index: is for rhabdoms"),
        (("eye.rhabdoms=true", "eye.optics=false"), r"eye\.optics = false gives none"),
        (("eye.rhabdoms=true", "eye.rhabdom_absorption=7e3"), r"set eye\.rhabdom_length"),
        (("eye.rhabdoms=true", "eye.rhabdom_index=1.33"), r"must lie in \[0\.2, 0\.5\]"),
        (("eye.rhabdoms=true", "eye.rhabdom_index=1.9"), r"must lie in \[0\.2, 0\.5\]"),
    ],
)
def test_contradictions_are_named(settings, message):
    with pytest.raises(ConfigError, match=message):
        assemble("detection", "quick", assignments=list(settings))
