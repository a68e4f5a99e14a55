"""The stored page shows what is stored beside it, within the bounds; each bound complains where it is broken."""

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import sim
from validation import C1_receptive_fields as C1
from validation.C1_receptive_fields import Series
from validation.scenes import lived_through

DOCS = Path(__file__).parents[2] / "docs/validation"
GOOD = Series("lens", "15 x 15", (1.0, 4.0, 16.0), (0.4, 0.15, 0.05), 0.25, 0.45, "direct", "rays")


def stored():
    def numbers(words):
        return tuple(map(float, words.split()))

    with (DOCS / "data/C1.csv").open(encoding="utf-8", newline="") as file:
        return [
            Series(
                row["pupil"],
                row["retina"],
                numbers(row["rays"]),
                numbers(row["errors"]),
                float(row["auto_rays"]),
                float(row["auto_error"]),
                row["light"],
                row["samples"],
            )
            for row in csv.DictReader(file)
        ]


def test_the_stored_page_holds_the_bounds():
    series = stored()
    assert len(series) == len(C1.PUPILS) * len(C1.RETINAS)
    assert C1.broken_bounds(series) == []
    page = (DOCS / "C1.md").read_text(encoding="utf-8")
    assert all(f"{s.auto_error:.3f} at {s.auto_rays:.3g} {s.samples}, {s.light}" in page for s in series)


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"auto_error": 0.6}, "auto errs by 0.60 σ"),
        ({"errors": (0.4, 0.3, 0.25)}, "errors fall like n^-0.17"),
    ],
)
def test_what_is_wrong_is_named(changes, complaint):
    assert C1.broken_bounds([GOOD]) == []
    (broken,) = C1.broken_bounds([replace(GOOD, **changes)])
    assert complaint in broken


def test_the_slope_leaves_out_what_tables_differ_by():
    longer = replace(GOOD, rays=(1.0, 4.0, 16.0, 64.0), errors=(0.4, 0.1, 0.025, 0.009))
    assert longer.slope == pytest.approx(-1)
    assert replace(GOOD, errors=(0.001, 0.001, 0.001)).slope == -np.inf


def test_a_small_eye_is_measured_as_the_page_says(tmp_path, monkeypatch):
    """Sampling agrees with the convolution, and a field that is put on the other side is noticed."""
    monkeypatch.setitem(C1.RETINAS, (2, 3), 40.0)
    world = sim.build_world("detection", seed=3)
    state = lived_through(world, 2)
    series = C1.measure("random relief", (2, 3), world, state)
    assert series.rays == pytest.approx((1, 4, 16, 64), rel=0.2)
    assert series.errors[-1] < 0.1
    C1.draw([series], tmp_path / "C1.png")
    assert "3 x 2" in C1.table([series])
    kernel = C1.optics.Eye.kernel
    monkeypatch.setattr(C1.optics.Eye, "kernel", lambda self, n, *z: kernel(self, n, *z)[:, ::-1, ::-1])
    wrong = C1.sampled(world, C1.eyes_behind("random relief", (2, 3)), state, sim.Fidelity(64, 4))[0]
    monkeypatch.undo()
    monkeypatch.setitem(C1.RETINAS, (2, 3), 40.0)
    right = C1.convolved(world, C1.eyes_behind("random relief", (2, 3)), state, "direct")
    assert C1.rms(wrong - right) / C1.SIGMA > 3 * series.errors[-1]


def test_areas_are_held_against_finer_ones_in_their_own_light(monkeypatch):
    """What is chosen for a perfect lens follows all light, which rays do not: direct light is not its reference."""
    monkeypatch.setitem(C1.RETINAS, (2, 3), 40.0)
    world = sim.build_world("detection", seed=3)
    state = lived_through(world, 2)
    series = C1.measure("perfect", (2, 3), world, state)
    assert (series.samples, series.light) == ("areas", "all")
    assert series.auto_error < 0.1
    eyes = C1.eyes_behind("perfect", (2, 3))
    unlike = C1.convolved(world, eyes, state, "all") - C1.convolved(world, eyes, state, "direct")
    assert C1.rms(unlike) / C1.SIGMA > 3 * series.auto_error
