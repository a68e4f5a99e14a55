"""Searches of a plan are started in their order, and unfinished ones are continued."""

import pytest

from experiments import planned_searches
from experiments.planned_searches import PlannedSearch, command, main

SEARCHES = [PlannedSearch(name, "detection", "compound", (f"seed={n}",)) for n, name in enumerate(("a", "b", "c"))]


def test_an_existing_run_is_continued_and_the_next_one_is_started(tmp_path, monkeypatch):
    called = []
    monkeypatch.setattr(planned_searches, "evolve", lambda arguments: called.append(arguments) or 0)
    (tmp_path / "a").mkdir()
    assert main("", SEARCHES, [str(tmp_path)]) == 0
    assert called[0] == ["resume", str(tmp_path / "a")]
    assert called[1] == command(SEARCHES[1], tmp_path, 1)
    assert called[1][:4] == ["run", "detection", "--preset", "compound"]
    assert "seed=1" in called[1]
    assert len(called) == len(SEARCHES)


def test_a_failed_search_ends_the_command_with_its_exit_code(tmp_path, monkeypatch):
    monkeypatch.setattr(planned_searches, "evolve", lambda arguments: 2)
    assert main("", SEARCHES, [str(tmp_path)]) == 2


def test_without_a_directory_the_command_names_what_is_missing(capsys):
    with pytest.raises(SystemExit):
        main("", SEARCHES, [])
    assert "DIR: missing" in capsys.readouterr().err


def test_the_list_contains_the_settings_of_each_search(capsys):
    assert main("", SEARCHES, ["--list"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [f"--set seed={n}" in line for n, line in enumerate(lines)] == [True, True, True]
    assert SEARCHES[2].config.seed == 2


def test_stored_records_are_continued_as_copies(tmp_path, monkeypatch):
    called = []
    monkeypatch.setattr(planned_searches, "evolve", lambda arguments: called.append(arguments) or 0)
    records, runs = tmp_path / "records", tmp_path / "runs"
    for name in ("a", "b"):
        (records / name).mkdir(parents=True)
        (records / name / "candidates.jsonl").write_text(f"record {name}")
    (runs / "b").mkdir(parents=True)
    (runs / "b" / "candidates.jsonl").write_text("a later state")
    assert main("", SEARCHES, [str(runs), "--records", str(records)]) == 0
    assert [arguments[0] for arguments in called] == ["resume", "resume", "run"]
    assert (runs / "a" / "candidates.jsonl").read_text() == "record a"
    assert (runs / "b" / "candidates.jsonl").read_text() == "a later state"
    assert sorted(path.name for path in runs.iterdir()) == ["a", "b"]
    assert (records / "a" / "candidates.jsonl").read_text() == "record a"


def test_without_the_option_a_search_is_started_anew_although_there_is_a_record(tmp_path, monkeypatch):
    called = []
    monkeypatch.setattr(planned_searches, "evolve", lambda arguments: called.append(arguments) or 0)
    (tmp_path / "records" / "a").mkdir(parents=True)
    assert main("", SEARCHES, [str(tmp_path / "runs")]) == 0
    assert {arguments[0] for arguments in called} == {"run"}
