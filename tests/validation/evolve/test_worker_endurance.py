"""A worker after many candidates: the stored measurement satisfies the bounds, growth is reported, and a short
measurement is repeated."""

from dataclasses import replace
from pathlib import Path

from validation.evolve import worker_endurance

PAGE = Path(__file__).resolve().parents[3] / "docs" / "validation" / "worker_endurance.md"


def test_the_stored_measurement_holds_and_is_on_the_page():
    rows = worker_endurance.stored()
    assert len(rows) >= 300
    assert worker_endurance.broken(rows) == []
    assert worker_endurance.table(rows) in PAGE.read_text()


def test_growth_is_told():
    rows = worker_endurance.stored()
    heavier = [replace(row, memory=row.memory + 10_000_000 * row.candidate) for row in rows]
    leaking = [replace(row, files=row.files + row.candidate // 10) for row in rows]
    assert "memory grew" in worker_endurance.broken(heavier)[0]
    assert "files are open at the end" in worker_endurance.broken(leaking)[0]


def test_a_few_real_candidates_leave_no_file_open():
    rows = worker_endurance.measured(3)
    assert [row.candidate for row in rows] == [0, 1, 2]
    assert all(row.failure == "" for row in rows)
    assert len({row.files for row in rows}) == 1
    assert rows[2].memory < 1.5 * rows[0].memory
