"""The chart's bounds hold for a chart as it should be, and each complains where its own is broken."""

import csv
from dataclasses import replace

import pytest

import sim
from validation import D1_speed_accuracy as D1
from validation.scenes import SCENES, lived_through
from validation.speed_accuracy import Chart, Point, Setting, draw, rows_of, table
from validation.stored import write_table

AUTO = Point(D1.SETTINGS[0], error=0.45, sampling=0.4, speed=900, fidelity=sim.Fidelity(1.5, 8, light="bounce"))


def series(light):
    """Errors fall like n^-0.7 to what is left of the light, speed like 1/n."""
    left = {"direct": 0.3, "bounce": 0.05}[light]
    return [
        Point(Setting("closed_form", n, light=light), left + 0.4 * n**-0.7, 0.4 * n**-0.7, 1000 / n, sim.Fidelity(n, 4))
        for n in D1.RAYS
    ]


@pytest.fixture
def chart():
    slow = Point(Setting("reference", 4, light="path"), error=0.05, sampling=0.2, speed=1)
    points = (AUTO, *series("direct"), *series("bounce"), slow)
    return Chart("a field", points, reference_error=0.02, left={"direct": 0.3, "bounce": 0.05})


def with_auto(chart, **changes):
    return replace(chart, points=(replace(AUTO, **changes), *chart.points[1:]))


def flat(chart, light):
    spoilt = Setting("closed_form", 64, light=light)
    return replace(chart, points=tuple(replace(p, sampling=0.3) if p.setting == spoilt else p for p in chart.points))


def test_a_sound_chart_passes(chart):
    assert D1.broken_bounds([chart]) == []


def test_the_front_is_what_no_point_beats(chart):
    assert [(p.setting.rays, p.setting.light) for p in chart.front] == [*((n, "bounce") for n in D1.RAYS), (4, "path")]
    speeds, errors = ([getattr(p, name) for p in chart.front] for name in ("speed", "error"))
    assert speeds == sorted(speeds, reverse=True)
    assert errors == sorted(errors, reverse=True)
    beaten = Point(Setting("mitsuba", 1), error=0.9, sampling=0.5, speed=800)
    assert replace(chart, points=(*chart.points, beaten)).front == chart.front


@pytest.mark.parametrize(
    ("spoil", "complaint"),
    [
        (lambda c: with_auto(c, speed=700), "auto makes 700 steps/s"),
        (lambda c: with_auto(c, error=0.6), "auto errs by 0.60 σ"),
        (lambda c: replace(c, reference_error=0.3), "good to 0.30 σ only"),
        (lambda c: flat(c, "direct"), "direct light do not fall"),
        (lambda c: flat(c, "bounce"), "bounce light do not fall"),
    ],
)
def test_what_is_wrong_is_named(chart, spoil, complaint):
    broken = D1.broken_bounds([spoil(chart)])
    assert len(broken) == 1
    assert complaint in broken[0]


def test_table_figure_and_stored_rows_show_all_points(chart, tmp_path):
    lines = table([chart]).splitlines()
    assert sum("front" in line for line in lines[2:]) == len(chart.front)
    assert sum(line.startswith("auto    ") for line in lines) == 1
    draw([chart, chart, chart], tmp_path / "chart.png")
    assert (tmp_path / "chart.png").stat().st_size > 10_000
    write_table(tmp_path / "data" / "D1.csv", rows_of([chart]))
    with (tmp_path / "data" / "D1.csv").open(encoding="utf-8", newline="") as file:
        stored = list(csv.DictReader(file))
    assert len(stored) == len(chart.points)
    assert stored[0]["light"] == "bounce"
    assert [p.name for p in (tmp_path / "data").iterdir()] == ["D1.csv"]


def test_a_measured_chart_has_every_setting():
    """Of a small scene, with few samples: all that the full run does."""
    eyes = sim.Eyes(n_eyes=1, resolution=(2, 3), fov_deg=40)
    scene = replace(SCENES[0], eyes=eyes)
    settings = [D1.SETTINGS[0], Setting("closed_form", 4), Setting("closed_form", 4, 8, "bounce", 3), D1.SETTINGS[-1]]
    assert D1.SETTINGS[-1].light == "path"
    chart = D1.measure(scene, settings, states=1, rounds=1, spp=4)
    assert [p.setting for p in chart.points] == settings
    assert all(p.speed > 0 and p.error > 0 for p in chart.points)
    assert chart.auto.fidelity.tolerance == 0.005
    assert lived_through(sim.build_world("detection"), 2, steps=1).n == 2
