"""Analysis against numbers that were calculated by hand."""

import math

import numpy as np
import pytest

from evolve.analysis.acuity import acuity_cpd
from evolve.analysis.statistics import (
    bootstrap_interval,
    by_generation,
    gene_values,
    generation_statistics,
    psnr,
    trajectory,
)
from evolve.config.run_config import EyeConfig
from evolve.store.candidate import Candidate
from tests.evolve.analysis.animals import phenotype


def candidate(id, generation, index, fitness, failure=None, **changes):
    return Candidate(
        id, generation, index, (), phenotype(**changes), 0, fitness, (fitness,), 0.0, 100, 1.0, (), failure
    )


GENERATIONS = [
    candidate(0, 0, 0, 1.0, fov_deg=10.0),
    candidate(1, 0, 1, 3.0, fov_deg=20.0),
    candidate(2, 0, 2, 2.0, fov_deg=60.0),
    candidate(3, 1, 0, -1.0, fov_deg=30.0),
    candidate(4, 1, 1, -math.inf, "rewards not finite", fov_deg=40.0),
    candidate(5, 1, 2, 2.5, fov_deg=50.0),
]


def test_generations_are_found_in_one_pass():
    """Generations are found in one pass, because a run may have thousands of them."""

    class Looked:
        looks = 0

        def __init__(self, number):
            self.number, self.index = number, number % 2

        @property
        def generation(self):
            Looked.looks += 1
            return self.number // 2

    found = by_generation([Looked(number) for number in reversed(range(400))])
    assert [(generation, [c.number for c in members]) for generation, members in found] == [
        (generation, [2 * generation, 2 * generation + 1]) for generation in range(200)
    ]
    assert Looked.looks <= 3 * 400


def test_statistics_of_a_generation():
    first, second = generation_statistics(GENERATIONS)
    assert (first.evaluated, first.failed, first.best, first.median) == (3, 0, 3.0, 2.0)
    assert (first.low, first.high) == pytest.approx((1.2, 2.8))  # a tenth of the way from 1 to 3, and back
    assert (second.evaluated, second.failed, second.best, second.median) == (3, 1, 2.5, 0.75)
    assert second.best_so_far == 3.0


def test_order_of_candidates_does_not_matter():
    assert generation_statistics(GENERATIONS[::-1]) == generation_statistics(GENERATIONS)


def test_a_generation_of_failures_has_no_fitness():
    failed = [candidate(0, 0, 0, -math.inf, "diverged"), candidate(1, 1, 0, 4.0)]
    first, second = generation_statistics(failed)
    assert math.isnan(first.best)
    assert math.isnan(first.median)
    assert math.isnan(first.best_so_far)
    assert second.best_so_far == 4.0


def test_trajectory_spread_counts_everyone_and_best_only_those_who_finished():
    path = trajectory(GENERATIONS, lambda p: p.fov_deg)
    assert path.generations.tolist() == [0, 1]
    assert path.median.tolist() == [20.0, 40.0]
    assert path.low == pytest.approx([12.0, 32.0])
    assert path.high == pytest.approx([52.0, 48.0])
    assert path.best.tolist() == [20.0, 20.0]  # candidate 1 stays the best


def test_trajectory_before_anyone_finished():
    path = trajectory([candidate(0, 0, 0, -math.inf, "diverged")], lambda p: p.fov_deg)
    assert math.isnan(path.best[0])
    assert path.median[0] == 45.0


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({}, 1 / (2 * 3.0)),  # receptors 45/15 = 3 deg apart, eyes 45 deg
        ({"n_eyes": 1}, 1 / (2 * 3.0)),
        ({"n_eyes": 91, "resolution": (1, 1)}, 1 / (2 * 1.0)),  # eyes 1 deg apart, receptors 45 deg
        ({"n_eyes": 1, "resolution": (9, 1)}, 1 / 90),  # the height does not count
        ({"placement_range_deg": 0.0}, 1 / (2 * 3.0)),  # eyes with the same direction do not add resolution
    ],
)
def test_acuity(changes, expected):
    assert acuity_cpd(phenotype(**changes)) == pytest.approx(expected, rel=1e-12)


def test_gene_values_are_those_of_the_phenotype():
    values = gene_values(phenotype())
    assert values["resolution_height"] == 2
    assert values["resolution_width"] == 15
    assert values["doe_01"] == pytest.approx(1 / 15)  # row-major: the column index grows first
    assert values["doe_10"] == pytest.approx(4 / 15)
    assert len(values) == 5 + 20 + 3


