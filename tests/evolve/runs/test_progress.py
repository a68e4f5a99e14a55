"""Progress: its counts, and its form in a terminal and a log."""

import io
import json
import os
import pty
from dataclasses import replace

import pytest

from evolve.config.numbering import Place
from evolve.genome.genotype import Genotype
from evolve.genome.phenotype import develop
from evolve.runs import progress
from evolve.runs.progress import Bar, Events, Lines, Tally, watcher
from evolve.store.candidate import Candidate
from evolve.store.directory import Run
from evolve.store.evaluation import Evaluation
from tests.evolve.closed_form import tiny

CONFIG = tiny("search.generations=2")  # 2 x 4 candidates
GENOME = Genotype(CONFIG.genome).start


class Clock:
    now = 0.0

    def monotonic(self):
        return self.now


@pytest.fixture
def clock(monkeypatch):
    clock = Clock()
    monkeypatch.setattr(progress, "time", clock)
    return clock


@pytest.fixture
def run(tmp_path):
    return Run.create(tmp_path / "run", CONFIG)


def add(run, identity, fitness, steps=1000, failure=None):
    outcome = Evaluation(fitness, (fitness,), steps=steps, failure=failure)
    run.append(
        Candidate.from_evaluation(
            Place.from_id(identity, 4), tuple(GENOME.tolist()), develop(GENOME, CONFIG), 1, outcome
        )
    )
    return run.candidates[-1]


def test_events_count_every_budget_stage(tmp_path):
    run = Run.create(tmp_path / "halving", tiny("search.generations=1", "search.rungs=2", "learning.total_steps=8192"))
    out = io.StringIO()
    events = Events(run, out, 1)
    for identity in range(4):
        events.evaluated(add(run, identity, float(identity)))
    run.append(replace(run.candidates[3], rung=1))
    events.evaluated(run.candidates[3])
    told = [json.loads(line) for line in out.getvalue().splitlines()]
    counts = [(event["rung"], event["evaluated"], event["planned"]) for event in told]
    assert counts == [(0, 1, 6), (0, 2, 6), (0, 3, 6), (0, 4, 6), (1, 5, 6)]


def test_pace_and_time_left_count_what_is_in_training(run, clock):
    tally = Tally(run)
    assert tally.seconds_left is None
    tally.training(0, 250, 1000)
    tally.training(1, 750, 1000)
    clock.now = 10.0
    # One eighth of the run is done in 10 s.
    assert tally.done == pytest.approx(1.0)
    assert tally.seconds_left == pytest.approx(70.0)
    assert tally.steps_per_second == pytest.approx(100.0)
    tally.evaluated(add(run, 1, 5.0))
    assert tally.steps_per_second == pytest.approx(125.0)


def test_continued_run_is_timed_from_where_it_goes_on(run, clock):
    for identity in range(4):
        add(run, identity, 1.0)
    tally = Tally(run)
    tally.training(4, 1000, 1000)
    clock.now = 10.0
    assert tally.seconds_left == pytest.approx(30.0), "three remain at 10 s each; candidates on record took no time"
    assert tally.steps_per_second == pytest.approx(100.0)


def test_summary_names_generation_best_median_pace_and_time_left(run, clock):
    tally = Tally(run)
    for identity, fitness in enumerate((1.0, 9.0, 4.0, 2.0)):
        tally.evaluated(add(run, identity, fitness))
    tally.evaluated(add(run, 4, 6.0))
    tally.evaluated(add(run, 5, 0.0, failure="it broke"))
    tally.evaluated(add(run, 6, 3.0))
    clock.now = 3600.0
    assert tally.summary() == "generation 1 (last: 1), best 9, median 4.5, 2 steps/s, 8:34 left"


def test_log_gets_one_line_per_candidate_and_no_control_characters(run):
    out = io.StringIO()
    with watcher(run, out) as lines:
        assert isinstance(lines, Lines)
        lines.training(0, 1, 2)
        lines.evaluated(add(run, 0, 1.5))
        lines.evaluated(add(run, 1, 0.0, failure="no luck"))
    first, second = out.getvalue().splitlines()
    assert first.startswith("candidate 0 (1/8): fitness 1.5; generation 0 (last: 1), best 1.5")
    assert second.startswith("candidate 1 (2/8): failed (no luck)")
    assert "\x1b" not in out.getvalue()


def test_terminal_gets_a_bar(run):
    ours, theirs = pty.openpty()
    with os.fdopen(theirs, "w") as terminal, watcher(run, terminal) as bar:
        assert isinstance(bar, Bar)
        bar.training(0, 1, 2)
        bar.evaluated(add(run, 0, 1.5))
        bar.evaluated(add(run, 1, 0.0, failure="[no] luck"))
    shown = _all_of(ours)
    assert "candidate 1 failed: [no] luck" in shown
    assert "generation 0 (last: 1)" in shown
    assert "25%" in shown


def _all_of(terminal):
    """Return the output to a terminal whose other side is closed. Linux reports this by an error, and other systems by
    an empty read.
    """
    written = b""
    try:
        while part := os.read(terminal, 4096):
            written += part
    except OSError:
        pass
    os.close(terminal)
    return written.decode()


def test_utilisation_is_the_workers_time_spent_on_what_is_done(run, clock):
    tally = Tally(run, 2)
    done = replace(add(run, 1, 5.0), seconds=3.0)
    tally.evaluated(done)
    clock.now = 4.0
    assert tally.utilisation == pytest.approx(3.0 / (2 * 4.0))
