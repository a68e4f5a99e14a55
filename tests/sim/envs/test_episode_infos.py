"""Infos of ended episodes, for worlds whose episodes have different lengths."""

from types import SimpleNamespace

import numpy as np
import pytest

from sim.envs.vec_env import EyesVecEnv


@pytest.mark.parametrize("learners", [1, 2])
def test_the_length_of_an_episode_is_that_of_its_world(learners):
    """Rows are ordered by learner and then by world."""
    lengths = np.array([3, 7, 12])
    rows = learners * len(lengths)
    step = SimpleNamespace(
        reward=np.arange(rows) / 10,
        info=None,
        terms=SimpleNamespace(rows=[{}] * rows),
        success=np.zeros(rows, bool),
        done=np.arange(rows) != 1,
        truncated=np.arange(rows) % 2 == 0,
        given_up=np.zeros(rows, bool),
        failure={},
    )
    env = SimpleNamespace(
        _returns=np.ones(rows),
        num_envs=rows,
        _everyone=np.arange(len(lengths)),
        simulation=SimpleNamespace(varied={}, steps=lengths),
    )
    infos = EyesVecEnv._infos(env, step)
    assert "episode" not in infos[1]
    for row in np.flatnonzero(step.done).tolist():
        assert infos[row]["episode"] == {"r": 1 + row / 10, "l": lengths[row % len(lengths)]}
        assert infos[row]["TimeLimit.truncated"] == (row % 2 == 0)
