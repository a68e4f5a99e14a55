"""The plan: what it counts, what it predicts from a pace, and that a pace is measured on the real thing."""

import json
from dataclasses import replace

import pytest

import evolve.cli.run_plan
from evolve.cli.main import main
from evolve.cli.pace import Pace, measure_pace
from evolve.cli.run_plan import RunPlan
from evolve.config.assemble import assemble
from evolve.config.lint import idle_genes, idle_starts, lint
from evolve.config.run_config import ConfigError
from evolve.genome.genotype import Genotype
from evolve.genome.phenotype import develop
from evolve.learning.fitness import evaluate
from optics.numerics import backend
from tests.evolve.small_run import PHENOTYPE, small_config

PACE = Pace(start_s=10.0, steps_per_s=1000.0, play_s=5.0, policy_bytes=50_000)


@pytest.fixture
def paced(monkeypatch):
    """A machine of known pace."""
    monkeypatch.setattr(
        evolve.cli.run_plan, "measure_pace", lambda config, animals, workers: dict.fromkeys(animals, PACE)
    )


def test_hours_count_rounds_of_workers_and_all_that_a_candidate_does(tmp_path, paced):
    settings = ("search.population=6", "search.generations=10", "learning.total_steps=100000", "workers=4")
    config = assemble("detection", assignments=[*settings, "learning.eval_interval=30000"])
    candidate_s = 10 + 100 + (4 + 1) * 5
    assert PACE.candidate_s(config) == candidate_s
    plan = RunPlan.of(config, tmp_path).measured()
    assert plan.hours["start"] == pytest.approx(10 * 2 * candidate_s / 3600), "6 on 4 workers take two rounds"
    steady = RunPlan.of(replace(config, search=replace(config.search, steady_state=True)), tmp_path).measured()
    assert steady.hours["start"] == pytest.approx(15 * candidate_s / 3600), "60 on 4 workers, nobody waits"


def test_animal_that_cannot_be_evaluated_is_named():
    """A retina far behind a rough relief: light spreads farther than optics follows it."""
    backend.require()
    config = small_config()
    rough = (0.53, 0.2, 0.7, 0.22, 0.59, 0.31, 0.53, 0.39, 0.25, 0.45, 0.67, 0.59, 0.88, 0.53, 0.24, 0.56)
    blurred = replace(PHENOTYPE, fov_deg=13.8, relative_aperture=0.243, relief=rough, refractive_index=1.85)
    with pytest.raises(ConfigError, match="an animal like the middle one cannot be evaluated here: tolerance"):
        measure_pace(config, {"middle": blurred}, 1)


def test_disk_holds_policies_and_record_and_a_small_disk_is_noticed(tmp_path, paced, monkeypatch):
    def plan(generations):
        settings = (f"search.generations={generations}", "search.population=2")
        return RunPlan.of(assemble("detection", assignments=settings), tmp_path).measured()

    per_candidate = (plan(20).disk_bytes - plan(10).disk_bytes) / 20
    assert 50_000 + 500 < per_candidate < 50_000 + 5_000
    assert plan(10).notes() == []
    monkeypatch.setattr(RunPlan, "free_bytes", 1000)
    assert plan(10).notes() == ["the disk is too small for this run"]


def test_genes_that_cannot_change_anything_are_named():
    def notes(*settings):
        return idle_genes(assemble("detection", assignments=settings))

    assert notes() == []
    assert "placement_range_deg is open but changes nothing" in notes("genome.n_eyes.open=false")[0]
    assert notes("genome.n_eyes.open=false", "genome.n_eyes.start=3") == []
    glass = ("genome.refractive_index.open=false", "genome.refractive_index.start=1")
    assert "refractive_index is held at 1" in notes(*glass)[0]
    assert "the relief is held flat" in notes("genome.doe.open=false")[0]
    assert notes("genome.doe.open=false", "genome.doe_11.start=0.9") == []
    inherited = ("eye.receptors=genes", "genome.lambda_max.open=true")
    first, *others = notes(*inherited)
    assert "the world of detection is grey" in first
    assert others == ["genome.lambda_max_3_nm is open but changes nothing: genome.receptor_types is at most 3"]
    assert len(notes(*inherited, "genome.receptor_types.open=true")) == 1


