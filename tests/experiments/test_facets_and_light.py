"""Eyes of equal surface, and the effect of light on the slope of fitness, against results that are known."""

import math
from dataclasses import asdict

import numpy as np
import pytest

from experiments.designed import Trained
from experiments.facets_and_light import (
    FACETS,
    LIGHTS,
    SETTINGS,
    best_octave,
    complete,
    designs,
    eye_parameter,
    shift,
    slope,
)


def trained(best):
    """Return rows whose fitness is a parabola in log2 p with its maximum at `best(light, seed)`."""
    rows = []
    for design in designs():
        octaves = math.log2(eye_parameter(design.width)) - best(float(design.own.partition("=")[2]), design.seed)
        rows.append(Trained(**asdict(design), fitness=design.seed % 7 - 3 * octaves**2))
    return rows


def test_facets_of_all_eyes_have_the_same_surface_and_fit_on_the_head():
    for design in designs()[: len(FACETS)]:
        animal, config = design.animal, design.config(SETTINGS)
        hexagons = animal.n_eyes * math.prod(animal.resolution) * math.sqrt(3) / 2
        assert hexagons * (1e-6 * animal.facet_diameter_um) ** 2 == pytest.approx(config.eye.facet_area)
        assert config.eye.compound
        assert design.own == f"eye.illuminance={config.eye.illuminance:g}"


def test_wider_facets_receive_more_photons_and_have_larger_eye_parameters():
    eyes = [design.animal.eyes(design.config(SETTINGS).eye).eye() for design in designs()[: len(FACETS)]]
    photons = [eye.photons.mean() for eye in eyes]
    assert photons == sorted(photons)
    assert [eye_parameter(across) for across in FACETS] == sorted(eye_parameter(across) for across in FACETS)


def test_the_best_eye_is_found_within_the_range_of_the_eyes():
    rows = trained(lambda light, seed: {1e4: 0.5, 30.0: 1.0, 1.0: 9.0}[light])
    assert [best_octave(rows, 2711, light) for light in LIGHTS[:2]] == pytest.approx([0.5, 1.0], abs=4e-3)
    assert best_octave(rows, 2711, LIGHTS[2]) == math.log2(max(map(eye_parameter, FACETS)))


def test_a_shift_is_judged_by_seeds():
    rows = trained(lambda light, seed: 0.5 + (light < LIGHTS[0]))
    change, p = shift(rows, 1.0)
    assert change.mean == pytest.approx(1.0, abs=8e-3)
    assert p == 0.5 ** len(complete(rows))


def test_chance_gives_no_small_p():
    rows = trained(lambda light, seed: 0.5 + 0.2 * (-1) ** seed * (light < LIGHTS[0]))
    change, p = shift(rows, 1.0)
    assert change.mean == pytest.approx(0.0, abs=8e-3)
    assert p > 0.3


def test_seeds_without_all_their_runs_are_left_out():
    rows = trained(lambda light, seed: 0.5)
    first = rows[0].seed
    assert complete(rows[1:]) == [seed for seed in complete(rows) if seed != first]
    assert np.isfinite(shift(rows[1:], 30.0)[0].mean)


def test_the_slope_is_the_change_of_fitness_per_doubling():
    rows = [
        Trained(**asdict(design), fitness=7 + 3 * math.log2(eye_parameter(design.width)) * (design.seed == 2712))
        for design in designs()
    ]
    assert [slope(rows, seed, 30.0) for seed in (2711, 2712)] == pytest.approx([0.0, 3.0])
