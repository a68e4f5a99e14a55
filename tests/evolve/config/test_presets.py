"""Presets of experiments: they request the documented settings and starts, and do the amount of work of their scale."""

import json
from dataclasses import replace

import numpy as np
import pytest

import evolve.cli.run_plan
import optics
from evolve.cli.main import main
from evolve.cli.pace import Pace
from evolve.config.assemble import assemble
from evolve.config.lint import lint
from evolve.config.provenance import Source
from evolve.config.run_config import ConfigError
from evolve.config.sources import SCALES, preset_names
from evolve.genome.genotype import Genotype
from evolve.genome.phenotype import develop, repaired
from evolve.search.search import Search

EXPERIMENTS = ("bifurcation-detection", "bifurcation-navigation", "lens", "pupil", "scaling", "ultraviolet")
PACE = Pace(start_s=10.0, steps_per_s=1000.0, play_s=5.0, policy_bytes=50_000)


def animal(config):
    return develop(Genotype(config.genome).start, config)


def open_in(config, generation):
    genes = Genotype(config.genome).open_genes
    return {gene.name for gene in genes if config.genome[gene.name].opens_at <= generation}


def test_experiments_are_the_presets_that_come_in_scales():
    def scaled(name):
        try:
            return assemble("detection", name, scale="paper") is not None
        except ConfigError:
            return False

    assert tuple(filter(scaled, preset_names())) == EXPERIMENTS


@pytest.mark.parametrize("preset", EXPERIMENTS)
def test_paper_scale_has_the_published_budget_and_laptop_a_tenth_of_it_at_most(preset):
    laptop, paper = (assemble(preset=preset, scale=scale) for scale in SCALES)
    assert assemble(preset=preset) == laptop
    assert paper.search.population == 16
    assert 50 <= paper.search.generations <= 150
    assert paper.learning.total_steps == 1_000_000
    steps = [config.candidates * config.learning.total_steps for config in (laptop, paper)]
    assert steps[0] < steps[1] / 10
    # With fewer steps than it takes to distinguish good eyes from bad ones, selection has no effect
    # (docs/validation/learning_curves.md).
    assert laptop.learning.total_steps >= 130_000


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("preset", EXPERIMENTS)
def test_every_open_gene_changes_something_and_colours_are_seen_as_they_are(preset, scale):
    assert lint(assemble(preset=preset, scale=scale)) == []


def test_bifurcations_differ_in_their_task_and_begin_with_one_photoreceptor():
    """They also differ in the shape of the eye: only the width of a navigator's eye is a gene."""
    maze, field = (assemble(preset=f"bifurcation-{task}") for task in ("navigation", "detection"))
    assert (maze.task, field.task) == ("navigation", "detection")
    assert replace(maze.eye, square=True) == field.eye
    assert maze.search == field.search
    assert maze.learning.total_steps == field.learning.total_steps
    genes = {"n_eyes", "placement_range_deg"}
    assert (open_in(maze, 0), open_in(field, 0)) == (genes | {"resolution_width"}, genes | {"resolution"})
    assert maze.genome["resolution_width"] == field.genome["resolution"]
    assert all(maze.genome[name] == field.genome[name] for name in maze.genome.keys() & field.genome.keys())
    for config in (maze, field):
        start = animal(config)
        assert (start.n_eyes, start.resolution, start.fov_deg, start.relief) == (1, (1, 1), 45.0, None)
    assert (maze.genome["n_eyes"].high, maze.genome["resolution_width"].high) == (24, 24)


@pytest.mark.parametrize("task", ["navigation", "detection"])
def test_bifurcations_have_room_for_few_large_eyes_or_many_small_ones(task):
    """A receptor takes 3° of the head. Two eyes of 15 receptors fit within 45°, and ten of 4 within 108°, with less
    than a receptor to spare.
    """
    config = assemble(preset=f"bifurcation-{task}")
    genotype = Genotype(config.genome)
    width = "resolution_width" if task == "navigation" else "resolution"

    def changed(eyes, receptors, range_deg):
        values = {"n_eyes": eyes, width: receptors, "placement_range_deg": range_deg}
        return repaired(
            np.array([g.encode(values[g.name], config.genome[g.name]) for g in genotype.open_genes]), config
        )

    for eyes, receptors, range_deg in ((2, 15, 45), (10, 4, 108)):
        assert changed(eyes, receptors, range_deg) == ()
        assert changed(eyes, receptors, range_deg - 3) == ("placement_range_deg",)
        assert changed(eyes, receptors + 1, range_deg) == ("placement_range_deg",)
    assert changed(24, 24, 180) == ("n_eyes", width)


@pytest.mark.parametrize("scale", SCALES)
def test_lens_opens_the_pupil_first_and_then_what_bends_light(scale):
    config = assemble(preset="lens", scale=scale)
    first, second = Genotype(config.genome).phases
    assert first == 0
    assert open_in(config, second - 1) == {"relative_aperture"}
    joined = open_in(config, second) - {"relative_aperture"}
    assert joined == {"refractive_index", *(name for name in config.genome if name.startswith("doe_"))}
    assert len(joined) == 1 + (3 if scale == "laptop" else 16), "on a laptop reliefs are symmetric"
    assert second < config.search.generations / 2, "the harder phase has more time"


