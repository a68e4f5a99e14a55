"""Runs for tests that only read them, and the command line as a function."""

import pytest

from evolve.analysis.recorder import record
from evolve.cli.main import main
from evolve.search.local_executor import LocalExecutor
from evolve.search.loop import evolve as carry_on
from evolve.store.directory import Run
from tests.evolve.closed_form import bowl, tiny
from tests.evolve.small_run import small_run


@pytest.fixture(scope="session")
def run(tmp_path_factory):
    """One candidate, hardly trained, with everything real."""
    return small_run(tmp_path_factory.mktemp("played") / "run")


@pytest.fixture(scope="session")
def episode(run):
    """An episode with seed 3."""
    return record(run, seed=3, radiance_every=64)


class Silent:
    """Watches and says nothing."""

    def training(self, candidate_id, steps, planned):
        """Nothing."""

    def evaluated(self, candidate):
        """Nothing."""


@pytest.fixture(scope="session")
def finished(tmp_path_factory):
    """A finished run of closed-form fitness."""
    run = Run.create(tmp_path_factory.mktemp("finished") / "run", tiny())
    with LocalExecutor(bowl, 1) as executor:
        carry_on(run, executor, Silent())
    return run.path


@pytest.fixture
def call(capsys):
    """Runs a command; returns exit code, what it printed, and its complaint."""

    def command(*arguments):
        try:
            code = main([str(argument) for argument in arguments])
        except SystemExit as stop:
            code = stop.code
        return code, *capsys.readouterr()

    return command
