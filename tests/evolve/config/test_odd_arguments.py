"""Settings of the wrong type or value from Python: a run's configuration, or a one-line error. See the test of the same
name in optics.
"""

from dataclasses import fields

import numpy as np
import pytest

import evolve
from evolve.config.settings import SECTIONS
from tests.odd_arguments import complaints


@pytest.mark.parametrize("section", SECTIONS)
def test_any_setting(section):
    kind = SECTIONS[section]
    valid = {one.name: getattr(kind(), one.name) for one in fields(kind)}
    assert complaints(lambda **asked: evolve.RunConfig("detection", **{section: kind(**asked)}), valid) == {}


def test_sections_themselves():
    valid = {"task": "detection", "seed": 0, "workers": 0} | {name: kind() for name, kind in SECTIONS.items()}
    assert complaints(evolve.RunConfig, valid) == {}


def test_a_run_that_cannot_begin(tmp_path):
    """All other settings are also refused, so that no run starts."""
    valid = {"preset": "quick", "settings": {}, "config": None, "scale": None, "start_from": None}

    def begun(**asked):
        with pytest.raises(evolve.ConfigError) as refused:
            evolve.run("no task", out=tmp_path / "run", **asked)
        raise refused.value

    with pytest.raises(evolve.ConfigError, match="unknown task 'no task'"):
        begun(**valid)
    assert complaints(lambda **asked: _quietly(begun, asked, "unknown task"), valid) == {}


def _quietly(call, asked, usual):
    try:
        call(**asked)
    except evolve.ConfigError as error:
        if usual not in str(error):
            raise


@pytest.mark.parametrize("value", [np.arange(3), object(), 1j, None, [1, 2]])
def test_values_of_settings(value, tmp_path):
    with pytest.raises(evolve.ConfigError, match=r"search.generations = |settings contain "):
        evolve.run("detection", "quick", {"search.generations": value}, out=tmp_path / "run")


def test_numpys_numbers_are_pythons():
    learning = evolve.LearningConfig(total_steps=np.int64(8192), gamma=np.float64(0.5))
    config = evolve.RunConfig("detection", seed=np.int64(3), learning=learning)
    assert (config.seed, config.learning.total_steps) == (3, 8192)
    assert {type(one) for one in (config.seed, config.learning.total_steps)} == {int}
    assert type(config.learning.gamma) is float
