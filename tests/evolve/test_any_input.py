"""Public functions of `evolve` return an animal that can be built for any input, or raise a one-line error.

EVOLVE_EXAMPLES=20 python -m pytest --all tests/evolve/test_any_input.py     tries twenty times the default number of
inputs
"""

import json
import math
import os

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from evolve.config.assemble import assemble, from_text, to_toml
from evolve.config.checks import ConfigError
from evolve.genome.genes import GENES
from evolve.genome.genotype import Genotype
from evolve.genome.phenotype import Phenotype, develop
from evolve.store.candidate import Candidate
from tests.evolve.store.records import CONFIG, candidate
from tests.slow_part import sweep

JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=4),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=4), inner, max_size=2),
    max_leaves=4,
)
VALUES = ["true", "nan", "-inf", "1e400", "-1", "0", "3", "0.5", "9" * 40, '"CMA"', "[]", "{}", "'", "", "10", "0.25"]
KEYS = sorted(
    {f"genome.{name}.{part}" for name in (*GENES, "optical", "doe") for part in ("open", "low", "high", "start")}
    | {line.split(" = ")[0] for line in to_toml(CONFIG).splitlines() if " = " in line}
    | {f"search.{name}" for name in ("population", "generations", "sigma", "rungs", "promoted", "steady_state")}
    | {f"learning.{name}" for name in ("total_steps", "n_envs", "n_steps", "batch_size", "gamma", "learning_rate")}
    | {f"eye.{name}" for name in ("optics", "bands", "relief_points", "noise_sigma", "receptor_width", "square")}
)


def examples(count):
    return sweep(count * int(os.environ.get("EVOLVE_EXAMPLES", "1")))


def one_line(error):
    assert str(error)
    assert "\n" not in str(error)


def sound(phenotype, config):
    """Assert that the animal's eyes can be built, and that its record is read back unchanged."""
    eyes = phenotype.eyes(config.eye)
    assert np.isfinite(eyes.azimuths()).all()
    assert Phenotype.from_json(json.loads(json.dumps(phenotype.to_json()))) == phenotype


@examples(60)
@given(st.lists(st.tuples(st.sampled_from(KEYS), st.sampled_from(VALUES)), max_size=4), st.integers(0, 2**32))
def test_settings_are_refused_in_a_line_or_have_animals(settings_, seed):
    """Every genome of an accepted config has an animal, and the config is read back unchanged."""
    try:
        config = assemble("detection", "quick", assignments=[f"{key}={value}" for key, value in settings_])
    except ConfigError as error:
        one_line(error)
        return
    assert from_text(to_toml(config)) == config
    dimension = Genotype(config.genome).dimension
    for genome in (np.zeros(dimension), np.ones(dimension), np.random.default_rng(seed).random(dimension)):
        sound(develop(genome, config), config)


@examples(200)
@given(st.sampled_from(sorted(candidate(0).phenotype.to_json())), JSON, st.booleans())
def test_phenotypes_on_record_are_sound_or_refused(name, value, left_out):
    record = candidate(0).phenotype.to_json()
    record[name] = value
    if left_out:
        del record[name]
    try:
        phenotype = Phenotype.from_json(record)
    except (ValueError, TypeError) as error:
        one_line(error)
        if isinstance(error, TypeError) and not left_out:
            raise
        return
    sound(phenotype, CONFIG)


@examples(200)
@given(st.sampled_from(sorted(json.loads(candidate(0).to_line()))), JSON)
def test_lines_of_a_record_are_read_as_they_are_written_or_refused(name, value):
    record = json.loads(candidate(0).to_line())
    record[name] = value
    try:
        read = Candidate.from_line(json.dumps(record))
    except ValueError as error:
        one_line(error)
        return
    assert Candidate.from_line(read.to_line()) == read
    assert math.isfinite(read.fitness) or read.failure


@examples(150)
@given(st.text(max_size=40) | st.binary(max_size=40).map(lambda raw: raw.decode("latin-1")))
def test_any_text_is_no_line_of_a_record(text):
    for damaged in (text, candidate(0).to_line()[: len(text)] + text):
        try:
            Candidate.from_line(damaged)
        except ValueError as error:
            one_line(error)
        else:
            raise AssertionError(f"{damaged!r} was taken for a candidate")
