"""The store of experiments: written rows read back, together with their origin."""

import json
from dataclasses import dataclass

import pytest

from experiments.store import Origin, read_rows, write_rows


@dataclass(frozen=True)
class Row:
    name: str
    count: int
    value: float


def test_rows_read_back(tmp_path):
    rows = [Row('hole, "open"', 3, 0.25), Row("lens", -1, 1.5e-7)]
    write_rows(rows, tmp_path / "new" / "rows.csv")
    assert read_rows(Row, tmp_path / "new" / "rows.csv") == rows
    assert read_rows(Row, tmp_path / "absent.csv") == []


def test_no_rows_are_refused_and_what_was_there_stays(tmp_path):
    write_rows([Row("a", 1, 2.0)], tmp_path / "rows.csv")
    with pytest.raises(ValueError, match="cannot write an empty table"):
        write_rows([], tmp_path / "rows.csv")
    assert len(read_rows(Row, tmp_path / "rows.csv")) == 1


def test_numbers_are_short(tmp_path):
    write_rows([Row("a", 1, 1 / 3)], tmp_path / "rows.csv")
    assert (tmp_path / "rows.csv").read_text() == "name,count,value\na,1,0.333333\n"


def test_origin_reads_back_and_names_what_counts(tmp_path):
    origin = Origin.here(2.5)
    origin.write(tmp_path / "origin.json")
    assert Origin.read(tmp_path / "origin.json") == origin
    assert origin.sentence().startswith("2.5 core hours on ")
    assert f"numpy {origin.versions['numpy']}" in origin.sentence()


def test_records_name_the_machines_that_made_them(tmp_path):
    """Records may be collected on another machine, whose name must not appear."""
    made = {"first": ["Old Processor, 4 cores", "New Processor, 8 cores"], "second": ["New Processor, 8 cores"]}
    for name, processors in made.items():
        versions = {"commit": "a" * 40, "python": "3.9", "machine": "abc"}
        starts = [{"processor": each, "versions": versions} for each in processors]
        (tmp_path / name).mkdir()
        (tmp_path / name / "versions.json").write_text(json.dumps(starts))
    origin = Origin.from_runs([tmp_path / name for name in made], 30.0)
    assert origin.sentence() == (
        f"30 worker hours on Old Processor, 4 cores; New Processor, 8 cores; rhabdom at commit {'a' * 10}, Python 3.9."
    )
    assert origin.machine != Origin.here(1.0).machine


def test_records_of_former_versions_name_no_processor(tmp_path):
    (tmp_path / "versions.json").write_text('[{"versions": {"commit": "", "python": "3.9", "machine": "riscv64"}}]')
    assert Origin.from_runs([tmp_path], 1.0).machine == "riscv64, processor not recorded"
    (tmp_path / "versions.json").unlink()
    assert Origin.from_runs([tmp_path], 1.0).sentence() == (
        "1 worker hours on an unknown machine; rhabdom at commit unknown, Python unknown."
    )


@pytest.mark.parametrize(("hours", "shown"), [(10.0, "10 core hours"), (0.5, "30 core m"), (0.005, "18 core seconds")])
def test_time_is_told_in_a_fitting_unit(hours, shown):
    assert Origin(hours, "a machine", {"python": "3", "commit": "abc+"}).sentence().startswith(shown)


def test_rows_of_several_versions_name_them_all(tmp_path):
    path = tmp_path / "origin.json"
    for commit in ("a" * 40, "b" * 40 + "+", "b" * 40 + "+", "c" * 40):
        Origin(1.0, "a machine", {"python": "3", "commit": commit}).after(path).write(path)
    said = Origin.read(path).sentence()
    assert f"rhabdom at commit {'a' * 10}, {'b' * 10} with changes, {'c' * 10}, Python" in said
