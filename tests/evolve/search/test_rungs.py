"""Rungs of successive halving: lengths of trainings, and who reaches which rung, from given records."""

import math
from types import SimpleNamespace

import pytest

from evolve.config.run_config import SearchConfig
from evolve.search.successive_halving import complete, finished, promoted, reaching, sizes, steps, trained_steps


@pytest.mark.parametrize(
    ("interval", "begin", "end", "trained"),
    [
        (30, 0, 30, 32),
        (30, 0, 33, 40),
        (30, 0, 60, 64),
        (32, 0, 64, 64),
        (8, 16, 17, 24),
        (8, 16, 16, 16),
        (1, 0, 9, 16),
    ],
)
def test_training_consists_of_whole_rollouts(interval, begin, end, trained):
    """A rollout has 8 steps, so that 30 steps between evaluations become 32."""
    learning = SimpleNamespace(n_envs=2, n_steps=4, eval_interval=interval)
    assert trained_steps(learning, begin, end) == trained


def test_a_generation_is_complete_when_all_rungs_are_on_record():
    """The two fittest of four candidates reach the second rung, unless one of them failed in the first."""
    record = {}
    search = SearchConfig(generations=2, population=4, rungs=2, promoted=0.5)
    run = SimpleNamespace(
        config=SimpleNamespace(search=search), on_record=lambda candidate_id, rung: record.get((candidate_id, rung))
    )
    for candidate_id, fitness in enumerate((1.0, -math.inf, 3.0, 2.0)):
        assert not complete(run, 0)
        assert reaching(run, 0, 1) == set()
        record[candidate_id, 0] = SimpleNamespace(id=candidate_id, fitness=fitness)
    assert reaching(run, 0, 0) == {0, 1, 2, 3}
    assert reaching(run, 0, 1) == {2, 3}
    for candidate_id in (2, 3):
        assert not complete(run, 0)
        record[candidate_id, 1] = SimpleNamespace(id=candidate_id, fitness=0.0)
    assert complete(run, 0)
    assert not finished(run)
    record.update({(k + 4, 0): SimpleNamespace(id=k + 4, fitness=-math.inf) for k in range(4)})
    assert finished(run)


def test_of_equal_candidates_the_lower_ids_are_promoted_in_any_order():
    search = SearchConfig(population=5, rungs=3, promoted=0.5)
    assert sizes(search) == (5, 3, 2)
    equal = [(number, 2.0) for number in (9, 4, 7, 5, 3)]
    assert promoted(search, 0, equal) == {3, 4, 5}
    assert promoted(search, 1, [(9, 2.0), (4, 1.0), (7, 2.0)]) == {7, 9}
    assert promoted(search, 1, [(9, 2.0), (4, -math.inf), (7, math.nan)]) == {9}
    assert promoted(search, 2, equal) == set()


@pytest.mark.parametrize(("total_steps", "rungs", "expected"), [(9, 1, 3 * 4 * 16), (17, 2, 3 * (4 * 16 + 2 * 8))])
def test_steps_of_a_run_are_those_of_whole_rollouts(total_steps, rungs, expected):
    """A rollout has 8 steps. With two rungs, the first one ends after 9 steps, and so after two rollouts."""
    learning = SimpleNamespace(n_envs=2, n_steps=4, eval_interval=8, total_steps=total_steps)
    search = SearchConfig(generations=3, population=4, rungs=rungs, promoted=0.5)
    assert steps(SimpleNamespace(search=search, learning=learning)) == expected
