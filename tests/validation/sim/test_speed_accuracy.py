"""The chart's bounds hold for a correct chart, and each bound reports its violation."""

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import sim
from tests.sim.tracing import area_views
from validation.pages.tables import write_table
from validation.sim import speed_accuracy
from validation.sim.scenes import NEAR, SCENES, facing_objects, lived_through, sees_object
from validation.sim.speed_accuracy_figure import draw, message
from validation.sim.speed_accuracy_points import Chart, Errors, Point, Setting, rows_of, table

DOCS = Path(__file__).parents[3] / "docs/validation"
AUTO = Point(
    speed_accuracy.AUTO,
    Errors(0.3, 0.45),
    sampling=0.4,
    speed=900,
    fidelity=sim.Fidelity(1, 8, light="all", samples="areas"),
)


def series(light):
    """Return settings whose errors fall like n^-0.7 to the error of the missing light, and are higher on objects. Their
    speed falls like 1/n.
    """
    left = {"direct": 0.3, "bounce": 0.05}[light]
    return [
        Point(
            Setting("closed_form", n, light=light),
            Errors(left + 0.4 * n**-0.7, 0.1 + left + 0.4 * n**-0.7),
            0.4 * n**-0.7,
            800 / n,
            sim.Fidelity(n, 4, light=light),
        )
        for n in speed_accuracy.PERFECT_RAYS
    ]


@pytest.fixture
def chart():
    slow = Point(Setting("reference", 4, light="path"), Errors(0.05, 0.05), sampling=0.2, speed=1)
    points = (AUTO, *series("direct"), *series("bounce"), slow)
    left = {"direct": Errors(0.3, 0.4), "bounce": Errors(0.05, 0.15)}
    return Chart("a field", points, Errors(0.02, 0.03), left)


def with_auto(chart, **changes):
    return replace(chart, points=(replace(AUTO, **changes), *chart.points[1:]))


def flat(chart, light):
    spoilt = Setting("closed_form", 64, light=light)
    return replace(chart, points=tuple(replace(p, sampling=0.3) if p.setting == spoilt else p for p in chart.points))


def without_objects(chart):
    points = tuple(replace(p, error=Errors(p.error.everywhere)) for p in chart.points)
    return replace(chart, points=points, reference_error=Errors(0.02))


def test_a_sound_chart_passes(chart):
    assert speed_accuracy.broken_bounds([chart, without_objects(chart)]) == []


def test_the_front_is_what_no_point_beats(chart):
    found = [(p.setting.samples, p.light) for p in chart.front]
    assert found == [(None, "all"), *((n, "bounce") for n in speed_accuracy.PERFECT_RAYS[1:]), (4, "path")]
    speeds, errors = [p.speed for p in chart.front], [p.error.worst for p in chart.front]
    assert speeds == sorted(speeds, reverse=True)
    assert errors == sorted(errors, reverse=True)
    beaten = Point(Setting("mitsuba", 1), Errors(0.9, 0.9), sampling=0.5, speed=800)
    assert replace(chart, points=(*chart.points, beaten)).front == chart.front


def test_what_is_good_over_all_receptors_alone_is_not_on_the_front(chart):
    """A setting that is accurate over all receptors, but not on objects, is not compared with "auto" either, unless
    errors over all receptors are the criterion.
    """
    blind = Point(Setting("mitsuba", 1), Errors(0.01, 0.9), sampling=0.1, speed=850)
    charted = replace(chart, points=(*chart.points, blind))
    assert blind not in charted.front
    assert charted.rival == AUTO
    assert blind in charted.front_of(lambda errors: errors.everywhere)


@pytest.mark.parametrize(
    ("spoil", "complaint"),
    [
        (lambda c: with_auto(c, speed=100), "auto makes 100 steps/s"),
        (lambda c: with_auto(c, error=Errors(0.6, 0.4)), "auto has an error of 0.600 σ over all receptors"),
        (
            lambda c: with_auto(c, error=Errors(0.4, 0.6)),
            "auto has an error of 0.600 σ over receptors that see an object",
        ),
        (lambda c: replace(c, reference_error=Errors(0.3)), "standard error of the reference is 0.30 σ"),
        (lambda c: replace(c, reference_error=Errors(0.1, 0.3)), "standard error of the reference is 0.10 (0.30) σ"),
        (lambda c: flat(c, "direct"), "direct light do not fall"),
        (lambda c: flat(c, "bounce"), "bounce light do not fall"),
    ],
)
def test_what_is_wrong_is_named(chart, spoil, complaint):
    broken = speed_accuracy.broken_bounds([spoil(chart)])
    assert len(broken) == 1
    assert complaint in broken[0]


