"""Square eyes: one gene for height and width, in place of the settings for either."""

import numpy as np
import pytest

from evolve.config.assemble import assemble, from_text, to_toml
from evolve.config.run_config import ConfigError
from evolve.genome.genotype import Genotype
from evolve.genome.phenotype import develop

SQUARE = "eye.square=true"


def test_one_gene_is_both_sides_of_a_square_eye():
    config = assemble("detection", assignments=[SQUARE])
    genes = [gene.name for gene in Genotype(config.genome).open_genes]
    others = [gene.name for gene in Genotype(assemble("detection").genome).open_genes]
    assert genes == ["resolution" if n == "resolution_width" else n for n in others if n != "resolution_height"]
    random = np.random.default_rng(0)
    seen = {develop(random.random(len(genes)), config).resolution for _ in range(300)}
    assert seen == {(n, n) for n in range(1, 17)}
    assert from_text(to_toml(config)) == config


def test_eyes_that_are_not_square_have_the_genes_they_had():
    """Genomes on record keep their meaning."""
    config = assemble("detection")
    assert "resolution" not in config.genome
    animal = develop(Genotype(config.genome).start, config)
    assert animal.resolution == (1, 1)
    assert "[genome.resolution]" not in to_toml(config)


def test_what_was_said_alike_of_both_sides_holds_for_a_square_eye():
    quick = assemble("detection", "quick", assignments=[SQUARE])
    assert develop(Genotype(quick.genome).start, quick).resolution == (8, 8)
    larger = assemble("detection", "quick", assignments=[SQUARE, "genome.resolution.start=12"])
    assert develop(Genotype(larger.genome).start, larger).resolution == (12, 12)
    # this preset freezes the cluster and opens both sides
    grid = assemble(preset="scaling", assignments=[SQUARE]).genome
    assert grid["resolution"].open
    assert not grid["fov_deg"].open


def test_clusters_open_the_genes_that_there_are():
    for settings in ((), (SQUARE,)):
        config = assemble("detection", assignments=[*settings, "genome.morphological.open=false"])
        assert not any("resolution" in gene.name for gene in Genotype(config.genome).open_genes)
        config = assemble("detection", assignments=[*settings, "genome.morphological.open=true"])
        assert sum("resolution" in gene.name for gene in Genotype(config.genome).open_genes) == 2 - len(settings)


@pytest.mark.parametrize(
    ("task", "settings", "named"),
    [
        ("detection", (SQUARE, "genome.resolution_height.open=true"), "square eyes have the gene resolution for both"),
        ("detection", ("genome.resolution.open=true",), "only square eyes have this gene"),
        ("navigation", (SQUARE, "genome.resolution_height.open=true"), "square eyes have the gene resolution for both"),
    ],
)  # fmt: skip
def test_genes_that_such_eyes_have_not_are_refused(task, settings, named):
    with pytest.raises(ConfigError, match=named) as caught:
        assemble(task, assignments=settings)
    assert "\n" not in str(caught.value)
    assert "--set" in str(caught.value)


@pytest.mark.parametrize("task", ["navigation", "maze"])
def test_a_user_may_give_navigators_square_eyes(task):
    """The task fixes the height at one receptor. Square eyes, on a user's request, have a fixed height in degrees at
    any resolution.
    """
    row, square = assemble(task), assemble(task, assignments=[SQUARE])
    assert develop(Genotype(row.genome).start, row).resolution == (1, 1)
    assert not row.genome["resolution_height"].open
    random = np.random.default_rng(0)
    genes = len(Genotype(square.genome).open_genes)
    seen = {develop(random.random(genes), square).resolution for _ in range(300)}
    assert seen == {(n, n) for n in range(1, 17)}
    assert from_text(to_toml(square)) == square
    assert from_text(to_toml(row)) == row


def test_a_preset_for_rows_gives_squares_of_the_same_width():
    square = assemble(preset="bifurcation-navigation", assignments=[SQUARE]).genome["resolution"]
    detection = assemble(preset="bifurcation-detection").genome["resolution"]
    assert square == detection, "the eyes of the two tasks then have the same shape"
    with pytest.raises(ConfigError, match="square eyes have the gene resolution"):
        assemble("navigation", assignments=[SQUARE, "genome.resolution_width.high=8"])
