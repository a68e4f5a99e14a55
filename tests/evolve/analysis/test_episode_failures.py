"""Failures of episodes during training, added up over a run and reported in the summary, by `evolve status`, and on the
page.
"""

import json
from collections import Counter
from dataclasses import replace

import pytest

from evolve.analysis.episode_failures import EpisodeFailure, episode_failure_lines, episode_failures_of
from evolve.cli.commands.run import _outcome
from evolve.report.page import candidates_section
from evolve.store.candidate import Candidate
from evolve.store.directory import Run
from evolve.store.evaluation import KINDS, LONGEST, OTHERS, most_frequent
from tests.evolve.report.reported import HOSTILE, Page
from tests.evolve.store.records import CONFIG, candidate

REWARDS, FEELS = "rewards, line 9 of mine.py: KeyError: 'ball'", HOSTILE


@pytest.fixture
def run(tmp_path):
    run = Run.create(tmp_path / "run", CONFIG)
    run.append(replace(candidate(0), episode_failures=((FEELS, 30), (REWARDS, 2))))
    run.append(candidate(1))
    run.append(replace(candidate(2), episode_failures=((REWARDS, 40),)))
    return run


def test_they_are_added_up_over_candidates(run):
    assert episode_failures_of(run.candidates) == [EpisodeFailure(REWARDS, 42, 2), EpisodeFailure(FEELS, 30, 1)]
    told = f"failed episodes: 72; most frequent failure (42 episodes of 2 candidates): {REWARDS}"
    assert episode_failure_lines(episode_failures_of(run.candidates)) == [told]
    assert told in _outcome(run, run.best, [])
    assert episode_failure_lines(episode_failures_of(run.candidates[1:2])) == []
    assert not any("failed" in line for line in _outcome(Run.create(run.path / "none", CONFIG), run.best, []))


def test_the_page_lists_them_as_text(run):
    page = Page(candidates_section(run).markup)
    assert page.rows["mishaps"][1:] == [[REWARDS, "42", "2"], [FEELS, "30", "1"]]
    assert "script" not in page.tags
    assert "mishaps" not in Page(candidates_section(Run.create(run.path / "none", CONFIG)).markup).rows


def test_the_record_holds_them_and_nothing_where_there_are_none(run):
    lines = (run.path / "candidates.jsonl").read_text().splitlines()
    assert ["mishaps" in json.loads(line) for line in lines] == [True, False, True]
    assert Run.open(run.path).candidates == run.candidates


@pytest.mark.parametrize("damage", [[["it", 0]], [["it"]], [[None, 2]], [["it", 1.5]], "it"])
def test_damage_is_refused(run, damage):
    record = json.loads(run.candidates[0].to_line()) | {"mishaps": damage}
    with pytest.raises(ValueError, match="mishaps"):
        Candidate.from_line(json.dumps(record))


def test_a_record_has_room_for_the_most_frequent():
    """A message that contains a number is different each time, so the record keeps only the most frequent ones."""
    many = Counter({f"x = {k}": 1 for k in range(20)}) + Counter({"often\n  told": 7, "often told": 1})
    told = most_frequent(many)
    assert told[0] == ("often told", 8)
    assert told[-1] == (OTHERS, 20 - (KINDS - 1))
    assert sum(episodes for _, episodes in told) == 28
    assert len(most_frequent(Counter({"x" * 1000: 2}))[0][0]) == LONGEST
    assert most_frequent(Counter("baba")) == (("a", 2), ("b", 2))
