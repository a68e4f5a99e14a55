"""Starts of a relief that were written for other eyes: the same surface, or a clear error."""

import numpy as np
import pytest

from evolve.config.assemble import assemble
from evolve.config.run_config import ConfigError


def test_relief_may_have_more_points_and_keeps_the_presets_surface():
    import optics
    from evolve.genome.genotype import Genotype
    from evolve.genome.phenotype import develop
    from optics.numerics import backend
    from optics.numerics.precision import precision

    backend.require()

    types = precision("float64")
    x, y = types.Float64([-0.8, 0.1, 0.7]), types.Float64([0.3, -0.9, 0.6])
    heights = {}
    for points, genes in ((4, 3), (5, 6), (9, 15)):  # the preset's relief is symmetric
        config = assemble("detection", "quick", assignments=[f"eye.relief_points={points}"])
        assert sum(name.startswith("doe_") for name in config.genome) == genes
        pupil = develop(Genotype(config.genome).start, config).pupil(config.eye)
        assert isinstance(pupil, optics.Pupil)
        heights[points] = pupil.height.height(x, y).numpy()
    # A spline through a bicubic polynomial equals that polynomial, up to rounding.
    for points in (5, 9):
        assert heights[points] == pytest.approx(heights[4], rel=1e-9)


@pytest.mark.parametrize(("points", "count"), [(4, 3), (5, 6), (6, 6), (9, 15)])
def test_symmetric_reliefs_look_the_same_mirrored_and_turned(points, count):
    from evolve.genome.genotype import Genotype
    from evolve.genome.phenotype import develop

    asked = ["eye.relief_symmetric=true", f"eye.relief_points={points}"]
    config = assemble("detection", assignments=asked)
    genes = [gene.name for gene in Genotype(config.genome).open_genes if gene.name.startswith("doe_")]
    assert len(genes) == count
    animal = develop(np.random.default_rng(0).random(Genotype(config.genome).dimension), config)
    relief = np.reshape(animal.relief, (points, points))
    np.testing.assert_array_equal(relief, relief.T)
    np.testing.assert_array_equal(relief, relief[::-1])
    assert len(set(animal.relief)) == count


def test_symmetric_reliefs_have_no_genes_that_would_be_ignored():
    with pytest.raises(ConfigError, match=r"a symmetric relief has other genes \(doe_00, doe_01, doe_11\)"):
        assemble("detection", assignments=["eye.relief_symmetric=true", "genome.doe_02.start=0.3"])


def test_a_symmetric_animal_begins_a_run_of_symmetric_reliefs():
    """All sixteen heights of an animal are named. If they are equal under the eight symmetries, they give the starts of
    three genes.
    """
    from evolve.config.provenance import Source

    heights = {f"doe_{i}{j}": {"start": 0.2 + 0.1 * min(i, 3 - i) * min(j, 3 - j)} for i in range(4) for j in range(4)}
    eye = {"relief_symmetric": True}
    config = assemble("detection", starts=Source("--from a:1", {"genome": heights, "eye": eye}))
    assert [config.genome[f"doe_{place}"].start for place in ("00", "01", "11")] == pytest.approx([0.2, 0.2, 0.3])
    assert "doe_32" not in config.genome
    heights["doe_32"]["open"] = False
    with pytest.raises(ConfigError, match="doe_32: a symmetric relief has other genes"):
        assemble("detection", starts=Source("--from a:1", {"genome": heights, "eye": eye}))
    heights["doe_32"] = {"start": 0.9}
    with pytest.raises(ConfigError, match="a symmetric relief has other genes"):
        assemble("detection", starts=Source("--from a:1", {"genome": heights, "eye": eye}))


def test_heights_of_more_points_become_no_other_number_of_them():
    from evolve.config.provenance import Source
    from evolve.genome.relief_genes import doe_names

    heights = {name: {"start": 0.3} for name in doe_names(6)}
    with pytest.raises(ConfigError, match="heights of 6 x 6 points cannot be converted; must be 6"):
        assemble(
            "detection",
            assignments=["eye.relief_points=9"],
            starts=Source("--from a:1", {"genome": heights, "eye": {"relief_points": 6}}),
        )
