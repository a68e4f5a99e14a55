"""An empty run for tests that write to it."""

import pytest

from evolve.store.directory import Run
from tests.evolve.store.records import CONFIG


@pytest.fixture
def run(tmp_path):
    return Run.create(tmp_path / "run", CONFIG)
