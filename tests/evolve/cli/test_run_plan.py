"""The plan of a run: its counts, and its predictions from a measured pace."""

import inspect
import json
from dataclasses import replace

import pytest

import evolve.cli.run_plan
from evolve.cli.main import main
from evolve.cli.pace import Pace
from evolve.cli.run_plan import RunPlan
from evolve.config.assemble import assemble
from evolve.episodes.recorder import FINE_PIXELS, record
from sim.worlds.catalog import EPISODE_STEPS

PACE = Pace(start_s=10.0, steps_per_s=1000.0, play_s=5.0, policy_bytes=50_000)


@pytest.fixture
def paced(monkeypatch):
    """Use a machine of known pace."""
    monkeypatch.setattr(
        evolve.cli.run_plan, "measure_pace", lambda config, animals, workers: dict.fromkeys(animals, PACE)
    )


def test_hours_count_rounds_of_workers_and_all_that_a_candidate_does(tmp_path, paced):
    settings = ("search.population=6", "search.generations=10", "learning.total_steps=100000", "workers=4")
    config = assemble("detection", assignments=[*settings, "learning.eval_interval=30000"])
    candidate_s = 10 + 100 + (4 + 1) * 5
    assert PACE.candidate_s(config) == candidate_s
    plan = RunPlan.from_config(config, tmp_path).measured()
    assert plan.hours["start"] == pytest.approx(10 * 2 * candidate_s / 3600), "6 on 4 workers take two rounds"
    steady = RunPlan.from_config(replace(config, search=replace(config.search, steady_state=True)), tmp_path).measured()
    assert steady.hours["start"] == pytest.approx(15 * candidate_s / 3600), "60 on 4 workers without waiting"
    many = RunPlan.from_config(replace(steady.config, workers=64), tmp_path).measured()
    assert many.hours["start"] == pytest.approx(10 * candidate_s / 3600), "at most 6 are evaluated at once"


def test_disk_holds_policies_and_record_and_a_small_disk_is_noticed(tmp_path, paced, monkeypatch):
    def plan(generations):
        settings = (f"search.generations={generations}", "search.population=2")
        return RunPlan.from_config(assemble("detection", assignments=settings), tmp_path).measured()

    per_candidate = (plan(20).disk_bytes - plan(10).disk_bytes) / 20
    assert 50_000 + 500 < per_candidate < 50_000 + 5_000
    assert plan(10).notes() == []
    monkeypatch.setattr(RunPlan, "free_bytes", 1000)
    assert plan(10).notes() == ["the disk is too small for this run"]


def test_successive_halving_costs_what_its_stages_cost(tmp_path, paced):
    settings = ("search.population=6", "search.generations=10", "learning.total_steps=100000", "workers=4")
    rungs = ("search.rungs=2", "search.promoted=0.25")
    config = assemble("detection", assignments=[*settings, *rungs, "learning.eval_interval=30000"])
    plan = RunPlan.from_config(config, tmp_path).measured()
    first, second = 10 + 25 + (1 + 1) * 5, 10 + 75 + (3 + 1) * 5
    assert plan.hours["start"] == pytest.approx(10 * (2 * first + 1 * second) / 3600), "6 and 2 on 4 workers"
    assert plan.record()["steps"] == 10 * (6 * 28_672 + 2 * 73_728), "whole rollouts of 4,096"
    assert "rungs          6 candidates for 25,000 steps, 2 candidates for 100,000 steps" in "\n".join(plan.lines())


def test_passes_that_late_stages_spare_are_in_the_hours_and_in_the_speed(tmp_path, monkeypatch):
    """The second rung begins at step 4,178 and makes 8 passes over the samples instead of 10. A whole training run
    makes 10, then 9, then 6 passes.
    """
    settings = ("search.population=4", "search.generations=1", "search.rungs=2", "search.promoted=0.34", "workers=4")
    learning = ("learning.total_steps=12288", "learning.eval_interval=100000", "learning.decay_after=3277")
    pace = replace(PACE, pass_s=5e-5)
    monkeypatch.setattr(
        evolve.cli.run_plan, "measure_pace", lambda config, animals, workers: dict.fromkeys(animals, pace)
    )
    plan = RunPlan.from_config(assemble("detection", assignments=[*settings, *learning]), tmp_path).measured()
    first = 10 + 4.178 + 2 * 5
    second = 10 + 8.110 * (1 - 2 * 0.05) + 2 * 5
    assert plan.hours["start"] == pytest.approx((first + second) / 3600, rel=1e-3)
    mean_spared = (0 + 1 + 4) / 3
    assert f"{1 / (0.001 - mean_spared * 5e-5):,.0f} steps/s" in "\n".join(plan.lines())


def test_the_exported_episode_is_the_recorded_one():
    planned = evolve.cli.run_plan
    assert planned.EPISODE_ACTIONS == EPISODE_STEPS
    assert inspect.signature(record).parameters["radiance_every"].default == planned.EXR_EVERY
    assert planned.EXR_PIXELS == FINE_PIXELS


def test_dry_run_prints_the_plan_and_begins_nothing(tmp_path, paced, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    late = ["--set", "genome.optical.opens_at=1", "--set", "genome.n_eyes.open=false"]
    late += [
        "--set",
        "eye.relief_symmetric=false",
        "--set",
        "genome.doe.open=true",
        "--set",
        "learning.total_steps=100_000",
    ]
    frozen = ("fov_deg", "relative_aperture", "refractive_index", "doe_00", "doe_01")  # by the preset
    late += [part for name in frozen for part in ("--set", f"genome.{name}.open=true")]
    assert main(["run", "detection", "--preset", "quick", "--dry-run", *late]) == 0
    out = capsys.readouterr().out
    assert "5 generations x 8 candidates = 40" in out
    assert "optical from generation 1: relative_aperture, refractive_index, doe_00 … doe_33 (16)" in out
    assert "21 of 32" in out
    assert main(["run", "detection", "--preset", "quick", "--dry-run", "--json", *late]) == 0
    plan = json.loads(capsys.readouterr().out)
    assert plan["evaluations"] == 40
    assert plan["steps"] == 40 * 102_400
    assert "up to 102,400 (100,000 rounded up to rollouts of 4,096) each, 4,096,000 in all" in out
    assert plan["genes"]["doe_00"] == 1
    assert plan["hours"].keys() == {"start", "middle"}
    assert list(tmp_path.iterdir()) == []