def test_starts_that_nothing_reads_are_named():
    def notes(*settings):
        return idle_starts(assemble("detection", assignments=settings))

    assert notes() == notes("eye.optics=false") == []
    blue = "genome.lambda_max_0_nm.start=400"
    assert notes(blue) == ["what lambda_max_0_nm starts with changes nothing: eye.receptors = rgb, not genes"]
    assert notes(blue, "eye.receptors=genes") == []
    closed = ("eye.optics=false", "genome.relative_aperture.start=0.2", "genome.refractive_index.start=1.7")
    assert notes(*closed) == ["what relative_aperture, refractive_index start with changes nothing: eye.optics = false"]
    relief = [f"genome.doe_{i}{j}.start=0.1" for i in range(4) for j in range(4)]
    assert "doe_00, doe_01, doe_02, ... start with changes nothing" in notes("eye.optics=false", *relief)[0]


def test_bands_too_few_for_the_colours_of_a_world_are_named():
    """Four bands put the ultraviolet that a goal reflects where pigments of 410 nm look: 0.18 of white's signal."""

    def notes(task, *settings):
        return lint(assemble(task, assignments=settings))

    few = "eye.bands = 4 misjudge what foraging's objects reflect by up to 0.065 of white's signal, more than "
    assert notes("foraging") == [few + "a receptor's noise, 0.01; 16 do not"]
    narrow = ("genome.relative_aperture.open=false", "genome.relative_aperture.start=0.3")
    assert notes("foraging", *narrow) == [], "in a tenth of the light"
    assert notes("foraging", "eye.bands=16") == []
    inherited = ("eye.receptors=genes", "eye.noise_sigma=0.02", "genome.lambda_max_2_nm.open=true")
    assert "up to 0.18 of white's signal" in notes("foraging", *inherited)[0]
    assert notes("foraging", *inherited, "eye.bands=16") == []
    assert "more than a receptor's noise, 0.001; 32 do not" in notes("foraging", "eye.noise_sigma=0")[0]
    assert "even 40 do" in notes("foraging", "eye.receptors=honeybee", "eye.bands=40", "eye.noise_sigma=0")[0]
    assert notes("detection", "eye.bands=1") == [], "a grey world has no colours to misjudge"


def test_a_ladder_costs_what_its_rungs_cost(tmp_path, paced):
    settings = ("search.population=6", "search.generations=10", "learning.total_steps=100000", "workers=4")
    stages = ("search.rungs=2", "search.promoted=0.25")
    config = assemble("detection", assignments=[*settings, *stages, "learning.eval_interval=30000"])
    plan = RunPlan.of(config, tmp_path).measured()
    first, second = 10 + 25 + (1 + 1) * 5, 10 + 75 + (3 + 1) * 5
    assert plan.hours["start"] == pytest.approx(10 * (2 * first + 1 * second) / 3600), "6 and 2 on 4 workers"
    assert plan.record()["steps"] == 10 * (6 * 25_000 + 2 * 75_000)
    assert "budget stages  6 to 25,000 steps, 2 to 100,000 steps" in "\n".join(plan.lines())


def test_dry_run_prints_the_plan_and_begins_nothing(tmp_path, paced, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    late = ["--set", "genome.optical.opens_at=1", "--set", "genome.n_eyes.open=false"]
    assert main(["run", "detection", "--preset", "quick", "--dry-run", *late]) == 0
    out = capsys.readouterr().out
    assert "3 generations x 4 candidates = 12" in out
    assert "optical from generation 1: relative_aperture, refractive_index, doe_00 … doe_33 (16)" in out
    assert "24 of 33" in out
    assert main(["run", "detection", "--preset", "quick", "--dry-run", "--json", *late]) == 0
    plan = json.loads(capsys.readouterr().out)
    assert plan["evaluations"] == 12
    assert plan["steps"] == 1_200_000
    assert plan["genes"]["doe_00"] == 1
    assert plan["hours"].keys() == {"start", "middle"}
    assert list(tmp_path.iterdir()) == []


def test_pace_is_measured_with_the_real_thing(tmp_path, short_episodes):
    backend.require()
    config = small_config()
    animal = develop(Genotype(config.genome).start, config)
    pace = measure_pace(config, {"start": animal}, 1)["start"]
    assert evaluate(animal, config, 0, tmp_path / "policy").failure is None
    assert pace.policy_bytes == (tmp_path / "policy").stat().st_size
    assert pace.steps_per_s > 0
    assert pace.start_s > 0
