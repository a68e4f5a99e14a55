"""Runs for tests that only read them, and the command line as a function."""

import pytest

from evolve.cli.main import main
from evolve.episodes.recorder import record
from evolve.search.local_executor import LocalExecutor
from evolve.search.loop import evolve as carry_on
from evolve.store.directory import Run
from tests.evolve.closed_form import bowl, tiny
from tests.evolve.small_run import small_run


@pytest.fixture(scope="session")
def run(tmp_path_factory):
    """Return a run of one candidate with minimal real training."""
    return small_run(tmp_path_factory.mktemp("played") / "run")


@pytest.fixture(scope="session")
def episode(run):
    """Return an episode with seed 3."""
    return record(run, seed=3, radiance_every=64)


class Silent:
    """A watcher that prints nothing."""

    def training(self, candidate_id, steps, planned):
        """Do nothing."""

    def evaluated(self, candidate):
        """Do nothing."""


@pytest.fixture(scope="session")
def finished(tmp_path_factory):
    """Return a finished run with a fitness in closed form."""
    run = Run.create(tmp_path_factory.mktemp("finished") / "run", tiny())
    with LocalExecutor(bowl, 1) as executor:
        carry_on(run, executor, Silent())
    return run.path


@pytest.fixture
def call(capsys):
    """Return a function that runs a command and returns its exit code, stdout and stderr."""

    def command(*arguments):
        try:
            code = main([str(argument) for argument in arguments])
        except SystemExit as stop:
            code = stop.code
        return code, *capsys.readouterr()

    return command
