"""Searches for eyes in mazes and in detection: equal genomes and learners, and runs that are continued."""

from dataclasses import replace

import numpy as np
import pytest

from evolve.config.assemble import assemble
from evolve.search.optimizers import Space, build_optimizer
from evolve.search.successive_halving import trained_steps
from experiments import eye_searches
from experiments.eye_factors_design import LEARNER
from experiments.eye_searches import PRICES, Search, command, main, searches


def test_only_the_world_differs_between_the_tasks_of_a_group():
    for kind, seed in {(one.kind, one.seed) for one in searches()}:
        maze, detection = (Search(task, kind, seed).config for task in ("maze", "detection"))
        for section in ("seed", "eye", "genome", "search", "learning", "wiring", "costs"):
            assert getattr(maze, section) == getattr(detection, section), (kind, seed, section)
        assert maze.world.family_seed == seed


def test_training_runs_are_the_beginning_of_those_in_the_experiment_on_factors_of_eyes():
    full = assemble("maze", assignments=LEARNER).learning
    short = Search("maze", "free", 0).config.learning
    assert replace(short, total_steps=full.total_steps, eval_interval=full.eval_interval) == full
    assert trained_steps(short, 0, short.total_steps) == 106_496


def test_all_searches_without_prices_come_first_and_both_tasks_of_a_seed_together():
    kinds = [one.kind for one in searches()]
    assert kinds == ["free"] * 6 + ["priced"] * 6 + ["random"] * 2
    assert [one.task for one in searches()] == ["maze", "detection"] * 7
    assert all(one.seed == other.seed for one, other in zip(searches()[::2], searches()[1::2], strict=True))


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


def test_an_existing_run_is_continued_and_the_next_one_is_started(tmp_path, monkeypatch):
    called = []
    monkeypatch.setattr(eye_searches, "evolve", lambda arguments: called.append(arguments) or 0)
    first, second, *rest = searches()
    (tmp_path / first.name).mkdir()
    assert main([str(tmp_path)]) == 0
    assert called[0] == ["resume", str(tmp_path / first.name)]
    assert called[1] == command(second, tmp_path, 1)
    assert called[1][:2] == ["run", second.task]
    assert len(called) == 2 + len(rest)


def test_a_failed_search_ends_the_command_with_its_exit_code(tmp_path, monkeypatch):
    monkeypatch.setattr(eye_searches, "evolve", lambda arguments: 2)
    assert main([str(tmp_path)]) == 2


def test_without_a_directory_the_command_names_what_is_missing(capsys):
    with pytest.raises(SystemExit):
        main([])
    assert "DIR: missing" in capsys.readouterr().err
