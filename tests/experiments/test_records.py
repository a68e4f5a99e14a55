"""Records of runs that are kept in the repository: what pages say can be made from them again, and they can go on."""

import importlib
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from evolve.config_source import to_toml
from evolve.loop import evolve
from evolve.store import Run, RunError
from experiments.candidates import Row, rows_of
from experiments.evolved import stored
from experiments.store import read_rows, write_rows

RESULTS = Path(__file__).parents[2] / "docs/results"
RECORDS = sorted((RESULTS / "records").iterdir())
PAGES = {
    "goals_shape_eyes": {
        "navigation": ("navigation-0", "navigation-1"),
        "detection": ("detection-0", "detection-1"),
    },
    "learning_through_holes": {"0.001": ("pupil-001",)},
    "seeing_ultraviolet": {"foraging": ("ultraviolet-0", "ultraviolet-1")},
}


@pytest.mark.parametrize("record", RECORDS, ids=lambda path: path.name)
def test_record_is_a_run(record):
    run = Run.open(record)
    assert run.notice is None
    assert 0 < len(run.candidates) <= run.config.candidates
    assert {file.name for file in record.iterdir()} == {"candidates.jsonl", "config.toml", "versions.json"}


class NobodyThere(Exception):
    pass


class Nobody:
    """An executor that has nobody to evaluate anything, watched by nobody."""

    training = evaluated = None

    def run(self, jobs, progress=None):
        if jobs:
            raise NobodyThere
        return iter(())


@pytest.mark.parametrize("record", RECORDS, ids=lambda path: path.name)
def test_search_still_proposes_what_is_on_record(record, tmp_path):
    """So that a record goes on where it ends: the loop asks for the first animal that is missing, and for no other."""
    run = Run.open(shutil.copytree(record, tmp_path / "run"))
    if run.finished:
        evolve(run, Nobody(), Nobody())
    else:
        with pytest.raises(NobodyThere):
            evolve(run, Nobody(), Nobody())
    altered = replace(run.config, search=replace(run.config.search, sigma=0.9 * run.config.search.sigma))
    (run.path / "config.toml").write_text(to_toml(altered))
    with pytest.raises(RunError):
        evolve(Run.open(run.path), Nobody(), Nobody())


@pytest.mark.parametrize("page", PAGES)
def test_pages_hold_what_is_on_record(page, tmp_path):
    runs = [(group, name) for group, names in PAGES[page].items() for name in names]
    rows = [row for group, name in runs for row in rows_of(Run.open(RESULTS / "records" / name), group)]
    write_rows(rows, tmp_path / "rows.csv")
    assert (tmp_path / "rows.csv").read_bytes() == (RESULTS / "data" / f"{page}.csv").read_bytes()
    assert read_rows(Row, tmp_path / "rows.csv")


@pytest.mark.parametrize("page", PAGES)
def test_pages_say_what_their_stores_say(page):
    experiment = importlib.import_module(f"experiments.{page}")
    assert experiment.page(stored(RESULTS / "data" / page)).markdown == (RESULTS / f"{page}.md").read_text()
