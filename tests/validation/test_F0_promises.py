"""The table of promises: enough trials, no failure, and what is broken is told."""

from dataclasses import replace
from pathlib import Path

from validation import F0_promises
from validation.hostile import PROMISES

PAGE = Path(__file__).resolve().parents[2] / "docs" / "validation" / "F0.md"


def test_the_stored_trials_hold_and_are_on_the_page():
    rows = F0_promises.stored()
    assert {row.promise for row in rows} == {promise.text for promise in PROMISES} | set(F0_promises.KILLS)
    assert F0_promises.broken(rows) == []
    assert F0_promises.table(rows) in PAGE.read_text()


def test_a_failure_or_too_few_trials_are_told():
    rows = F0_promises.stored()
    assert len(F0_promises.broken([replace(rows[0], failures=1), *rows[1:]])) == 1
    assert "must be at least 2000" in F0_promises.broken(rows[:1])[0]