@pytest.mark.parametrize(("index", "aperture"), [(1.5, 0.38), (2.0, 0.54)])
def test_a_lens_in_focus_is_within_reach_of_the_lens_presets_genes(index, aperture):
    """Lenses in focus are also possible behind pupils that are slightly wider than the best pinhole. For a pupil of
    radius R, focal length f and index n, the control points of a paraboloid span 16 R² / (4 f (n - 1)).
    """
    config = assemble(preset="lens")
    eye = animal(config).eyes(config.eye).eye()
    focal_length = eye.sensor_distance

    def span(a):
        radius = a * config.eye.sensor_width / 2
        points = optics.BSplineRelief.paraboloid(0.0, 1 / (focal_length * (index - 1)), radius).control_points
        return np.ptp(points) / config.eye.relief_height

    assert span(aperture) <= 1 < span(aperture + 0.015)


def test_quick_starts_out_of_focus_but_few_steps_of_the_search_away():
    """The control points of the focusing paraboloid are closed forms; only their differences matter."""
    config = assemble("detection", "quick")
    eye = animal(config).eyes(config.eye).eye()
    curvature = 1 / (eye.sensor_distance * (config.genome["refractive_index"].start - 1))
    radius = config.genome["relative_aperture"].start * config.eye.sensor_width / 2
    points = optics.BSplineRelief.paraboloid(0.0, curvature, radius).control_points / config.eye.relief_height
    assert {name for name in open_in(config, 0) if name.startswith("doe_")} == {"doe_11"}
    corner, side, middle = (config.genome[name] for name in ("doe_00", "doe_01", "doe_11"))
    assert side.start - corner.start == pytest.approx(points[0, 1] - points[0, 0], abs=1e-3)
    focus = side.start + points[1, 1] - points[0, 1]
    step = config.search.sigma * (middle.high - middle.low)
    assert middle.start + 2 * step < focus < middle.start + 3 * step
    assert focus < middle.high


def test_pupil_is_the_preset_lens_without_a_lens():
    pupil, lens = assemble(preset="pupil"), assemble(preset="lens")
    assert open_in(pupil, 0) == {"relative_aperture"}
    assert replace(animal(pupil), relative_aperture=0.9, refractive_index=1.5) == animal(lens)
    assert replace(pupil.eye, relief_symmetric=True) == lens.eye
    assert pupil.learning == lens.learning


def test_scaling_spreads_candidates_evenly():
    config = assemble(preset="scaling")
    search = Search(config)
    genomes = np.array([search.propose().genome for _ in range(config.candidates)])
    for gene, column in zip(Genotype(config.genome).open_genes, genomes.T, strict=True):
        counts, _ = np.histogram(column, bins=5, range=(0, 1))
        assert counts.min() >= 0.18 * len(column), gene.name
    assert open_in(config, 0) == {"resolution_height", "resolution_width", "memory_frames", "neurons"}
    assert open_in(assemble("navigation", "scaling"), 0) == {"resolution_width", "memory_frames", "neurons"}


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("preset", EXPERIMENTS)
def test_dry_run_predicts_hours(preset, scale, monkeypatch, capsys, tmp_path):
    monkeypatch.setattr(
        evolve.cli.run_plan, "measure_pace", lambda config, animals, workers: dict.fromkeys(animals, PACE)
    )
    monkeypatch.chdir(tmp_path)
    assert main(["run", "--preset", preset, "--scale", scale, "--dry-run", "--json", "--workers", "2"]) == 0
    plan = json.loads(capsys.readouterr().out)
    assert plan["hours"]["start"] > 0.5
    assert plan["notes"] == []
    assert plan["directory"].startswith(f"runs/{plan['task']}-{preset.split('-')[0]}-")


def test_scales_that_do_not_exist_are_refused():
    with pytest.raises(ConfigError, match="unknown scale 'big' of preset lens; known: laptop, paper"):
        assemble(preset="lens", scale="big")
    with pytest.raises(ConfigError, match="scale 'laptop': preset quick has only one scale"):
        assemble("detection", "quick", scale="laptop")
    with pytest.raises(ConfigError, match="scale 'paper': has no effect without a preset"):
        assemble("detection", scale="paper")


def test_contradiction_with_a_scale_names_it():
    with pytest.raises(ConfigError, match="opens_at = 8: must be below") as caught:
        assemble(preset="lens", assignments=["search.generations=4"])
    assert str(caught.value).endswith("(preset lens on laptop scale; --set search.generations=4)")


def test_task_named_by_the_user_wins():
    assert assemble("tracking", "scaling").task == "tracking"
    assert assemble(preset="scaling", assignments=["task=foraging"]).task == "foraging"


def test_a_preset_made_for_a_task_wins_over_the_tasks_settings(monkeypatch):
    """A preset that can be used with any task does not take precedence: navigators' eyes still have one row of
    receptors.
    """
    own = {"task": "navigation", "learning": {"gamma": 0.5}}
    monkeypatch.setattr("evolve.config.assemble.preset_sources", lambda name, scale: [Source("preset", own)])
    assert assemble(preset="any").learning.gamma == 0.5
    monkeypatch.undo()
    assert assemble("navigation", "quick").genome["resolution_height"].start == 1
