"""Records of runs stored in the repository: they reproduce the statements of the pages, and the runs can be resumed."""

import csv
import importlib
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from evolve.config.assemble import to_toml
from evolve.search.loop import evolve
from evolve.search.successive_halving import finished
from evolve.store.directory import Run, RunError
from experiments import candidates
from experiments.candidates import Row, complete, rows_of
from experiments.designed import Trained
from experiments.evolved import stored
from experiments.store import RECORDS, Origin, read_rows, write_rows
from tests.slow_part import slow

RESULTS = Path(__file__).parents[2] / "docs/results"
RUNS = sorted(RECORDS.iterdir())
PAGES = {
    "bending_light": {
        "lens": ("lens-003-0", "lens-003-1", "lens-003-2"),
        "index1": ("index1-003-0", "index1-003-1"),
    },
    "brains_and_acuity": {
        "detection": ("scaling-detection",),
        "tracking": ("scaling-tracking",),
        "navigation": ("scaling-navigation",),
    },
    "goals_shape_eyes": {
        "navigation": ("course-navigation-0", "course-navigation-1", "course-navigation-2"),
        "detection": ("course-detection-0", "course-detection-1", "course-detection-2"),
    },
    "learning_through_holes": {"0.0003": ("pupil-0003",), "0.001": ("pupil-001",), "0.003": ("pupil-003",)},
    "seeing_ultraviolet": {"foraging": ("ultraviolet-0", "ultraviolet-1")},
}
OPTICAL = ("image_quality", "above_noise", "above_noise_of_hole", "strehl", "psnr_db", "ssim")


@pytest.mark.fast_cases(16)
@pytest.mark.parametrize("record", RUNS, ids=lambda path: path.name)
def test_record_is_a_run(record):
    run = Run.open(record)
    about_policies = (run.notice or "").startswith(f"{record / 'policies'}: ")  # the repository does not store policies
    assert run.notice is None or (about_policies and "\n" not in run.notice)
    assert 0 < len(run.candidates) <= run.config.candidates
    assert {file.name for file in record.iterdir()} == {"candidates.jsonl", "config.toml", "versions.json"}


class NobodyThere(Exception):
    pass


class Nobody:
    """An executor that evaluates nothing, and a progress display that shows nothing."""

    training = evaluated = None

    def run(self, jobs, progress=None):
        if jobs:
            raise NobodyThere
        return iter(())


@pytest.mark.fast_cases(3)
@pytest.mark.parametrize("record", RUNS, ids=lambda path: path.name)
def test_search_still_proposes_what_is_on_record(record, tmp_path):
    """A recorded run can be resumed: the loop requests exactly the first missing animal."""
    run = Run.open(shutil.copytree(record, tmp_path / "run"))
    if finished(run):
        evolve(run, Nobody(), Nobody())
    else:
        with pytest.raises(NobodyThere):
            evolve(run, Nobody(), Nobody())
    search = run.config.search
    cma = search.optimizer == "CMA"  # a quasi-random search has no step size and, in one dimension, no randomness
    other = replace(search, sigma=0.9 * search.sigma) if cma else replace(search, optimizer="CMA")
    (run.path / "config.toml").write_text(to_toml(replace(run.config, search=other)))
    with pytest.raises(RunError):
        evolve(Run.open(run.path), Nobody(), Nobody())


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES)
def test_pages_hold_what_is_on_record(page, tmp_path, monkeypatch):
    """Optical measures are checked for the last generation of one run of each group, because one eye takes seconds."""
    runs = [(group, Run.open(RECORDS / name)) for group, names in PAGES[page].items() for name in names]
    firsts = dict(reversed(runs))
    late = {id(c.phenotype) for run in firsts.values() for c in run.generation(complete(run)[-1])}
    seen = candidates._seen
    monkeypatch.setattr(candidates, "_seen", lambda config, animal: seen(config, animal) if id(animal) in late else {})
    write_rows([row for group, run in runs for row in rows_of(run, group)], tmp_path / "rows.csv")
    found, stored = (list(csv.DictReader(path.open())) for path in (tmp_path / "rows.csv", stored_rows(page)))
    assert len(found) == len(stored)
    for one, other in zip(found, stored, strict=True):
        left_out = OPTICAL if one["strehl"] == "nan" else ()
        exact, measured = (set(one) - set(OPTICAL), set(OPTICAL) - set(left_out))
        assert {name: one[name] for name in exact} == {name: other[name] for name in exact}
        # Optical measures of an eye may change within the tolerance of its kernel, 1e-2, if a cheaper method is found.
        # A fifth of that distinguishes neighbours in a generation.
        found_of, stored_of = ({name: float(row[name]) for name in measured & row.keys()} for row in (one, other))
        assert found_of == pytest.approx(stored_of, rel=2e-3, nan_ok=True)
    looked_at = sum(row["strehl"] != "nan" for row in found)
    assert looked_at == (len(firsts) if any(row["relief"] for row in found) else 0)
    assert read_rows(Row, stored_rows(page))


def stored_rows(page):
    return RESULTS / "data" / f"{page}.csv"


@pytest.mark.fast_cases(1)
@pytest.mark.parametrize("page", ["brains_for_eyes", "eyes_for_tasks", "training_length"])
def test_pages_of_designed_trainings_say_what_their_stores_say(page):
    data, experiment = stored_rows(page), importlib.import_module(f"experiments.{page}")
    answer = data.with_suffix(".txt").read_text(encoding="utf-8").strip()
    made = experiment.page(read_rows(Trained, data), Origin.read(data.with_suffix(".json")), answer)
    assert made.markdown == (RESULTS / f"{page}.md").read_text(encoding="utf-8")


@pytest.mark.fast_cases(1)
@pytest.mark.parametrize("page", [slow(page) if page == "seeing_ultraviolet" else page for page in PAGES])
def test_pages_say_what_their_stores_say(page):
    experiment = importlib.import_module(f"experiments.{page}")
    assert experiment.page(stored(RESULTS / "data" / page)).markdown == (RESULTS / f"{page}.md").read_text()
