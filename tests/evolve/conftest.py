"""A small run and an episode of it, for all that reads episodes. (This file also lets tests in folders below import the
helpers that lie beside it.)"""

import pytest
from small_run import small_run

from evolve.episode import record


@pytest.fixture(scope="session")
def run(tmp_path_factory):
    return small_run(tmp_path_factory.mktemp("played") / "run")


@pytest.fixture(scope="session")
def episode(run):
    """An episode with seed 3."""
    return record(run, seed=3, radiance_every=64)
