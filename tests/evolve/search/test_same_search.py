"""A search on another processor may differ in the last digits, but a different search is refused."""

import shutil

import pytest

from evolve.config.numbering import Place
from evolve.search.loop import evolve
from evolve.search.same_search import ROUNDING, TAKEN_FOR_ANOTHERS, SameSearch
from evolve.search.search import Proposal
from evolve.store.directory import Run, RunError


@pytest.fixture(scope="module")
def run(finished):
    return Run.open(finished)


def off(candidate, by):
    """Return a proposal that differs from the record by `by` in one coordinate."""
    genome = (candidate.genome[0] + by, *candidate.genome[1:])
    return Proposal(Place(candidate.id, candidate.generation, candidate.index), genome, candidate.parents)


def accepted(run, candidate, by):
    try:
        SameSearch(run).require(off(candidate, by), candidate)
    except RunError:
        return False
    return True


def test_rounding_is_no_other_search(run):
    first, later = run.generation(0)[0], run.generation(1)[0]
    for by, in_first, in_later in (
        (0.0, True, True),
        (ROUNDING / 2, True, True),
        (ROUNDING * 2, False, True),
        (TAKEN_FOR_ANOTHERS / 2, False, True),
        (TAKEN_FOR_ANOTHERS * 2, False, False),
    ):
        assert (accepted(run, first, by), accepted(run, later, by)) == (in_first, in_later), by


def test_other_libraries_must_come_to_the_same(run, monkeypatch):
    monkeypatch.setattr("evolve.search.same_search.recorded", lambda path: {"nevergrad": "0"})
    assert accepted(run, run.generation(1)[0], ROUNDING / 2)
    assert not accepted(run, run.generation(1)[0], TAKEN_FOR_ANOTHERS / 2)


def test_other_budget_stages_than_those_on_record_are_refused_before_anybody_is_trained(finished, tmp_path):
    """The better half of the first generation lacks its second evaluation if there are two rungs."""
    copy = shutil.copytree(finished, tmp_path / "run")
    text = (copy / "config.toml").read_text()
    text = text.replace("rungs = 1", "rungs = 2").replace("total_steps = 4096", "total_steps = 8192")
    (copy / "config.toml").write_text(text)
    with pytest.raises(RunError, match=r"generation 0 lacks evaluations \(candidate \d\), but later ones are on"):
        evolve(Run.open(copy), Nobody(), Nobody())
    assert (copy / "candidates.jsonl").read_bytes() == (finished / "candidates.jsonl").read_bytes()


class Nobody:
    training = None

    def run(self, jobs, progress=None):
        assert not jobs
        return iter(())


def test_what_was_never_proposed_is_refused(run):
    with pytest.raises(RunError, match="differs from the search's proposal here"):
        SameSearch(run).require(None, run.generation(0)[0])
