"""The experiment on factors of eyes: its design, and its page from training runs with known effects."""

from dataclasses import replace

import numpy as np
import pytest

from experiments import eye_factors, eye_factors_design
from experiments.designed import Trained
from experiments.eye_factors_design import (
    CAMERA,
    COMPOUND,
    FACTORS,
    LEARNER,
    RUNS,
    TASKS,
    animals,
    controls,
    designs,
    factorial,
    has,
    in_task,
)
from experiments.eye_factors_estimates import advantage, effects_in
from experiments.store import Origin, read_rows, write_rows

NAVIGATION = TASKS[0]


def trained(design, fitness):
    return Trained(
        **vars(design),
        held_out=fitness,
        held_out_episodes=32,
        success_rate=0.5,
        episodes=32,
        steps=151_552,
        seconds=1.0,
    )


def rows(runs=RUNS, spread=1.0):
    """Training runs in which coarse eyes are better by 20 in navigation, and fine ones in detection."""
    chance = np.random.default_rng(0)
    found = []
    for design in designs():
        if design.seed < runs:
            sign = 1 if design.task == "detection" else -1
            found.append(trained(design, 50 + 10 * sign * (design.width == 15) + spread * chance.normal()))
    return found


def test_cells_are_all_combinations_of_the_levels_and_rows_find_their_animal():
    cells = factorial()
    assert len(set(cells)) == 2 ** len(FACTORS)
    assert {COMPOUND, CAMERA} <= set(cells)
    some = rows(runs=2)
    assert all(len(eye_factors_design.runs_of(some, task, animal)) == 2 for task in TASKS for animal in cells)
    assert len(some) == 2 * sum(has(task, animal) for task in TASKS for animal in animals())


def test_navigators_of_each_run_have_layouts_of_their_own_and_detectors_have_none():
    for seed in (0, 5):
        assert f"world.family_seed={seed}" in in_task(COMPOUND, NAVIGATION, seed).own.split()
        assert in_task(COMPOUND, "detection", seed).own == ""


@pytest.mark.parametrize("control", controls()[1:], ids=lambda control: control.name)
def test_each_control_changes_an_animal_and_compares_many_eyes_with_few(control):
    assert (control.many, control.few) != (COMPOUND, CAMERA)
    assert control.many.n_eyes > control.few.n_eyes


def test_every_animal_is_an_animal_of_a_run():
    for design in dict.fromkeys(replace(design, seed=0) for design in designs()):
        config = design.config(LEARNER)
        eyes = design.animal.eyes(config.eye)
        assert eyes.resolution == (design.height, design.width)
        assert eyes.vertical_fov_deg == design.vertical_fov_deg


def test_stored_runs_are_recognised(tmp_path):
    """A design whose noise changed when it was stored with six digits would not be found in the file, and would be
    trained again in every call.
    """
    some = [trained(design, 1.0) for design in designs() if design.seed == 0]
    write_rows(some, tmp_path / "rows.csv")
    assert [row.design for row in read_rows(Trained, tmp_path / "rows.csv")] == [row.design for row in some]


def test_the_page_states_the_effect_that_is_there(tmp_path):
    origin = Origin(1.0, "a computer, 2 cores", {"rhabdom": "0", "commit": "abc", "python": "3.11"}, "worker")
    some = rows(runs=4)
    for task in TASKS:
        found = effects_in(some, task)
        sign = 1 if task == "detection" else -1
        assert found.of[("width",)].mean * found.spread == pytest.approx(10 * sign, abs=1)
        assert all(one.low < 0.6 and one.high > -0.6 for names, one in found.of.items() if names != ("width",))
        assert advantage(some, task, controls()[0]).mean == pytest.approx(-10 * sign, abs=2)
    made = eye_factors.page(some, origin, "Coarse eyes.")
    assert "Coarse eyes." in made.markdown
    for figure in made.figures:
        figure.draw(tmp_path / "figure.png")
    assert (tmp_path / "figure.png").stat().st_size > 10_000


def test_a_page_can_be_made_of_the_first_runs(tmp_path):
    some = rows(runs=1)
    assert effects_in(some, NAVIGATION) is None
    assert (
        "Too few training runs" in eye_factors.page(some, Origin(1.0, "m", {"commit": "a", "python": "3"}), "").markdown
    )


def test_difficult_layouts_do_not_blur_comparisons():
    """Returns differ by up to 140 between layouts, and by 10 ± 1 between animals in the same layouts."""
    some = [replace(row, held_out=row.held_out + 20 * row.seed) for row in rows()]
    found = advantage(some, NAVIGATION, controls()[0])
    assert 7 < found.low < found.high < 13, "an interval of unpaired runs is a hundred wide"
