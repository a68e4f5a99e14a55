"""Every candidate on record reads back equal, whatever its evaluation contains. Nothing unreadable is ever written."""

import collections
import math
import os
import random
from dataclasses import replace

import numpy as np
import pytest

from evolve.config.assemble import assemble, from_text, to_toml
from evolve.config.checks import ConfigError
from evolve.config.numbering import Place
from evolve.search.loop import evolve
from evolve.store.candidate import Candidate
from evolve.store.directory import Run, RunError
from evolve.store.evaluation import Evaluation, most_frequent
from tests.evolve.closed_form import tiny
from tests.evolve.search.kills import Nobody
from tests.evolve.store.records import DIMENSION, candidate

LETTERS = [*"aé\\\"'{}\0\x01\x1b\x7f\x85\n\r\t \u2028\ufeff\uffff😀\ud800\udbff\udc00\udc80\udfff", "null", "NaN"]
NUMBERS = (0.0, -0.0, 5e-324, 1e300, -1e300, 1.0000001e300, -1e305, 1.7e308, math.nan, math.inf, -math.inf, 7)
STEPS = (0, 1, 10**12, 10**12 + 1, 2**63, 10**400, 10**5000, -1, True, 4096.0)
PHENOTYPE = candidate(0).phenotype


class Random:
    """Random evaluations: most of their values are usual, and some are unusual or impossible."""

    def __init__(self, seed, unusual):
        self.chance, self.unusual = random.Random(seed), unusual

    def either(self, usual, unusual):
        return unusual() if self.chance.random() < self.unusual else usual

    def text(self):
        return "".join(self.chance.choice(LETTERS) for _ in range(self.chance.randrange(20)))

    def number(self, usual):
        return self.either(usual, lambda: self.chance.choice(NUMBERS))

    def steps(self, usual):
        return self.either(usual, lambda: self.chance.choice(STEPS))

    def evaluation(self):
        some = range(self.chance.randrange(4))
        failures = tuple((self.text(), self.steps(1 + self.chance.randrange(9))) for _ in some)
        return Evaluation(
            fitness=self.number(self.chance.gauss(0, 10)),
            returns=tuple(self.number(self.chance.gauss(0, 10)) for _ in range(1 + len(some))),
            success_rate=self.number(self.chance.random()),
            steps=self.steps(4096),
            seconds=self.number(self.chance.random()),
            curve=tuple((self.steps(512 * n), self.number(self.chance.gauss(0, 10))) for n in some),
            failure=self.chance.choice((None, None, self.text())),
            episode_failures=self.chance.choice(((), failures)),
        )


def from_evaluation(outcome, number=0):
    return Candidate.from_evaluation(Place.from_id(number, 4), (0.5,) * DIMENSION, PHENOTYPE, 1, outcome)


@pytest.mark.parametrize("unusual", [0.02, 0.3])
def test_random_evaluations_read_back_equal_or_fail_with_a_reason(unusual):
    seed = random.randrange(2**32)
    drawn, seen = Random(seed, unusual), collections.Counter()
    for number in range(1000):
        outcome = drawn.evaluation()
        written = from_evaluation(outcome)
        line = written.to_line()
        assert Candidate.from_line(line) == written, f"seed {seed}, evaluation {number}"
        assert Candidate.from_line(line).to_line() == line
        if written.failure is None:
            assert outcome.failure is None
            assert (written.fitness, written.returns) == (outcome.fitness, outcome.returns)
        elif outcome.failure is None:
            assert written.fitness == -math.inf
            assert written.failure.startswith(("its outcome cannot be recorded: ", "fitness is "))
            assert len(written.failure.splitlines()) == 1
        seen[written.failure is None, outcome.failure is None] += 1
    assert min(seen[False, True], seen[False, False]) > 10
    assert seen[True, False] == 0, "a failed candidate stays failed"


RANGES = {
    "fitness = -1e+305: must be a number in": {"fitness": -1e305},
    "steps = 1000000000001: must be a whole number from 0 to 1,000,000,000,000": {"steps": 10**12 + 1},
    "returns = 1e+301": {"returns": (0.5, 1e301)},
    "returns, success_rate: must be numbers": {"returns": (0.5, math.nan)},
    "success_rate = 1.5": {"success_rate": 1.5},
    "seconds = None": {"seconds": math.inf},
    "curve = -1": {"curve": ((-1, 0.5),)},
    "mishaps = 0": {"episode_failures": (("slipped", 0),)},
    "float32 is not JSON serializable": {"curve": ((1, np.float32(0.5)),)},
}


