"""The shipped run of `evolve demo` has the documented settings, and the current code replays and reports it."""

import json
from pathlib import Path

import pytest

import sim
from evolve.cli.commands import products
from evolve.config.assemble import assemble
from evolve.learning.schedule import schedule
from evolve.search.successive_halving import finished
from evolve.store.directory import Run
from evolve.store.policies import require_policy
from experiments.shipped_run import FOLDER, ship

PLANNED = {"workers", "seed"}


@pytest.fixture(scope="module")
def shipped():
    return Run.open(FOLDER)


def test_it_is_a_finished_run_of_the_quick_preset(shipped):
    """A change of the preset needs a new shipped run: `python -m experiments.shipped_run`."""
    assert finished(shipped)
    assert shipped.notice is None
    preset = assemble("detection", "quick", assignments=[f"seed={shipped.config.seed}"])
    passes = preset.learning.n_epochs
    assert schedule(preset.learning, preset.learning.total_steps)[0] == passes, "the shipped run has no schedule"
    assert shipped.config == preset
    require_policy(shipped.best, shipped.policy_path(shipped.best.id))
    assert shipped.best.policy is not None


def test_it_is_small_and_names_no_machine(shipped):
    files = [path for path in FOLDER.rglob("*") if path.is_file()]
    assert sum(path.stat().st_size for path in files) < 400_000
    for path in files:
        assert b"/tmp/" not in path.read_bytes(), path
        assert b"/home/" not in path.read_bytes(), path


def test_its_eyes_have_evolved(shipped):
    """The median of the last generation is clearly above that of the first, and the best animal finds most goals."""
    import statistics

    first, *_, last = (
        statistics.median(one.fitness for one in shipped.generation(number))
        for number in range(shipped.config.search.generations)
    )
    assert last > 1.5 * max(first, 1.0)
    assert shipped.best.success_rate > 0.6


@pytest.mark.slow
def test_demo_replays_reports_and_exports_it(call, tmp_path, monkeypatch):
    opened = []
    monkeypatch.setattr(products.webbrowser, "open", opened.append)
    code, out, err = call("demo", "--out", tmp_path / "new" / "demo", "--json", "--open")
    assert (code, err) == (0, "")
    made = json.loads(out)
    assert opened == [Path(made["report"]).as_uri()]
    report, replay = (Path(made[name]).read_text() for name in ("report", "replay"))
    assert "The best animal at its task" in report
    assert 'class="player"' in replay
    views = sim.read_exr(made["exr"][0])
    assert len(views) == Run.open(FOLDER).best.phenotype.n_eyes
    # The animal still plays in the same way: the return of one episode is within the range of the returns on record.
    code, out, _ = call("replay", made["directory"], "--json", "--out", tmp_path / "again.html")
    returns = Run.open(FOLDER).best.returns
    assert min(returns) <= json.loads(out)["return"] <= max(returns)


def test_demo_writes_over_nothing_of_others(call, tmp_path):
    (tmp_path / "mine.txt").write_text("mine")
    code, out, err = call("demo", "--out", tmp_path)
    assert (code, out) == (2, "")
    assert err == f"evolve: error: {tmp_path} contains other files: choose another directory with --out\n"
    (tmp_path / "config.toml").write_text("mine")
    assert call("demo", "--out", tmp_path)[0] == 2
    assert (tmp_path / "config.toml").read_text() == "mine"


@pytest.mark.slow
def test_only_a_finished_run_is_shipped(run, finished, tmp_path):
    with pytest.raises(ValueError, match="must be a finished run"):
        ship(run.path, tmp_path / "demo")
    assert not (tmp_path / "demo").exists()
