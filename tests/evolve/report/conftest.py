"""One run, one episode of its best animal and one page of both, for all tests of the report."""

import pytest

from evolve.episodes.recorder import record
from evolve.report.page import render
from tests.evolve.report.reported import Page, make_run


@pytest.fixture(scope="package")
def run(tmp_path_factory):
    return make_run(tmp_path_factory.mktemp("report") / "first")


@pytest.fixture(scope="package")
def episode(run):
    return record(run, radiance_every=64)


@pytest.fixture(scope="package")
def rendered(run, episode):
    """Return the page, and the progress that was reported."""
    told = []
    return render(run, episode, lambda what, share: told.append((what, share))).decode(), told


@pytest.fixture(scope="package")
def content(rendered):
    return rendered[0]


@pytest.fixture(scope="package")
def page(content):
    return Page(content)
