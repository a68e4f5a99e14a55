"""Searches for eyes in mazes and in detection: equal genomes and learners."""

import numpy as np
import pytest

from evolve.search.optimizers import Space, build_optimizer
from experiments.eye_searches import PRICES, Search, searches


def test_only_the_world_differs_between_the_tasks_of_a_group():
    for kind, seed in {(one.kind, one.seed) for one in searches()}:
        maze, detection = (Search(task, kind, seed).config for task in ("maze", "detection"))
        for section in ("seed", "eye", "genome", "search", "learning", "wiring", "costs"):
            assert getattr(maze, section) == getattr(detection, section), (kind, seed, section)
        assert maze.world.family_seed == seed


def test_groups_differ_in_prices_or_in_the_optimizer():
    free, priced, random = (Search("maze", kind, 0).config for kind in ("free", "priced", "random"))
    assert free.costs.free
    assert [f"costs.{name}={getattr(priced.costs, name):g}" for name in ("per_receptor", "per_eye")] == list(PRICES)
    assert (free.search.optimizer, random.search.optimizer) == ("CMA", "LHSSearch")
    assert free.search.population * free.search.generations == random.search.population * random.search.generations


def test_random_search_proposes_uniformly_distributed_genomes():
    space = Space(genes=(), start=np.full(3, 0.1), seed=(0,))
    optimizer = build_optimizer(space, Search("maze", "random", 0).config.search)
    drawn = []
    for number in range(192):
        drawn.append(optimizer.ask(number)[0])
        optimizer.tell(number, float(number))
    drawn = np.array(drawn)
    assert drawn.mean(axis=0) == pytest.approx(np.full(3, 0.5), abs=0.01)
    assert drawn.std(axis=0) == pytest.approx(np.full(3, 1 / np.sqrt(12)), abs=0.01)
