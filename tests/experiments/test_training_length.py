"""Length of training runs: agreement of learning curves with fitness, for curves whose agreement is known."""

import math
from dataclasses import replace

import pytest

from evolve.config.assemble import assemble
from evolve.config.numbering import Place
from evolve.genome.genotype import Genotype
from evolve.genome.phenotype import develop
from evolve.store.candidate import Candidate
from evolve.store.evaluation import Evaluation
from experiments import training_length
from experiments.designed import Trained
from experiments.eye_factors_design import CAMERA, COMPOUND, LEARNER, in_task
from experiments.store import Origin
from experiments.training_length import FIRST, SCHEDULES, agreement, designs, page, ranked, ranks_table

WIDTHS = (2, 4, 8, 16)


def generation(early, late):
    """Four candidates with one eye each, 2 to 16 receptors across, with these early and late returns."""
    config = assemble(preset="bifurcation-detection")
    start = Genotype(config.genome).start
    animal = develop(start, config)
    found = []
    for index, (width, first, last) in enumerate(zip(WIDTHS, early, late, strict=True)):
        result = Evaluation(last, (last,) * 4, 0.5, 20, 1.0, curve=((10, first), (20, last)))
        shape = type(animal)(**{**vars(animal), "n_eyes": 1, "resolution": (width, width)})
        found.append(Candidate.from_evaluation(Place.from_id(index, 4), tuple(start), shape, index, result))
    return found


def test_equal_and_opposite_ranks():
    """The mean of ln(width) is 2.5 ln 2 over all four animals and 3.5 ln 2 over the finer half."""
    fine, coarse = math.log(2), -math.log(2)
    same = agreement([generation((1, 2, 3, 4), (10, 20, 30, 40))] * 3, 0)
    assert (same.steps, same.correlation, same.shared) == (10, pytest.approx(1), 1)
    assert (same.selected, same.by_fitness) == pytest.approx((fine, fine))
    opposite = agreement([generation((4, 3, 2, 1), (10, 20, 30, 40))], 0)
    assert (opposite.correlation, opposite.shared) == (pytest.approx(-1), 0)
    assert (opposite.selected, opposite.by_fitness) == pytest.approx((coarse, fine))


def test_later_generations_count_for_ranks_but_not_for_selection():
    early, later = generation((1, 2, 3, 4), (1, 2, 3, 4)), generation((4, 3, 2, 1), (1, 2, 3, 4))
    found = agreement([early] * training_length.EARLY + [later] * training_length.EARLY, 0)
    assert found.correlation == pytest.approx(0)
    assert found.selected == pytest.approx(found.by_fitness)


def test_every_shorter_training_run_is_shorter():
    assert len(designs()) == 4 * len(SCHEDULES) + 2 * (len(ranked()) - 2)
    assert all(design.config(LEARNER).learning.total_steps < 110_000 for design in designs())


def test_page_shows_the_fitness_of_each_schedule_and_the_ranks():
    rows = [Trained(**vars(design), fitness=100.0 + number) for number, design in enumerate(designs())]
    text = page(rows, Origin(1.0, "m", {"commit": "a", "python": "3"}), "Yes.").markdown
    assert "| 50,000 steps | 100 | 101 | 102 | 103 |" in text
    assert "| 75,000 steps, half as many worlds | 108 | 109 | 110 | 111 |" in text
    assert (COMPOUND.n_eyes, CAMERA.n_eyes) == (10, 2)


def test_single_training_runs_are_compared_with_the_means_of_other_seeds():
    """The fitness of the first seed has the opposite order in full training runs, and the right one in shorter ones."""
    full, short = [], []
    for rank, animal in enumerate(ranked()):
        full += [Trained(**vars(in_task(animal, "maze", s)), fitness=float(rank if s else -rank)) for s in range(3)]
        short.append(Trained(**vars(in_task(replace(animal, own=FIRST), "maze", 0)), fitness=float(rank)))
    assert f"| maze | {len(ranked())} | 1.00 | -1.00 |" in ranks_table(short, full)
    assert "detection" not in ranks_table(short, full)