@pytest.mark.parametrize("reason", RANGES)
def test_a_number_out_of_range_fails_the_candidate_and_says_why(reason, run):
    usual = Evaluation(1.0, (1.0, 2.0), 0.5, 4096, 0.25, ((4096, 1.0),))
    failed = from_evaluation(replace(usual, **RANGES[reason]))
    assert failed.fitness == -math.inf
    assert "its outcome cannot be recorded: " in failed.failure
    assert reason in failed.failure
    assert failed.seconds == (0.0 if reason.startswith(("seconds", "mishaps")) else 0.25)
    run.append(failed)
    assert Run.open(run.path).candidates == (failed,)


def test_what_a_failed_candidate_says_remains(run):
    told = (("it slipped", 9),)
    failed = from_evaluation(Evaluation(-math.inf, steps=-1, seconds=3.0, failure="it broke", episode_failures=told))
    assert (failed.failure, failed.seconds, failed.steps, failed.episode_failures) == ("it broke", 3.0, 0, told)


def test_messages_of_a_user_task_are_escaped(run):
    """Two lone surrogates must not become one letter, and the characters must not be lost."""
    said = most_frequent(collections.Counter({"a\ud83d\ude00\0b": 3}))
    told = (("\ud83d\ude00", 1), *said)
    written = from_evaluation(Evaluation(1.0, (1.0,), failure="\udc80\0", episode_failures=told))
    assert written.failure == "\\udc80\0"
    assert written.episode_failures == (("\\ud83d\\ude00", 1), ("a\\ud83d\\ude00\0b", 3))
    run.append(written)
    assert Run.open(run.path).candidates == (written,)


@pytest.mark.parametrize("change", [{"fitness": -1e305}, {"steps": 10**12 + 1}, {"failure": "\udc80"}, {"seed": -1}])
def test_a_candidate_that_would_read_back_differently_is_not_written(change, run):
    """Candidates that are not made by `from_evaluation` are not checked before."""
    run.append(candidate(0))
    before = (run.path / "candidates.jsonl").read_bytes()
    with pytest.raises(RunError, match=r"candidates\.jsonl: candidate 1 cannot be written: "):
        run.append(replace(candidate(1), **change))
    assert (run.path / "candidates.jsonl").read_bytes() == before


class Drawn:
    """An executor that returns random evaluations."""

    def __init__(self, drawn):
        self.drawn = drawn

    def run(self, jobs, progress=None):
        while jobs:
            yield jobs.popleft(), self.drawn.evaluation()


class Seen(Nobody):
    def __init__(self):
        self.candidates = {}

    def evaluated(self, candidate):
        self.candidates[candidate.id, candidate.rung] = candidate


@pytest.mark.parametrize("kind", [("search.rungs=3", "learning.total_steps=16384"), ("search.steady_state=true",)])
def test_a_run_of_random_evaluations_can_be_opened_and_resumed(kind, tmp_path):
    """Watchers and the search receive the numbers on record, also if sums over rungs are out of range."""
    seen = Seen()
    run = Run.create(tmp_path / "run", tiny("search.population=7", *kind))
    evolve(run, Drawn(Random(random.randrange(2**32), 0.05)), seen)
    again = Run.open(run.path)
    assert again.record.lines == run.record.lines == seen.candidates
    evolve(again, Drawn(None), seen)


@pytest.mark.parametrize("name", [b"t\xff", b"\xf0\x9f\x98"])
def test_a_task_whose_file_name_is_no_text_is_refused_before_a_run_exists(name, tmp_path, monkeypatch):
    """Settings are UTF-8 text, so that the run could not be written."""
    monkeypatch.chdir(tmp_path)
    file = os.fsdecode(name) + ".py"
    (tmp_path / file).write_text("class Mine:\n    pass\n")
    with pytest.raises(ConfigError, match="the name of the file must be UTF-8") as caught:
        assemble(f"{file}:Mine", "quick")
    assert str(caught.value).isprintable()


def test_settings_of_any_task_file_read_back_equal(tmp_path, monkeypatch):
    """Names of files with line ends or backslashes are refused."""
    monkeypatch.chdir(tmp_path)
    drawn = Random(random.randrange(2**32), 0)
    for number in range(20):
        text = drawn.text().translate(dict.fromkeys(map(ord, "\0\\\r\n"))).encode(errors="ignore").decode()
        (tmp_path / f"{number}{text}.py").write_text("class Mine:\n    pass\n")
        config = assemble(f"{number}{text}.py:Mine", "quick")
        assert replace(from_text(to_toml(config)), code=config.code) == config
