"""The chart's bounds hold for a chart as it should be, and each complains where its own is broken."""

from dataclasses import replace

import pytest

from validation import D1_speed_accuracy as D1
from validation.D1_speed_accuracy import Chart, Point, Setting

AUTO = Point(D1.SETTINGS[0], error=0.5, sampling=0.4, rays=1, speed=900)


@pytest.fixture
def chart():
    """Errors fall like n^-0.7, speed like 1/n; auto picked one ray."""
    series = [
        Point(s, error=0.1 + 0.4 * s.rays**-0.7, sampling=0.4 * s.rays**-0.7, rays=s.rays, speed=1000 / s.rays)
        for s in D1.RAYS
    ]
    slow = Point(Setting("reference", 4, light="path"), error=0.05, sampling=0.2, rays=4, speed=1)
    return Chart("a field", (AUTO, *series, slow), reference_error=0.02, direct=0.1)


def with_auto(chart, **changes):
    return replace(chart, points=(replace(AUTO, **changes), *chart.points[1:]))


def test_a_sound_chart_passes(chart):
    assert D1.broken_bounds([chart]) == []


def test_the_front_is_what_no_point_beats(chart):
    front = chart.front
    assert [p.setting.rays for p in front] == [0.25, 1, 4, 16, 64, 256, 4]
    beaten = Point(Setting("mitsuba", 1), error=0.6, sampling=0.5, rays=1, speed=800)
    assert replace(chart, points=(*chart.points, beaten)).front == front


@pytest.mark.parametrize(
    ("spoil", "complaint"),
    [
        (lambda c: with_auto(c, speed=700), "auto makes 700 steps/s"),
        (lambda c: with_auto(c, sampling=0.6), "0.60 σ beside converged"),
        (lambda c: replace(c, reference_error=0.3), "good to 0.30 σ only"),
        (lambda c: replace(c, points=tuple(replace(p, sampling=0.3) if p.rays == 64 else p for p in c.points)), "fall"),
    ],
)
def test_what_is_wrong_is_named(chart, spoil, complaint):
    broken = D1.broken_bounds([spoil(chart)])
    assert len(broken) == 1
    assert complaint in broken[0]


def test_table_and_figure_show_all_points(chart, tmp_path):
    rows = D1.table([chart]).splitlines()
    assert len(rows) == 2 + len(chart.points)
    assert sum("front" in row for row in rows) == len(chart.front)
    D1.draw([chart, chart], tmp_path / "chart.png")
    assert (tmp_path / "chart.png").stat().st_size > 10_000
