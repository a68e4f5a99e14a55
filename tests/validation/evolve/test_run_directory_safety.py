"""The table of guarantees: enough trials, no failure, and a message for every broken guarantee."""

from dataclasses import replace
from pathlib import Path

from validation.evolve import run_directory_safety
from validation.evolve.hostile import PROMISES

PAGE = Path(__file__).resolve().parents[3] / "docs" / "validation" / "run_directory_safety.md"


def test_the_stored_trials_hold_and_are_on_the_page():
    rows = run_directory_safety.stored()
    assert {row.promise for row in rows} == {promise.text for promise in PROMISES} | set(run_directory_safety.KILLS)
    assert run_directory_safety.broken(rows) == []
    assert run_directory_safety.table(rows) in PAGE.read_text()


def test_a_failure_or_too_few_trials_are_told():
    rows = run_directory_safety.stored()
    assert len(run_directory_safety.broken([replace(rows[0], failures=1), *rows[1:]])) == 1
    assert "must be at least 2000" in run_directory_safety.broken(rows[:1])[0]
