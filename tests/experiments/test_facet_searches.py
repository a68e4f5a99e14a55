"""Searches for compound eyes in two lights: only the light differs, and facets compete for the surface."""

import math
from dataclasses import replace

import numpy as np

from evolve.genome.phenotype import develop
from evolve.search.search import Search
from experiments.facet_searches import LIGHTS, LOOKS, OPEN, searches
from experiments.facets_and_light import SETTINGS, designs


def test_only_light_and_seed_differ_between_the_searches():
    configs = [one.config for one in searches()]
    assert len(configs) == len(LIGHTS) * max(LOOKS)
    assert [one.eye.illuminance for one in configs[:4]] == [*LIGHTS.values()] * 2
    alike = [replace(one, seed=0, eye=replace(one.eye, illuminance=0.0)) for one in configs]
    assert all(one == alike[0] for one in alike)
    assert len({one.seed for one in configs}) == len(configs)


def test_the_learner_is_that_of_the_experiment_without_evolution():
    assert searches()[0].config.learning == designs()[0].config(SETTINGS).learning


def test_the_first_animals_differ_in_their_eye_parameter_and_most_of_them_fill_the_surface():
    config = searches()[0].config
    assert {name for name, use in config.genome.items() if use.open} == set(OPEN)
    animals = [
        develop(proposal.vector, config)
        for seed in range(20)
        for proposal in Search(replace(config, seed=seed)).propose_generation()
    ]
    widths = np.array([1e-6 * one.facet_diameter_um for one in animals])
    area = math.sqrt(3) / 2 * widths**2 * [one.n_eyes * math.prod(one.resolution) for one in animals]
    assert np.median(area / config.eye.facet_area) > 0.95
    parameters = widths * np.radians([one.fov_deg / one.resolution[1] for one in animals]) / 500e-9
    assert parameters.min() < 1.2 < 4.5 < parameters.max()