def test_gene_values_without_optics():
    values = gene_values(phenotype(relative_aperture=None, relief=None, refractive_index=None))
    assert set(values) == {
        *("n_eyes", "placement_range_deg", "fov_deg", "resolution_height", "resolution_width"),
        *("memory_frames", "neurons", "layers"),
    }


def test_gene_values_know_every_gene():
    from evolve.genome.genotype import GENES

    assert set(gene_values(phenotype(lambda_max_nm=(500.0,), elevation_deg=0.0))) == set(GENES)


def test_gene_values_of_square_eyes_are_of_one_side():
    sides = {"resolution_height", "resolution_width", "resolution"}
    shown = {
        square: {name: value for name, value in gene_values(phenotype(resolution=(7, 7)), eye).items() if name in sides}
        for square, eye in ((True, EyeConfig(square=True)), (False, EyeConfig()))
    }
    assert shown == {True: {"resolution": 7}, False: {"resolution_height": 7, "resolution_width": 7}}


def test_gene_values_of_receptor_types_that_an_animal_has_not_are_none():
    values = gene_values(phenotype(lambda_max_nm=(510.0, 350.0)))
    assert [values[name] for name in ("receptor_types", "lambda_max_0_nm", "lambda_max_1_nm")] == [2, 510, 350]
    assert np.isnan(values["lambda_max_2_nm"])
    assert np.isnan(values["lambda_max_3_nm"])


def test_a_trajectory_is_of_those_that_have_the_gene():
    peaks = ((510.0, 350.0), (510.0, 370.0), (510.0, 390.0), (500.0,))
    members = [candidate(i, 0, i, float(i), lambda_max_nm=p) for i, p in enumerate(peaks)]
    path = trajectory(members, lambda p: gene_values(p)["lambda_max_1_nm"])
    assert path.median.tolist() == [370.0]
    assert np.isnan(path.best[0])  # the best animal has one type only


def test_bootstrap_covers_the_mean():
    """The percentile interval of 30 normal samples has a coverage of 93-95 %. 500 intervals measure it to about 1 %."""
    random = np.random.default_rng(1)
    hits = 0
    for _ in range(500):
        low, high = bootstrap_interval(random.normal(5.0, 2.0, 30))
        hits += low <= 5.0 <= high
    assert 0.90 <= hits / 500 <= 0.97


def test_bootstrap_width_is_that_of_the_standard_error():
    samples = np.random.default_rng(2).normal(0, 1, 400)
    low, high = bootstrap_interval(samples)
    assert high - low == pytest.approx(2 * 1.96 * samples.std() / 20, rel=0.08)  # 2000 resamples give each end to 5 %


def test_bootstrap_takes_other_statistics_and_levels():
    samples = [1.0, 2.0, 3.0, 4.0, 100.0]
    assert bootstrap_interval(samples, np.median)[1] <= 100.0
    wide, narrow = (bootstrap_interval(samples, level=level) for level in (0.99, 0.5))
    assert wide[0] < narrow[0] < narrow[1] < wide[1]


def test_bootstrap_is_seeded():
    samples = np.random.default_rng(3).normal(size=9)
    assert bootstrap_interval(samples, seed=4) == bootstrap_interval(samples, seed=4)
    assert bootstrap_interval(samples, seed=4) != bootstrap_interval(samples, seed=5)


def test_a_single_sample_has_no_interval():
    assert all(math.isnan(end) for end in bootstrap_interval([3.0]))


@pytest.mark.parametrize(
    ("samples", "level", "says"),
    [([], 0.95, "samples"), ([1.0, math.nan], 0.95, "samples"), ([1.0], 1.0, r"level = 1.0: must be in \(0, 1\)")],
)
def test_bootstrap_refuses(samples, level, says):
    with pytest.raises(ValueError, match=says):
        bootstrap_interval(samples, level=level)


def test_psnr():
    reference = np.full((4, 3, 2, 2), 0.5)
    assert psnr(reference + 0.1, reference) == pytest.approx(20.0)
    assert psnr((reference + 0.1) / 4, reference, gain=4.0) == pytest.approx(20.0)
    assert psnr(reference, reference) == math.inf
    with pytest.raises(ValueError, match="shape"):
        psnr(reference[:1], reference)
