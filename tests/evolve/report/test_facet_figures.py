"""Figures of ommatidia, and a small run of compound eyes with its report, replay, EXR files and successor."""

import dataclasses

import numpy as np
import pytest

import optics
import sim
from evolve.analysis.vision import vision
from evolve.cli.main import main
from evolve.config.assemble import assemble
from evolve.episodes.recorder import record
from evolve.genome.genotype import Genotype
from evolve.genome.phenotype import develop
from evolve.report.exr_export import export_episode
from evolve.report.eye_figures import eye_figures
from evolve.report.facet_figures import white_acceptance
from evolve.report.page import render
from evolve.runs.start_from import starts_from
from evolve.store.directory import Run

SMALL = (
    *("learning.n_envs=4", "learning.n_steps=8", "learning.total_steps=64", "learning.batch_size=16"),
    *("learning.eval_interval=1000", "learning.decay_after=16", "evaluation.episodes=1", "workers=1"),
    *("search.population=2", "search.generations=1"),
)


def test_acceptance_has_the_acceptance_angle():
    """The image's width at half maximum is that of the sensitivity of an ommatidium near the pigments' peaks."""
    one = optics.Ommatidium(optics.FacetLens(20e-6, radius_front=18e-6), optics.Waveguide(2e-6))
    eye = sim.CompoundEye([[0.0, 0.0]], one, receptors=(540,), bands=8)
    angles, white = white_acceptance(eye)
    row = white[len(white) // 2]
    width = np.ptp(angles[row >= 0.5])
    assert width == pytest.approx(np.degrees(one.acceptance_angle(540e-9)), rel=0.15)
    assert white.max() == 1
    assert np.abs(angles).max() > width


def test_figures_state_the_facets():
    config = assemble("detection", "compound")
    animal = develop(Genotype(config.genome).start, config)
    shown = eye_figures(animal, config.eye).markup
    assert "20.0 µm wide (F/2.00)" in shown
    assert "eye parameter DΔφ is 2.62 µm" in shown  # 20 µm times 7.5 degrees
    assert np.isnan(list(dataclasses.asdict(vision(animal, config)).values())).all()


@pytest.mark.slow
def test_a_run_of_compound_eyes_is_reported_and_exported(tmp_path, capsys):
    out = tmp_path / "run"
    settings = [part for setting in SMALL for part in ("--set", setting)]
    assert main(["run", "detection", "--preset", "compound", "--out", str(out), *settings]) == 0
    run = Run.open(out)
    episode = record(run, radiance_every=64)
    assert episode.signals.shape[1:3] == (2, 3)
    noise = episode.signals - episode.perfect_signals
    photons = run.best.phenotype.eye(run.config.eye).receptor_photons
    scale = np.sqrt(np.maximum(episode.perfect_signals, 0) / photons + run.config.eye.noise_sigma**2)
    assert (noise / scale).std() == pytest.approx(1, abs=0.15), "only noise differs"
    page = render(run, episode).decode()
    assert "Acceptance function" in page
    assert "the ommatidia without noise" in page
    (first, *_) = export_episode(run, episode, tmp_path / "exr")
    views = sim.read_exr(first)
    assert np.array_equal(views[0].receptors, episode.signals[0, 0])
    capsys.readouterr()
    source = starts_from(f"{out}:{run.best.id}")
    again = assemble("detection", starts=source, assignments=["genome.f_number.high=5"])
    kept = develop(Genotype(again.genome).start, again)
    assert kept == dataclasses.replace(run.best.phenotype, encoder=kept.encoder)
