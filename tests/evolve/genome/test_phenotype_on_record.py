"""Phenotypes from files: all animals that evolution can produce are read back, and all others are refused."""

import json
from dataclasses import fields

import numpy as np
import pytest

from evolve.genome.genes import ALL_GENES, FACETS, TIME_CONSTANT
from evolve.genome.genotype import Genotype
from evolve.genome.interval import Interval
from evolve.genome.phenotype import Phenotype, develop
from evolve.genome.plain_values import listed, parsed, real, whole_number
from tests.evolve.closed_form import tiny

NAMES = [f.name for f in fields(Phenotype)]


@pytest.mark.parametrize(
    "settings",
    [(), ("eye.optics=false", "genome.optical.open=false"), ("eye.relief_points=9",), ("eye.receptors=genes",)],
    ids=str,
)
def test_every_animal_that_evolution_can_make_reads_back(settings):
    """The animals include the ends of all ranges, where rounding may put a value just outside."""
    config = tiny(*settings)
    dimension = Genotype(config.genome).dimension
    random = np.random.default_rng(0)
    corners = random.integers(0, 2, (50, dimension)).astype(float)
    for genome in (*random.random((50, dimension)), *corners):
        animal = develop(genome, config)
        assert Phenotype.from_json(json.loads(json.dumps(animal.to_json()))) == animal


@pytest.mark.parametrize("name", ["n_eyes", "fov_deg", "memory_frames", "neurons", "layers", "relative_aperture"])
def test_ends_of_a_genes_range_are_the_last_values_allowed(name):
    animal = develop(Genotype(tiny().genome).start, tiny()).to_json()
    valid = ALL_GENES[name].range
    step = 1 if ALL_GENES[name].kind == "integer" else 1e-6 * (valid.high - valid.low)
    kind = int if step == 1 else float
    for end, beyond in ((valid.low, -step), (valid.high, step)):
        assert getattr(Phenotype.from_json({**animal, name: kind(end)}), name) == end
        with pytest.raises(ValueError, match=rf"phenotype\.{name} = .*: must be a"):
            Phenotype.from_json({**animal, name: kind(end + beyond)})


def test_values_are_of_their_type_and_quoted_in_short():
    for wrong in (True, 1.0, "1", None, [1]):
        with pytest.raises(ValueError, match=r"count = .*: must be a whole number from 0 to 5"):
            whole_number(wrong, "count", 0, 5)
    for wrong in (True, "1", None, float("nan"), float("inf"), 10**400):
        with pytest.raises(ValueError, match=r"share = .*: must be a number in \[0, 1\]"):
            real(wrong, "share", Interval(0, 1))
    assert real(1 + 1e-12, "share", Interval(0, 1)) == 1 + 1e-12, "rounding"
    with pytest.raises(ValueError, match=r"^count = '9{39}\.\.\.: must be") as long:
        whole_number("9" * 10_000, "count", 0, 5)
    assert len(str(long.value)) < 120
    for wrong, reason in (({}, "must be a list"), ([], "has 0 entries"), ([1] * 4, "has 4 entries")):
        with pytest.raises(ValueError, match=reason):
            listed(wrong, "values", 1, 3)


def test_json_is_what_its_standard_says():
    assert parsed('{"a": [1, 2.5, null]}') == {"a": [1, 2.5, None]}
    for text in ("NaN", "[Infinity]", "[-Infinity]", "[" * 100_000 + "]" * 100_000, "1" * 6000, "{", ""):
        with pytest.raises(ValueError, match=r"."):
            parsed(text)


def test_missing_and_unknown_fields_are_named():
    animal = develop(Genotype(tiny().genome).start, tiny()).to_json()
    with pytest.raises(ValueError, match=r"phenotype\.wings: unknown"):
        Phenotype.from_json({**animal, "wings": 2})
    with pytest.raises(TypeError, match="n_eyes"):
        Phenotype.from_json({name: value for name, value in animal.items() if name != "n_eyes"})
    # Records of animals without memory in their receptors, and with camera eyes, are as before these genes existed.
    assert set(animal) == set(NAMES) - {TIME_CONSTANT, *FACETS}