def test_a_promise_that_was_taken_back_by_a_warning_is_shown_and_no_broken_bound(chart):
    broken = with_auto(chart, error=Errors(0.4, 0.6))
    warned = with_auto(chart, error=Errors(0.4, 0.6), warning="1.3 times the allowed error")
    assert speed_accuracy.broken_bounds([broken])
    assert not speed_accuracy.broken_bounds([warned])
    for shown in (broken, warned):
        assert "exceeded: 0.600 σ over receptors that see an object" in table([shown])
        assert "exceeds σ/2 in 1 of 2 charts: up to 0.600 σ" in message([chart, shown])
    assert "auto: warning: 1.3 times the allowed error" in table([warned])
    assert "satisfied" in table([chart])
    assert "is below σ/2" in message([chart])


def test_table_figure_and_stored_rows_show_all_points(chart, tmp_path):
    lines = table([chart]).splitlines()
    assert sum(line.endswith("  front") for line in lines) == len(chart.front)
    assert sum(line.startswith("auto areas ") for line in lines) == 1
    assert "no objects in this world" in table([without_objects(chart)])
    draw([chart, chart, chart, without_objects(chart)], tmp_path / "chart.png")
    assert (tmp_path / "chart.png").stat().st_size > 10_000
    write_table(tmp_path / "data" / "speed_accuracy.csv", rows_of([chart]))
    with (tmp_path / "data" / "speed_accuracy.csv").open(encoding="utf-8", newline="") as file:
        stored = list(csv.DictReader(file))
    assert len(stored) == len(chart.points)
    assert (stored[0]["light"], stored[0]["how"], stored[0]["error_on_objects_sigma"]) == ("all", "areas", "0.45")
    assert [p.name for p in (tmp_path / "data").iterdir()] == ["speed_accuracy.csv"]


def test_the_stored_data_have_every_setting_of_every_scene():
    with (DOCS / "data/speed_accuracy.csv").open(encoding="utf-8", newline="") as file:
        stored = list(csv.DictReader(file))
    page = (DOCS / "speed_accuracy.md").read_text(encoding="utf-8")
    for scene in SCENES:
        rows = [row for row in stored if row["scene"] == scene.name]
        assert len(rows) == len(speed_accuracy.PERFECT_LENS if scene.aperture is None else speed_accuracy.BEHIND_LENS)
        assert all(bool(row["error_on_objects_sigma"]) == (scene.task != "maze") for row in rows)
        assert f"\n{scene.name}; standard error of the reference" in page


def test_agents_face_objects_that_some_of_their_receptors_see():
    world, scene = sim.build_world("detection"), SCENES[0]
    crowd = lived_through(world, 16, steps=1)
    facing = facing_objects(world, crowd)
    nearest = np.linalg.norm(facing.objects[..., :2] - facing.position[:, None], axis=-1).min(axis=1)
    assert ((nearest >= NEAR[0] - 1e-9) & (nearest <= NEAR[1])).all()
    seen = sees_object(world, scene.eyes, facing)
    assert seen.any(axis=(1, 2, 3)).mean() > 0.9
    # This check uses angles from the object's centre instead of rays, with a margin of half a receptor's diagonal.
    about = area_views.sees_object(world, scene.eyes, facing)
    assert not (seen & ~about).any()
    assert seen.sum() > 0.8 * about.sum()


@pytest.mark.parametrize("aperture", [None, 0.25])
def test_a_measured_chart_has_every_setting(aperture):
    """A small scene with few samples covers every part of the full run."""
    scene = replace(SCENES[0], eyes=sim.Eyes(n_eyes=1, resolution=(2, 3), fov_deg=60), aperture=aperture)
    kinds = [Setting("areas", 1, 4, "bounce")] if aperture is None else [Setting("closed_form", 4, 8, "bounce", 3)]
    settings = [speed_accuracy.AUTO, Setting("closed_form", 4), *kinds, speed_accuracy.BEHIND_LENS[-1]]
    assert speed_accuracy.BEHIND_LENS[-1].light == "path"
    chart = speed_accuracy.measure(scene, settings, states=(1, 3), rounds=1, spp=4)
    assert [p.setting for p in chart.points] == settings
    assert all(p.speed > 0 and p.error.everywhere > 0 and p.error.on_objects > 0 for p in chart.points)
    assert chart.auto.fidelity.tolerance == 0.005
