"""Random sequences of answers and heartbeats: a silence is as long as the time since the last sign of life."""

import random

import pytest

from evolve.search.signs_of_life import SignsOfLife

PATIENCE_S, REGULAR_S = 10.0, 2.0


def worker(last_seen, status="running", executing=()):
    return {"last_seen": last_seen, "status": status, "metrics": {"executing": dict.fromkeys(executing, 1.0)}}


def signs(*answers, passed=1.0):
    """Return signs of life after answers at regular intervals."""
    found = SignsOfLife(PATIENCE_S, REGULAR_S)
    for answer in answers:
        found.wait(passed)
        found.answer(answer)
    return found


@pytest.mark.parametrize("seed", range(20))
def test_silence_begins_at_the_last_heartbeat_of_any_worker(seed):
    rng = random.Random(seed)
    found, beats, since = SignsOfLife(PATIENCE_S, REGULAR_S), {"a": 0, "b": 0, "c": 0}, dict.fromkeys("abc", 0.0)
    found.answer({name: worker(beat) for name, beat in beats.items()})
    for _ in range(rng.randrange(1, 40)):
        passed = rng.uniform(0.1, REGULAR_S)
        found.wait(passed)
        for name in beats:
            alive = rng.random() < 0.2
            beats[name] += alive
            since[name] = 0.0 if alive else since[name] + passed
        found.answer({name: worker(beat) for name, beat in beats.items()})
        shortest = min(since.values())
        assert found.silence_s == pytest.approx(shortest, abs=1e-9)
        assert found.exhausted == (found.silence_s >= PATIENCE_S)
        lost = {name for name, silence in since.items() if silence >= PATIENCE_S}
        assert set(found.lost_workers) == (set() if shortest >= PATIENCE_S else lost)


def test_a_worker_that_was_removed_is_not_lost_again():
    found = signs(*({"a": worker(1), "b": worker(beat)} for beat in range(12)))
    assert found.lost_workers == ("a",)
    found.forget("a")
    assert found.lost_workers == ()
    found.wait(1.0)
    found.answer({"a": worker(1), "b": worker(13)})
    assert found.lost_workers == ()


def test_a_training_may_take_longer_than_the_patience():
    found = signs(*({"a": worker(beat, executing=["job"])} for beat in range(100)))
    assert found.silence_s == 0.0
    assert not found.exhausted


def test_workers_are_not_blamed_for_the_silence_of_the_scheduler():
    found = signs({"a": worker(1)})
    found.wait(9.0)
    assert (found.silence_s, found.missing) == (9.0, "an answer of the scheduler")
    found.answer({"a": worker(1)})
    assert (found.silence_s, found.missing) == (REGULAR_S, "a heartbeat of worker a")
    found.wait(11.0)
    assert found.exhausted
    assert found.lost_workers == ()


@pytest.mark.parametrize(
    ("workers", "missing"),
    [
        ({}, "a worker (none is connected)"),
        ({"a": worker(1)}, "a heartbeat of worker a"),
        ({name: worker(1) for name in "ab"}, "a heartbeat of workers a, b"),
        ({name: worker(1) for name in "abc"}, "a heartbeat of workers a, b, c"),
        ({name: worker(1) for name in "abcd"}, "a heartbeat of workers a, b, c and 1 more"),
        ({name: worker(1) for name in "abcde"}, "a heartbeat of workers a, b, c and 2 more"),
        ({"a": worker(1, "paused"), "b": worker(1)}, "a heartbeat of worker b"),
        (
            {"a": worker(1, "paused")},
            "a worker that accepts candidates (worker a paused, usually for lack of memory)",
        ),
    ],
)
def test_the_missing_sign_of_life_is_named(workers, missing):
    found = signs(*[workers] * 12)
    assert found.missing == missing
    assert found.exhausted


@pytest.mark.parametrize("executing", [(), ("job",)])
def test_paused_workers_are_alive_while_they_evaluate(executing):
    found = signs(*({"a": worker(beat, "paused", executing)} for beat in range(12)))
    assert found.exhausted == (not executing)
    assert found.usable == len(executing)


def test_workers_that_join_are_alive():
    found = signs({}, {}, {"a": worker(5)})
    assert (found.silence_s, found.usable) == (0.0, 1)
    assert signs({"a": worker(5)}, {}, {"a": worker(5)}).silence_s == 0.0
