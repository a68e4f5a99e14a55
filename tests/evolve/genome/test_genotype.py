"""Genes and genomes: every genome is an animal, and the encoding is lossless."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import sim
from evolve.config.assemble import assemble
from evolve.config.run_config import TASKS
from evolve.genome.genes import ALL_GENES, APERTURE_SHAPES, LAMBDA_MAX
from evolve.genome.genotype import CLUSTERS, GENES, Genotype, group_members
from evolve.genome.phenotype import Phenotype, develop
from tests.slow_part import sweep

CONFIG = assemble("detection")
GENOTYPE = Genotype(CONFIG.genome)


def test_start_is_one_eye_with_one_photoreceptor_behind_45_degrees():
    animal = develop(GENOTYPE.start, CONFIG)
    assert (animal.n_eyes, animal.resolution, animal.fov_deg) == (1, (1, 1), 45.0)


@sweep(200, fast=50)
@given(st.lists(st.floats(-0.5, 1.5), min_size=GENOTYPE.dimension, max_size=GENOTYPE.dimension))
def test_every_genome_decodes_into_the_genes_ranges(genome):
    for name, value in GENOTYPE.decode(np.array(genome)).items():
        assert value in GENES[name].range
        assert CONFIG.genome[name].low <= value <= CONFIG.genome[name].high
        if GENES[name].kind == "integer":
            assert value == int(value)


def test_integers_share_the_unit_interval_equally():
    """Rounding low + u (high - low) would give the two ends half of the other values' share."""
    gene, use = GENES["n_eyes"], CONFIG.genome["n_eyes"]
    u = (np.arange(16_000) + 0.5) / 16_000
    values, counts = np.unique([gene.decode(x, use) for x in u], return_counts=True)
    assert values.tolist() == list(range(1, 17))
    assert set(counts) == {1000}
    assert gene.decode(1.0, use) == 16


@pytest.mark.parametrize("name", GENES)
def test_encoding_inverts_decoding(name):
    gene = GENES[name]
    use = CONFIG.genome.get(name, gene.default)
    values = range(int(use.low), int(use.high) + 1) if gene.kind == "integer" else np.linspace(use.low, use.high, 7)
    for value in values:
        assert gene.decode(gene.encode(value, use), use) == pytest.approx(value, rel=1e-12)


def test_frozen_genes_hold_their_start_and_leave_the_genome():
    config = assemble("detection", assignments=["genome.doe.open=false", "genome.fov_deg.open=false"])
    genotype = Genotype(config.genome)
    assert genotype.dimension == GENOTYPE.dimension - 17
    for corner in (0.0, 1.0):
        animal = develop(np.full(genotype.dimension, corner), config)
        assert animal.fov_deg == 45.0
        assert animal.relief == (0.5,) * 16
        assert animal.n_eyes == (1 if corner == 0 else 16)


def test_relief_is_in_row_major_order():
    config = assemble("detection", assignments=["genome.doe_12.start=0.9"])
    relief = np.reshape(develop(Genotype(config.genome).start, config).relief, (4, 4))
    assert relief[1, 2] == pytest.approx(0.9)
    assert np.count_nonzero(relief != 0.5) == 1


def test_genome_of_wrong_length_or_content_is_refused():
    with pytest.raises(ValueError, match=f"must be {GENOTYPE.dimension} finite numbers"):
        GENOTYPE.decode(np.zeros(GENOTYPE.dimension + 1))
    with pytest.raises(ValueError, match="finite"):
        GENOTYPE.decode(np.full(GENOTYPE.dimension, np.nan))


def test_optics_off_is_the_perfect_lens():
    config = assemble("detection", assignments=["eye.optics=false"])
    animal = develop(Genotype(config.genome).start, config)
    assert (animal.relative_aperture, animal.relief, animal.refractive_index) == (None, None, None)
    assert animal.eyes(config.eye).optics is None


def test_tasks_are_those_of_the_simulation():
    assert set(TASKS) == set(sim.TASKS)


def test_groups_cover_all_genes_once():
    members = [name for cluster in CLUSTERS for name in group_members(cluster)]
    assert sorted(members) == sorted(ALL_GENES)
    assert set(GENES) < set(ALL_GENES)
    assert len(group_members("doe")) == 81  # the largest relief has 9 x 9 points
    assert group_members("lambda_max") == tuple(LAMBDA_MAX)
    assert group_members("spectral") == ("receptor_types", *LAMBDA_MAX)
    assert group_members("nonsense") == ()


