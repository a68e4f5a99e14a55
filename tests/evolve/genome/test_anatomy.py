"""Nothing overlaps in any animal, and what had to change for that is counted."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evolve.config.assemble import assemble
from evolve.config.run_config import ConfigError
from evolve.genome.genotype import Genotype
from evolve.genome.phenotype import develop, repaired

CROWDED = assemble(
    "detection",
    assignments=["eye.head_radius=0.4e-3", "eye.receptor_width=25e-6", "genome.placement_range_deg.high=150"],
)
GENOTYPE = Genotype(CROWDED.genome)


def gaps(animal, config):
    """Arc between neighbouring eyes, and pitch of receptors, each over what it must be at least."""
    between = math.radians(animal.placement_range_deg) * config.eye.head_radius / max(animal.n_eyes - 1, 1)
    pitch = config.eye.sensor_width / animal.resolution[1]
    return between / config.eye.sensor_width, pitch / config.eye.receptor_width


def genome(**values):
    """The start genome with some genes set."""
    vector = GENOTYPE.start
    for place, gene in enumerate(GENOTYPE.open_genes):
        if gene.name in values:
            vector[place] = gene.encode(values[gene.name], CROWDED.genome[gene.name])
    return vector


@settings(max_examples=300, deadline=None)
@given(st.lists(st.floats(0, 1), min_size=GENOTYPE.dimension, max_size=GENOTYPE.dimension))
def test_no_animal_has_eyes_or_receptors_that_overlap(vector):
    animal = develop(np.array(vector), CROWDED)
    eyes, receptors = gaps(animal, CROWDED)
    assert animal.n_eyes == 1 or eyes >= 1 - 1e-9
    assert receptors >= 1 - 1e-9
    assert animal.placement_range_deg <= 150
    asked = GENOTYPE.decode(np.array(vector))
    changed = set(repaired(np.array(vector), CROWDED))
    assert ("n_eyes" in changed) == (animal.n_eyes != asked["n_eyes"])
    assert ("resolution_width" in changed) == (animal.resolution[1] != asked["resolution_width"])
    assert changed <= {"n_eyes", "placement_range_deg", "resolution_width"}


def test_what_fits_is_left_alone():
    vector = genome(n_eyes=3, placement_range_deg=120, resolution_width=8)
    assert repaired(vector, CROWDED) == ()
    animal = develop(vector, CROWDED)
    assert (animal.n_eyes, animal.resolution[1]) == (3, 8)
    assert animal.placement_range_deg == pytest.approx(120)


def test_eyes_too_close_are_spread_until_they_touch():
    """Three eyes of 0.2 mm on a radius of 0.4 mm: two arcs of half a radian."""
    vector = genome(n_eyes=3, placement_range_deg=10)
    animal = develop(vector, CROWDED)
    assert repaired(vector, CROWDED) == ("placement_range_deg",)
    assert animal.n_eyes == 3
    assert animal.placement_range_deg == pytest.approx(math.degrees(1.0))


def test_too_many_eyes_are_fewer_on_the_widest_arc():
    """150° of 0.4 mm are 1.047 mm: five arcs of 0.2 mm, so six eyes."""
    vector = genome(n_eyes=16, placement_range_deg=60)
    animal = develop(vector, CROWDED)
    assert (animal.n_eyes, animal.placement_range_deg) == (6, 150)
    assert repaired(vector, CROWDED) == ("n_eyes", "placement_range_deg")


@pytest.mark.parametrize(
    ("settings_", "message"),
    [
        (("eye.sensor_width=1e-3", "genome.n_eyes.start=8", "genome.n_eyes.open=false"), "8 eyes of 0.001 m"),
        (("genome.n_eyes.low=2", "genome.n_eyes.start=2", "genome.placement_range_deg.open=false",
          "genome.placement_range_deg.start=5"), "2 eyes of 0.0002 m"),
        (("eye.receptor_width=1e-4", "genome.resolution_width.low=3", "genome.resolution_width.start=3"),
         "3 receptors of at least 0.0001 m"),
    ],
)  # fmt: skip
def test_animals_that_never_fit_are_refused_before_work_starts(settings_, message):
    with pytest.raises(ConfigError, match=message) as caught:
        assemble("detection", assignments=settings_)
    assert "--set" in str(caught.value)
