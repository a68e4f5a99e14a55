"""The page's measurement at a small size; its bounds fail for results that violate them."""

import contextlib
import time

import pytest

from validation.benchmarks import steps_per_second


@pytest.fixture(autouse=True)
def _small(monkeypatch):
    monkeypatch.setattr(steps_per_second, "ROUNDS", 1)
    monkeypatch.setattr(steps_per_second, "SECONDS", 0.01)


def rows(physics=100.0, sight=300.0, both=70.0, worlds=64):
    alone = steps_per_second.Row("ant", 1, {"physics": 50.0, "sight": 100.0, "both": 20.0})
    return [alone, steps_per_second.Row("ant", worlds, {"physics": physics, "sight": sight, "both": both})]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["detection", "ant"])
def test_every_part_is_measured(name, tmp_path, capsys):
    found = steps_per_second.measure(name, sizes=(1, 3))
    assert [row.worlds for row in found] == [1, 3]
    for row in found:
        assert [*row.rates] == ["physics", "sight", "both"]
        assert min(row.rates.values()) > 0
        assert 0 < row.share < 1
    assert capsys.readouterr().out.count(name) == 2
    steps_per_second.draw_figure(found, tmp_path / "figure.png")
    assert (tmp_path / "figure.png").stat().st_size > 5000


def test_parts_do_what_they_are_called():
    """The part "physics" moves the worlds without rendering, "sight" renders without moving, and a step does both."""
    with contextlib.closing(steps_per_second.environments()["ant"](2)) as env:
        env.reset()
        (sight,) = env.animals.learners[0].sights.values()
        worlds, looks = env.simulation, []
        begin = sight.renderer.launch
        sight.renderer.launch = lambda *seen: looks.append(1) or begin(*seen)
        found = {}
        for name, part in steps_per_second.parts_of(env).items():
            steps, seen = worlds.steps[0], len(looks)
            part()
            found[name] = (worlds.steps[0] - steps, len(looks) - seen)
    assert found == {"physics": (1, 0), "sight": (0, 1), "both": (1, 1)}


def test_share_and_overhead_are_of_times():
    _, row = rows()
    assert row.share == pytest.approx(0.25)
    assert row.overhead == pytest.approx((1 / 70) / (1 / 100 + 1 / 300))


@pytest.mark.parametrize(
    ("found", "broken"),
    [
        (rows(), []),
        (rows(sight=150.0, both=60), ["ant, 64 worlds: rendering is 1.5 times as fast as for one world"]),
        (rows(both=50.0), ["ant, 64 worlds: a step takes 1.50x the sum of its parts"]),
        (rows(both=50.0, worlds=16), []),
    ],
)
def test_bounds(found, broken):
    assert steps_per_second.broken_bounds(found) == broken


def test_cpu_time_is_of_one_step():
    def busy():
        began = time.process_time()
        while time.process_time() - began < 0.002:
            pass

    assert 0.002 <= steps_per_second.timed(busy, 10) < 0.01