def test_phenotype_survives_being_written():
    animal = develop(np.linspace(0, 1, GENOTYPE.dimension), CONFIG)
    assert Phenotype.from_json(animal.to_json()) == animal
    perfect = replace(animal, relative_aperture=None, relief=None, refractive_index=None)
    assert Phenotype.from_json(perfect.to_json()) == perfect


def test_animals_on_record_that_name_no_encoder_have_one_of_16():
    record = replace(develop(GENOTYPE.start, CONFIG), neurons=4, encoder=1).to_json()
    assert Phenotype.from_json(record).encoder == 1
    del record["encoder"]
    assert Phenotype.from_json(record).encoder == 16


def test_there_are_more_than_1e20_genotypes_and_a_tenth_of_a_range_makes_another_animal():
    """The count uses ten values of each real gene, which all give different animals."""
    assert GENOTYPE.count(10) == 16**3 * 10 * 512 * 10.0 ** (2 + 18)
    assert GENOTYPE.count(10) > 1e20
    for place, gene in enumerate(GENOTYPE.open_genes):
        animals = set()
        for u in (np.arange(10) + 0.5) / 10:
            genome = GENOTYPE.start
            genome[place] = u
            animals.add(develop(genome, CONFIG))
        assert len(animals) == 10, gene.name


def test_pupils_have_every_shape_and_glass():
    config = assemble("detection", "quick", assignments=["genome.optical.open=true"])
    start = develop(Genotype(config.genome).start, config)
    areas = {}
    for number, name in enumerate(APERTURE_SHAPES):
        pupil = replace(start, aperture_shape=number).pupil(config.eye)
        areas[name] = pupil.aperture.area
    # The areas in units of the squared pupil radius are π, π (1 - 1/4), 4·4/17 and n/2 sin(2π/n).
    polygons = {name: n / 2 * np.sin(2 * np.pi / n) for n, name in enumerate(APERTURE_SHAPES[3:], start=3)}
    assert areas == pytest.approx({"circle": np.pi, "annulus": 0.75 * np.pi, "slit": 16 / 17, **polygons})
    flint = replace(start, dispersion=1 / 30).pupil(config.eye)
    n_f, n_d, n_c = (flint.n.at(line) for line in (486.134e-9, 587.562e-9, 656.281e-9))
    assert (n_d - 1) / (n_f - n_c) == pytest.approx(30)
    assert n_d == pytest.approx(start.refractive_index)


def test_receptors_are_as_many_as_the_genes_say_and_peak_where_they_say():
    config = assemble("foraging", assignments=["eye.receptors=genes", "genome.spectral.open=true"])
    genotype = Genotype(config.genome)
    start = develop(genotype.start, config)
    assert start.lambda_max_nm == (600, 520, 460)
    genome = genotype.start
    places = {gene.name: place for place, gene in enumerate(genotype.open_genes)}
    genome[places["receptor_types"]] = 0.99
    genome[places["lambda_max_3_nm"]] = 0.1
    animal = develop(genome, config)
    assert animal.lambda_max_nm == pytest.approx((600, 520, 460, 330 + 0.1 * 320))
    assert Phenotype.from_json(animal.to_json()) == animal
    eye = animal.eyes(config.eye).eye()
    assert eye.channels == 4
    weights = replace(eye, bands=64).spectral_bands.weights
    wavelengths = 1e9 * replace(eye, bands=64).spectral_bands.wavelengths
    # The quantum catch of each type peaks near its pigment's peak, up to the 64 bands' 7 nm and daylight's slope.
    for peak, caught in zip(animal.lambda_max_nm, weights, strict=True):
        assert abs(wavelengths[np.argmax(caught)] - peak) < 25, peak


def test_receptors_that_are_not_inherited_are_the_runs():
    """The spectral genes then have no effect: the animal stays the same."""
    config = assemble("foraging", assignments=["eye.receptors=honeybee", "genome.lambda_max_0_nm.start=400"])
    animal = develop(Genotype(config.genome).start, config)
    assert animal.lambda_max_nm is None
    assert animal == develop(Genotype(assemble("foraging").genome).start, assemble("foraging"))
    assert [kind.peak_nm for kind in animal.eyes(config.eye).receptors.types] == [544, 436, 344]
