"""The stored page agrees with its stored data, within the bounds; each bound reports its violation."""

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import sim
from validation.sim import receptive_field_sampling
from validation.sim.receptive_field_sampling import Series
from validation.sim.scenes import lived_through

DOCS = Path(__file__).parents[3] / "docs/validation"
GOOD = Series("lens", "15 x 15", (1.0, 4.0, 16.0), (0.4, 0.15, 0.05), 0.25, 0.45, "direct", "rays")


def stored():
    def numbers(words):
        return tuple(map(float, words.split()))

    with (DOCS / "data/receptive_field_sampling.csv").open(encoding="utf-8", newline="") as file:
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
    assert len(series) == len(receptive_field_sampling.PUPILS) * len(receptive_field_sampling.RETINAS)
    assert receptive_field_sampling.broken_bounds(series) == []
    page = (DOCS / "receptive_field_sampling.md").read_text(encoding="utf-8")
    assert all(f"{s.auto_error:.3f} at {s.auto_rays:.3g} {s.samples}, {s.light}" in page for s in series)


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"auto_error": 0.6}, "auto has an error of 0.60 σ"),
        ({"errors": (0.4, 0.3, 0.25)}, "errors fall like n^-0.17"),
    ],
)
def test_what_is_wrong_is_named(changes, complaint):
    assert receptive_field_sampling.broken_bounds([GOOD]) == []
    (broken,) = receptive_field_sampling.broken_bounds([replace(GOOD, **changes)])
    assert complaint in broken


def test_the_slope_leaves_out_what_tables_differ_by():
    longer = replace(GOOD, rays=(1.0, 4.0, 16.0, 64.0), errors=(0.4, 0.1, 0.025, 0.009))
    assert longer.slope == pytest.approx(-1)
    assert replace(GOOD, errors=(0.001, 0.001, 0.001)).slope == -np.inf


def test_a_small_eye_is_measured_as_the_page_says(tmp_path, monkeypatch):
    """Sampling agrees with the convolution, and a mirrored receptive field is detected."""
    monkeypatch.setitem(receptive_field_sampling.RETINAS, (2, 3), 40.0)
    world = sim.build_world("detection", seed=3)
    state = lived_through(world, 2)
    series = receptive_field_sampling.measure("random relief", (2, 3), world, state)
    assert series.rays == pytest.approx((1, 4, 16, 64), rel=0.2)
    assert series.errors[-1] < 0.1
    receptive_field_sampling.draw([series], tmp_path / "receptive_field_sampling.png")
    assert "3 x 2" in receptive_field_sampling.table([series])
    kernel = receptive_field_sampling.optics.Eye.kernel
    monkeypatch.setattr(
        receptive_field_sampling.optics.Eye, "kernel", lambda self, n, *z: kernel(self, n, *z)[:, ::-1, ::-1]
    )
    wrong = receptive_field_sampling.sampled(
        world, receptive_field_sampling.eyes_behind("random relief", (2, 3)), state, sim.Fidelity(64, 4)
    )[0]
    monkeypatch.undo()
    monkeypatch.setitem(receptive_field_sampling.RETINAS, (2, 3), 40.0)
    right = receptive_field_sampling.convolved(
        world, receptive_field_sampling.eyes_behind("random relief", (2, 3)), state, "direct"
    )
    assert receptive_field_sampling.rms(wrong - right) / receptive_field_sampling.SIGMA > 3 * series.errors[-1]


def test_areas_are_held_against_finer_ones_in_their_own_light(monkeypatch):
    """The fidelity that is chosen for a perfect lens includes reflected light, so rays in direct light are not its
    reference.
    """
    monkeypatch.setitem(receptive_field_sampling.RETINAS, (2, 3), 40.0)
    world = sim.build_world("detection", seed=3)
    state = lived_through(world, 2)
    series = receptive_field_sampling.measure("perfect", (2, 3), world, state)
    assert (series.samples, series.light) == ("areas", "all")
    assert series.auto_error < 0.1
    eyes = receptive_field_sampling.eyes_behind("perfect", (2, 3))
    unlike = receptive_field_sampling.convolved(world, eyes, state, "all") - receptive_field_sampling.convolved(
        world, eyes, state, "direct"
    )
    assert receptive_field_sampling.rms(unlike) / receptive_field_sampling.SIGMA > 3 * series.auto_error
