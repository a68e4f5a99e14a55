"""Every eye width with every brain: error measures follow their definitions, and fits recover the ceilings and
exponents of synthetic laws."""

import math

import pytest

from experiments.brains_for_eyes import (
    BRAINS,
    DEFINITIONS,
    EYES,
    SEEDS,
    WIDTHS,
    _errors_table,
    _message,
    _over_runs,
    best_brains,
    control_of,
    designed_for,
    designs,
    frontier,
    main,
    missed,
    needed,
    over_both,
    page,
    shortfall,
)
from experiments.designed import Trained
from experiments.store import Origin


def lived(design, success_rate, fitness=0.0, episodes=10**6):
    outcome = {"success_rate": success_rate, "fitness": fitness, "episodes": episodes, "steps": 500_000, "seconds": 1.0}
    return Trained(**vars(design), **outcome)


def of_law(law):
    """Training runs in detection whose fraction of missed episodes is law(acuity, units)."""
    mine = [design for design in designs() if design.task == "detection"]
    return [lived(design, 1 - law(design.width / 90, design.neurons)) for design in mine]


def test_every_brain_has_every_eye_in_every_task():
    every = designs()
    asked = [design for task in EYES for design in designed_for(every, task)]
    assert len(every) == len(asked) + len(control_of(every))
    assert len(asked) == len(set(asked)) == len(EYES) * len(WIDTHS) * len(BRAINS) * len(SEEDS)
    assert {design.height for design in asked if design.task == "navigation"} == {1}
    assert all(design.height == design.width for design in asked if design.task != "navigation")
    assert {design.seed for design in every[: len(asked) // len(SEEDS)]} == {SEEDS[0]}, (
        "the first seed of every design comes first"
    )
    assert all(design.height == design.width for design in control_of(every))
    assert asked[0].animal.encoder == math.ceil(asked[0].neurons / 4)


def test_misses_are_counted_and_never_none():
    animal = designs()[0]
    one, other = lived(animal, 1.0, episodes=319), lived(animal, 0.5, episodes=319)
    assert missed([one]) == {(1, 1): 0.5 / 320}
    assert missed([one, other]) == {(1, 1): pytest.approx((0.5 / 320 + 160 / 320) / 2)}


def test_a_shortfall_is_between_the_worst_and_the_best_life():
    animals = designs()[:3]
    found = shortfall([lived(a, 0.5, fitness) for a, fitness in zip(animals, (10.0, 30.0, 50.0), strict=True)])
    assert list(found.values()) == pytest.approx([1.5 / 2, 1.0 / 2, 0.5 / 2])


@pytest.mark.parametrize(("least", "found"), [(1, 1), (16, 16), (1000, None)])
def test_the_brain_that_fine_eyes_need(least, found):
    """For brains that are large enough, the error decreases with acuity. For brains of 4 units, it decreases by less
    than half.
    """
    lives = of_law(lambda acuity, units: 0.01 / acuity if units >= least else 0.9 - 0.3 * acuity * (units == 4))
    assert needed(lives) == found


def test_a_brain_whose_coarsest_eyes_fail_by_themselves_gains_nothing():
    """The error falls from 0.99 to 0.48 with 4 units, but other brains miss 0.7 with the coarsest eyes, and 0.48 is
    more than half of that."""
    lives = of_law(lambda acuity, units: (0.99 - 0.51 * (acuity > 0.2)) if units == 4 else 0.7 - 0.6 * (acuity > 0.2))
    assert needed(lives) == 16


@pytest.mark.parametrize(
    ("least", "navigates", "message"),
    [
        (16, 16, "Finer eyes are better only with a sufficiently large brain"),
        (
            16,
            1000,
            "Finer eyes are better only with a sufficiently large brain; not in navigation, where finer eyes are lower",
        ),
        (1, 1000, "Error over acuity for brains of each size"),
        (1000, 1000, "Error over acuity for brains of each size"),
    ],
)
def test_the_figure_says_what_the_lives_do(least, navigates, message):
    detect = of_law(lambda acuity, units: 0.01 / acuity if units >= least else 0.9)
    navigate = [
        lived(each, 1 - (0.01 / (each.width / 90) if each.neurons >= navigates else 0.9))
        for each in designs()
        if each.task == "navigation"
    ]
    assert _message([*detect, *navigate]) == message


def test_the_control_has_a_row_of_its_own():
    every = [lived(each, 1 - (0.25 if each in control_of([each]) else 0.5)) for each in designs()]
    *_, last = _errors_table(every).splitlines()
    assert last.startswith("| control: navigation, square eyes | 64 | - | - | 0.250 | 0.250 | -")
    assert "0.250" not in "".join(_errors_table(every).splitlines()[:-1])


def test_an_exponent_over_training_runs_is_as_uncertain_as_seeds_differ():
    """Three seeds whose laws have exponents 0.9, 1 and 1.1: the mean is 1, and Student's interval ± 4.303 0.1 / √3."""
    rows = [
        lived(each, 1 - 0.01 / (each.width / 90) ** (1 + 0.1 * (each.seed - 1)))
        for each in designs()
        if each.task == "detection"
    ]
    assert _over_runs(rows, missed) == "1 [0.752, 1.25]"


def test_one_brain_that_gains_below_others_that_do_not_is_chance():
    assert needed(of_law(lambda acuity, units: 0.01 / acuity if units == 4 else 0.9)) is None


def test_a_failed_life_says_nothing():
    from dataclasses import replace

    rows = of_law(lambda acuity, units: 0.5)
    assert missed([*rows, replace(rows[0], failed=1, success_rate=0.0)]) == missed(rows)


def test_the_best_brain_of_each_eye_is_found():
    found = best_brains({(2, 1): 0.5, (2, 16): 0.3, (2, 64): 0.4, (8, 1): 0.2, (8, 16): 0.25})
    assert found == {2: (16, 0.3), 8: (1, 0.2)}


def test_exponents_of_a_law_are_found():
    """Error falls with acuity, and with brain size up to 16 units: the best brains show the exponent of acuity
    alone."""
    rows = of_law(lambda acuity, units: 0.02 * acuity**-0.4 * min(units, 16) ** -0.1)
    law = frontier(rows, missed)
    assert law.exponents[0].mean == pytest.approx(0.4, abs=1e-4)
    exact = of_law(lambda acuity, units: 0.02 * acuity**-0.4 * units**-0.1)
    assert [one.mean for one in over_both(exact, missed).exponents] == pytest.approx([0.4, 0.1], abs=1e-4)


def test_no_law_of_two_eyes():
    few = [row for row in of_law(lambda acuity, units: 0.3 + acuity) if row.width < 4]
    assert frontier(few, missed) is None


def test_the_page_shows_every_cell_and_what_is_missing(tmp_path):
    rows = [row for row in of_law(lambda acuity, units: 0.02 * acuity**-0.4) if (row.width, row.neurons) != (24, 256)]
    made = page(rows, Origin.here(1.0, "worker"), "Yes.")
    largest = next(line for line in made.markdown.splitlines() if line.startswith("| detection | 256 |"))
    assert largest.endswith("| - |")
    assert made.markdown.count("| detection | episodes missed | 0.4") == 1
    for name in DEFINITIONS:
        assert name in made.markdown
    made.publish(tmp_path)
    assert (tmp_path / "figures/brains_for_eyes.png").stat().st_size > 10_000


def test_without_animals_there_is_no_page(tmp_path, capsys):
    assert main(["--docs", str(tmp_path)]) == 2
    assert "holds no animals; train some with --compute" in capsys.readouterr().err
    assert not list(tmp_path.glob("*.md"))
