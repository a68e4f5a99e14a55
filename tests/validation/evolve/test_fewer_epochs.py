"""The page agrees with its store."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from validation.evolve import fewer_epochs
from validation.evolve.fewer_epochs import (
    FEWER,
    THROUGHOUT,
    Life,
    lived,
    pairs,
    passes_until,
    read,
    seconds,
    verdicts,
    write,
)

ROOT = Path(__file__).parents[3]
LIFE = Life("detection", 0, THROUGHOUT, 200.0, 90.0, 0.75, (10.0, 50.0, 90.0))


def lives(gains, saved=50.0, tasks=fewer_epochs.EYES):
    """Return a pair of training runs for each task and gain. The run with fewer epochs has a fitness that is higher by
    the gain, and takes `saved` seconds less.
    """
    found = []
    for task in tasks:
        for seed, gain in enumerate(gains):
            old = replace(LIFE, task=task, seed=seed)
            curve = tuple(value + gain for value in old.curve)
            new = replace(old, least_epochs=FEWER, cpu_seconds=old.cpu_seconds - saved, curve=curve)
            found += [old, new]
    return found


def test_lives_survive_the_file(tmp_path):
    written = lives([0.0, 1.5])
    write(written[::-1], tmp_path / "fewer_epochs.csv")
    assert sorted(read(tmp_path / "fewer_epochs.csv"), key=str) == sorted(written, key=str)
    assert read(tmp_path / "none.csv") == []


def test_only_lives_that_were_trained_in_both_ways_are_compared():
    two = lives([0.0, 0.0], tasks=["detection"])
    assert pairs([*two, replace(LIFE, seed=7)], "detection") == [(two[0], two[1]), (two[2], two[3])]


def test_bounds():
    """Gains of -3 to -1 have a mean of -2 with a standard error of 0.35. Gains of -4 to 2 have a mean of -1 with a
    standard error of 1.14.
    """
    assert verdicts(lives([1, 2, 3, 4, 5])) == verdicts(lives([-4, -3, -1, 1, 2])) == []
    assert verdicts(lives([-3, -2.5, -2, -1.5, -1], tasks=["detection"]))[0] == (
        "detection: fewer epochs reduce the return, by 2.0 ± 0.4"
    )
    assert len(verdicts(lives([0, 0, 0, 0, 0], saved=9.0))) == 3
    assert "five are required" in verdicts(lives([0, 0, 0, 0]))[0]


def test_time_is_spread_as_passes_are():
    """The times of all parts add up to the whole time. An epoch costs the same early and late in training."""
    times = seconds("detection", (200.0, 140.0), 10)
    assert times[:, -1] == pytest.approx([200, 140])
    assert np.diff(times[0]) == pytest.approx([20.0] * 9)
    passes = passes_until("detection", FEWER, 10)
    assert passes[0] == 10
    assert passes[-1] == 4
    spared, sooner = (10 - passes)[3:], 20 - np.diff(times[1])[2:]
    assert sooner == pytest.approx(spared * sooner[0] / spared[0])
    assert (spared > 0).all()


@pytest.mark.slow
def test_a_life_is_trained_with_the_passes_asked_for(monkeypatch):
    """Training has one rollout, then another one after the learning rate has dropped."""
    small = ("learning.total_steps=64", "learning.n_envs=4", "learning.n_steps=8", "learning.batch_size=16")
    monkeypatch.setattr(
        fewer_epochs, "SETTINGS", (*fewer_epochs.SETTINGS, *small, "learning.decay_after=16", "evaluation.episodes=2")
    )
    old, new = (lived("navigation", 1, passes) for passes in (THROUGHOUT, FEWER))
    assert (old.least_epochs, new.least_epochs) == (THROUGHOUT, FEWER)
    assert old.curve != new.curve
    assert old.cpu_seconds > 0


def test_page_is_the_stores(tmp_path):
    fewer_epochs.main(["--stored", str(ROOT / fewer_epochs.STORED), "--out", str(tmp_path), "--docs", str(tmp_path)])
    page = (ROOT / "docs/validation/fewer_epochs.md").read_text(encoding="utf-8")
    assert (tmp_path / "fewer_epochs.md").read_text(encoding="utf-8") == page
