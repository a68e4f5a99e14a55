"""A run opened in Python: its table, its figures, and its form in a notebook."""

import json
from dataclasses import replace

import matplotlib
import numpy as np
import pytest

import evolve
from evolve.config.run_config import EyeConfig
from evolve.interactive.summary import animal_as_html
from evolve.store.directory import Run
from tests.evolve.report.reported import FITNESS, HOSTILE, SEEING, make_run

matplotlib.use("Agg")


@pytest.fixture(scope="module")
def opened(tmp_path_factory):
    """Return a run of six candidates, including one that failed with hostile text."""
    return evolve.Run.open(make_run(tmp_path_factory.mktemp("opened") / "run").path)


def test_table_says_what_the_record_says(opened):
    table = opened.to_dataframe()
    assert list(table.index) == list(range(6))
    np.testing.assert_array_equal(table.fitness, [np.nan if value is None else value for value in FITNESS])
    assert table.failure[2] == HOSTILE
    assert list(table.fov_deg) == [30.0 + i for i in range(6)]
    assert table.doe_11[0] == SEEING.relief[5]
    assert table.fitness.idxmax() == opened.best.id == 3
    assert table.groupby("generation").fitness.max().tolist() == [3.25, 41.75]


def test_reprs_are_short_and_say_what_it_is(opened):
    assert repr(opened) == f"<Run {str(opened.path)!r}: detection, 6 of 6 candidates evaluated, best fitness 41.75>"
    assert repr(opened.best) == "<Candidate 3, generation 1, fitness 41.75>"
    assert repr(opened.config).startswith("<RunConfig detection, seed 0, 2 generations x 3 candidates")
    assert len(repr(opened.config)) < 120
    assert "failed: </td>" in repr(opened.candidate(2))


def test_a_notebook_runs_nothing_that_a_record_says(opened):
    for shown in (opened._repr_html_(), opened.candidate(2)._repr_html_()):
        assert "<script" not in shown
        assert "<img" not in shown
    assert "&lt;script&gt;" in opened.candidate(2)._repr_html_()
    assert "<td>no. 3, fitness 41.8</td>" in opened._repr_html_()
    assert "2 of 4 × 5 receptors, 33.0° wide" in opened.best._repr_html_()


def test_compound_eyes_have_ommatidia(opened):
    animal = replace(opened.best, phenotype=replace(opened.best.phenotype, facet_diameter_um=20.0))
    assert "2 of 4 × 5 ommatidia, 33.0° wide" in animal_as_html(animal).markup


def test_fitness_is_drawn_as_it_is(opened):
    lines = {line.get_label(): line.get_xydata() for line in opened.plot_fitness().lines}
    np.testing.assert_allclose(lines["best so far"][:, 1], [3.25, 41.75])
    np.testing.assert_allclose(lines["median"][:, 1], [np.median([-12.5, 3.25]), 7.0])
    assert len(lines["candidates"]) == 5, "one candidate has failed"
    given = matplotlib.figure.Figure().subplots()
    assert opened.plot_fitness(given) is given


def test_eyes_are_drawn_as_they_are(opened):
    figure = opened.best.show_eye()
    head, relief, psf = figure.axes[:3]
    wedges = [patch for patch in head.patches if hasattr(patch, "theta1")]
    middles = sorted((wedge.theta1 + wedge.theta2) / 2 for wedge in wedges)
    np.testing.assert_allclose(middles, [60, 120])  # 60 degrees apart, with the heading upwards
    assert all(wedge.theta2 - wedge.theta1 == pytest.approx(33.0) for wedge in wedges)
    assert relief.get_title() == "relief of the pupil"
    assert psf.images[0].get_array().max() > 0


def test_a_perfect_lens_has_neither_relief_nor_blur(opened):
    clear = replace(SEEING, relative_aperture=None, relief=None, refractive_index=None)
    blind = replace(opened.best, phenotype=clear, eye=EyeConfig(optics=False))
    assert len(blind.show_eye().axes) == 1


def test_lines_of_the_record_are_the_same(opened):
    """A candidate that refers to its run is written to the record like any other."""
    plain = Run.open(opened.path).best
    assert opened.best.to_line() == plain.to_line()
    assert "eye" not in json.loads(opened.best.to_line())


def test_what_is_not_there_is_refused(opened, tmp_path):
    with pytest.raises(evolve.RunError, match="there is no candidate 77"):
        opened.candidate(77)
    with pytest.raises(evolve.RunError, match="there is no such directory"):
        evolve.Run.open(tmp_path / "none")
