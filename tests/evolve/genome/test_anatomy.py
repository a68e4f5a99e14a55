"""Eyes and receptors never overlap in any animal, and the changes that this needed are counted."""

import math
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evolve.config.assemble import assemble
from evolve.config.run_config import ConfigError
from evolve.genome.anatomy import fitted
from evolve.genome.genotype import Genotype
from evolve.genome.phenotype import develop, repaired
from tests.slow_part import sweep

CROWDED = assemble(
    "detection",
    assignments=["eye.head_radius=0.4e-3", "eye.receptor_width=25e-6", "genome.placement_range_deg.high=150"],
)
GENOTYPE = Genotype(CROWDED.genome)


def gaps(animal, config):
    """Return the arc between neighbouring eyes and the pitch of receptors, each relative to its minimum."""
    between = math.radians(animal.placement_range_deg) * config.eye.head_radius / max(animal.n_eyes - 1, 1)
    pitch = config.eye.sensor_width / animal.resolution[1]
    return between / config.eye.sensor_width, pitch / config.eye.receptor_width


def genome(**values):
    """Return the start genome with some genes changed."""
    vector = GENOTYPE.start
    for place, gene in enumerate(GENOTYPE.open_genes):
        if gene.name in values:
            vector[place] = gene.encode(values[gene.name], CROWDED.genome[gene.name])
    return vector


@sweep(300, fast=20)
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
    """Three eyes of 0.2 mm on a radius of 0.4 mm need two arcs of half a radian."""
    vector = genome(n_eyes=3, placement_range_deg=10)
    animal = develop(vector, CROWDED)
    assert repaired(vector, CROWDED) == ("placement_range_deg",)
    assert animal.n_eyes == 3
    assert animal.placement_range_deg == pytest.approx(math.degrees(1.0))


def test_too_many_eyes_are_fewer_on_the_widest_arc():
    """An arc of 150° on a radius of 0.4 mm is 1.047 mm long. It contains five gaps of 0.2 mm, and thus six eyes."""
    vector = genome(n_eyes=16, placement_range_deg=60)
    animal = develop(vector, CROWDED)
    assert (animal.n_eyes, animal.placement_range_deg) == (6, 150)
    assert repaired(vector, CROWDED) == ("n_eyes", "placement_range_deg")


# --- receptors of equal width


def pitched(*settings):
    """Return a configuration with space for 30 receptors within 180°, in adjacent eyes."""
    sizes = ("eye.square=true", f"eye.receptor_pitch={math.pi / 30 * 0.2e-3}", "eye.head_radius=0.2e-3")
    high = ("genome.n_eyes.high=24", "genome.resolution.high=24")
    return assemble("detection", assignments=[*sizes, *high, *settings])


def alike(asked, fit):
    """Return the squared distance between two pairs (eyes, receptors), in logarithms of their ratios."""
    return math.log((asked[0] - 0.5) / (fit[0] - 0.5)) ** 2 + math.log(asked[1] / fit[1]) ** 2


@sweep(300, fast=20)
@given(st.integers(3, 24), st.integers(2, 24), st.floats(0, 180), st.sampled_from([60.0, 140.0, 180.0]), st.booleans())
def test_wide_eyes_give_way_as_little_as_will_do(eyes, receptors, range_deg, widest, bounded):
    """The repair is compared with all pairs that fit, from the lowest up."""
    low_eyes, low_receptors = (3, 2) if bounded else (1, 1)
    bounds = [f"genome.n_eyes.{key}={low_eyes}" for key in ("low", "start")]
    bounds += [f"genome.resolution.{key}={low_receptors}" for key in ("low", "start")]
    config = pitched(f"genome.placement_range_deg.high={widest}", "genome.placement_range_deg.start=50", *bounds)
    asked = {"n_eyes": eyes, "resolution": receptors, "placement_range_deg": min(range_deg, widest)}
    fits = fitted({**asked}, config.genome, config.eye)
    room = widest / 6
    pair = fits["n_eyes"], fits["resolution"]
    pairs = product(range(low_eyes, eyes + 1), range(low_receptors, receptors + 1))
    possible = [(n, w) for n, w in pairs if (n - 1) * w <= room + 1e-6]
    assert pair in possible
    assert alike((eyes, receptors), pair) == pytest.approx(min(alike((eyes, receptors), p) for p in possible))
    needed = (pair[0] - 1) * pair[1] * 6
    assert max(needed, asked["placement_range_deg"]) - 1e-6 <= fits["placement_range_deg"] <= widest
    if pair == (eyes, receptors):
        assert fits["placement_range_deg"] == pytest.approx(max(needed, asked["placement_range_deg"]))


