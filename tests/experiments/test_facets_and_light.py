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
    change_of_slope,
    complete,
    designs,
    eye_parameter,
    slope,
)


def trained(gain):
    """Return rows whose fitness is a mean of the seed, plus `gain(light, seed)` for each doubling of p."""
    rows = []
    for design in designs():
        octaves = math.log2(eye_parameter(design.width))
        light = float(design.own.partition("=")[2])
        rows.append(Trained(**asdict(design), fitness=design.seed % 7 + gain(light, design.seed) * octaves))
    return rows


def test_facets_of_all_eyes_have_the_same_surface_and_fit_on_the_head():
    for design in designs()[: len(FACETS)]:
        animal, config = design.animal, design.config(SETTINGS)
        hexagons = animal.n_eyes * math.prod(animal.resolution) * math.sqrt(3) / 2
        assert hexagons * (1e-6 * animal.facet_diameter_um) ** 2 == pytest.approx(
            config.eye.facet_area
        )
        assert config.eye.compound
        assert design.own == f"eye.illuminance={config.eye.illuminance:g}"


def test_wider_facets_receive_more_photons_and_have_larger_eye_parameters():
    eyes = [design.animal.eyes(design.config(SETTINGS).eye).eye() for design in designs()[: len(FACETS)]]
    photons = [eye.photons.mean() for eye in eyes]
    assert photons == sorted(photons)
    assert [eye_parameter(across) for across in FACETS] == sorted(eye_parameter(across) for across in FACETS)


def test_slopes_are_found_and_their_change_is_judged_by_seeds():
    rows = trained(lambda light, seed: 3.0 - math.log10(light))
    assert slope(rows, rows[0].seed, 100.0) == pytest.approx(1.0)
    change, p = change_of_slope(rows, 1.0)
    assert change.mean == pytest.approx(4.0)
    assert p == 0.5 ** len(complete(rows))


def test_chance_gives_no_small_p():
    signs = {seed: (-1) ** seed for seed in range(2711, 2717)}
    rows = trained(lambda light, seed: signs[seed] * (light < LIGHTS[0]))
    change, p = change_of_slope(rows, 1.0)
    assert change.mean == pytest.approx(0.0, abs=1e-9)
    assert p > 0.5


def test_seeds_without_all_their_runs_are_left_out():
    rows = trained(lambda light, seed: 0.0)
    first = rows[0].seed
    assert complete(rows[1:]) == [seed for seed in complete(rows) if seed != first]
    assert np.isfinite(change_of_slope(rows[1:], 10.0)[0].mean)
