"""Compound eyes in a run: their genes, the repair of facets that do not fit on the head, and their settings."""

import itertools
import json
import math

import numpy as np
import pytest

import sim
from evolve.analysis.acuity import acuity_vertical_cpd
from evolve.analysis.statistics import gene_values
from evolve.config.assemble import assemble, from_text, to_toml
from evolve.config.checks import ConfigError
from evolve.config.lint import lint
from evolve.genome.genes import FACETS, RHABDOM
from evolve.genome.genotype import Genotype
from evolve.genome.head_surface import COUNTS, DIAMETER, fitted
from evolve.genome.phenotype import Phenotype, develop, repaired

HEXAGON = math.sqrt(3) / 2


def config_of(*settings, task="detection"):
    return assemble(task, "compound", assignments=settings)


def animal_of(config):
    return develop(Genotype(config.genome).start, config)


def test_genes_become_ommatidia():
    config = config_of("genome.acute_zone.start=2", "genome.f_number.start=3", "genome.rhabdom_length_um.start=150")
    eyes = animal_of(config).eyes(config.eye)
    lens, rhabdom = eyes.ommatidium.lens, eyes.ommatidium.rhabdom
    assert lens.diameter == pytest.approx(20e-6)
    assert lens.object_focal_length() == pytest.approx(3 * 20e-6)
    assert (rhabdom.diameter, rhabdom.length) == pytest.approx((2e-6, 150e-6))
    assert (eyes.n_eyes, eyes.resolution, eyes.acute_zone, eyes.waveguide) == (2, (3, 8), 2.0, None)
    eye = animal_of(config).eye(config.eye)
    assert isinstance(eye, sim.CompoundEye)
    assert eye.directions == pytest.approx(sim.hexagonal_rows(3, 8, 60.0, 2.0))
    bright = animal_of(config_of("eye.illuminance=1000")).eye(config_of("eye.illuminance=1000").eye)
    dim = animal_of(config_of()).eye(config_of().eye)
    assert bright.photons == pytest.approx(10 * dim.photons), "photons follow the setting of the light"


@pytest.mark.parametrize("task", ["detection", "navigation"])
def test_animals_come_back_from_records(task):
    config = config_of(task=task)
    assert lint(config) == []
    assert from_text(to_toml(config)) == config
    animal = animal_of(config)
    assert animal.relative_aperture is animal.relief is animal.vertical_fov_deg is None
    assert Phenotype.from_json(json.loads(json.dumps(animal.to_json()))) == animal
    assert {name: gene_values(animal, config.eye)[name] for name in FACETS} == {
        name: config.genome[name].start for name in FACETS
    }
    with pytest.raises(ValueError, match="must all be null, or none"):
        Phenotype.from_json({name: value for name, value in animal.to_json().items() if name != "f_number"})
    with pytest.raises(ValueError, match="f_number"):
        Phenotype.from_json({**animal.to_json(), "f_number": 0.5})
    plain = assemble("detection", "quick")
    assert not set(FACETS) & {*plain.genome, *animal_of(plain).to_json()}


def test_every_genome_fits_on_the_head():
    """The facets have at most the area of the head, the local radius D/Δφ belongs to them, and rows end before the
    poles."""
    config = config_of("genome.n_eyes.open=true", "genome.n_eyes.high=6", "eye.facet_area=8e-9")
    genotype, random, changed = Genotype(config.genome), np.random.default_rng(3), 0
    for genome in random.random((400, genotype.dimension)):
        animal = develop(genome, config)
        rows, columns = animal.resolution
        facets = animal.n_eyes * rows * columns
        assert HEXAGON * facets * (1e-6 * animal.facet_diameter_um) ** 2 <= config.eye.facet_area * (1 + 1e-6)
        assert animal.facet_diameter_um >= config.genome[DIAMETER].low * (1 - 1e-6)
        assert animal.rhabdom_diameter_um <= animal.facet_diameter_um
        assert animal.eyes(config.eye).fovy_deg < 134, "180 degrees in Mercator's projection"
        changed += bool(repaired(genome, config))
    assert 200 < changed < 400


def test_the_repair_is_the_smallest_in_ratios():
    """Another search, over all counts one by one, finds the same facets."""
    config = config_of("eye.facet_area=6e-9", "genome.n_eyes.open=true")
    start = Genotype(config.genome).decode(Genotype(config.genome).start)
    asked = {**start, "n_eyes": 4.0, "resolution_height": 5.0, "resolution_width": 12.0, DIAMETER: 30.0, RHABDOM: 3.0}
    best = (math.inf, None)
    for eyes, rows, columns in itertools.product(range(1, 5), range(1, 6), range(4, 13)):
        width = min(30.0, 1e6 * math.sqrt(6e-9 / (HEXAGON * eyes * rows * columns)))
        ratios = (eyes / 4, rows / 5, columns / 12, width / 30)
        if width >= 8 and rows * HEXAGON * asked["fov_deg"] / columns <= 180:
            best = min(best, (sum(math.log(ratio) ** 2 for ratio in ratios), (eyes, rows, columns, width)))
    found = fitted(asked, config.genome, config.eye)
    assert tuple(found[name] for name in (*COUNTS, DIAMETER)) == pytest.approx(best[1])
    others = set(asked) - {*COUNTS, DIAMETER, RHABDOM}
    assert all(found[name] == asked[name] for name in others)
    assert fitted(start, config.genome, config_of().eye) == start, "what fits is not changed"


def test_acuity_counts_rows_of_a_hexagonal_lattice():
    animal = animal_of(config_of())
    assert acuity_vertical_cpd(animal) == pytest.approx(1 / (2 * HEXAGON * 60 / 8))


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (
            ("eye.receptor_pitch=4e-6",),
            r"eye\.receptor_pitch: is for camera eyes: leave it unchanged, or set eye\.compound = false",
        ),
        (("eye.temporal_order=1",), r"eye\.temporal_order: is for camera eyes"),
        (("eye.rhabdom_length=1e-4",), r"eye\.rhabdom_length: is for camera eyes"),
        (("wiring.pool_side=4",), r"wiring\.pool_side = 4: must be 0 for compound eyes"),
        (("wiring.repeat_side=4",), r"wiring\.repeat_side = 4: must be 0 for compound eyes"),
        (("eye.optics=false",), r"eye\.compound = true: facets are optics; set eye\.optics = true"),
        (("genome.relative_aperture.start=0.3",), r"relative_aperture: compound eyes have facets instead of a pupil"),
        (("eye.facet_area=1e-9", "genome.resolution_height.low=3"), r"2 eyes of 3 x 4 facets, .* do not fit on 1e-09"),
        (
            (*(f"genome.resolution_height.{key}" for key in ("low=9", "start=9", "high=16")), "eye.facet_area=1e-6"),
            r"9 rows of 4 ommatidia are too high for a field of view of 100°",
        ),
    ],
)
def test_contradictions_are_refused_in_one_line(settings, message):
    with pytest.raises(ConfigError, match=message) as raised:
        config_of(*settings)
    assert "\n" not in str(raised.value)


def test_settings_and_genes_of_compound_eyes_need_them():
    for setting, message in (
        ("eye.facet_area=1e-6", r"eye\.facet_area: is for compound eyes: set eye\.compound = true"),
        ("genome.f_number.open=true", r"only eyes that are compound eyes have this gene; set eye\.compound = true"),
    ):
        with pytest.raises(ConfigError, match=message):
            assemble("detection", "quick", assignments=[setting])