def test_repair_prefers_neither_eyes_nor_receptors():
    """The mean of ln(width / eyes) stays at its requested value over all ranges. If only eyes were reduced, it would
    rise by 1.4; if only receptors were, it would fall by 1.8. If the repair computed ratios from the number of eyes, or
    from the number of gaps between them, the mean would change by 0.15 or -0.09.
    """
    config, random = pitched(), np.random.default_rng(0)
    moved = []
    for eyes, receptors in random.integers(1, 25, (1000, 2)):
        values = {"n_eyes": float(eyes), "resolution": float(receptors), "placement_range_deg": 180.0}
        fits = fitted(values, config.genome, config.eye)
        moved += [math.log(fits["resolution"] / fits["n_eyes"] * eyes / receptors)] if fits != values else []
    assert len(moved) > 300
    assert abs(np.mean(moved)) < 0.06  # the measured value is 0.03, with a standard error of 0.008


def test_a_gene_that_is_held_does_not_give_way():
    held = {"n_eyes": "resolution", "resolution": "n_eyes"}
    for name, other in held.items():
        config = pitched(f"genome.{name}.open=false", f"genome.{name}.start=6")
        values = {name: 6.0, other: 24.0, "placement_range_deg": 90.0}
        fits = fitted(values, config.genome, config.eye)
        assert fits == {name: 6.0, other: 6.0, "placement_range_deg": 180.0}  # 5 x 6 = 30


def test_eyes_of_more_receptors_are_wider_and_so_are_their_pupils():
    config = pitched("genome.relative_aperture.start=0.3", "genome.resolution.start=7")
    animal = develop(Genotype(config.genome).start, config)
    eyes = animal.eyes(config.eye)
    assert eyes.sensor_width == pytest.approx(7 * config.eye.receptor_pitch)
    assert eyes.optics.aperture_radius == pytest.approx(0.15 * 7 * config.eye.receptor_pitch)


@pytest.mark.parametrize(
    ("settings_", "message"),
    [
        (("eye.receptor_pitch=2e-6", "eye.receptor_width=3e-6"),
         r"eye\.receptor_pitch = 2e-06: must be 0 or at least eye\.receptor_width = 3e-06"),
        (("eye.receptor_pitch=1e-4", "genome.n_eyes.low=9", "genome.n_eyes.start=9", "genome.resolution_width.low=4",
          "genome.resolution_width.start=4"), r"9 eyes of 0\.0004 m \(4 receptors of eye\.receptor_pitch\)"),
        (("eye.receptor_pitch=1e-5", "eye.sensor_width=3e-4"), r"eye\.receptor_pitch = 1e-05 already determines"),
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


def test_receptors_of_no_width_are_not_taken_away_to_make_room():
    """The width of these eyes does not depend on their receptors. Only fewer eyes give more space."""
    config = assemble("detection", assignments=["eye.head_radius=0.4e-3", "genome.placement_range_deg.high=150"])
    assert config.eye.receptor_pitch == 0
    genotype = Genotype(config.genome)
    values = genotype.decode(np.ones(genotype.dimension))
    fits = fitted(values, config.genome, config.eye)
    assert fits["n_eyes"] < values["n_eyes"]
    assert fits["resolution_width"] == values["resolution_width"]
