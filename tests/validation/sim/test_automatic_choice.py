"""The stored page agrees with its stored data, within the bounds; each bound reports its violation."""

import csv
from dataclasses import replace
from pathlib import Path

import pytest

from validation.sim import automatic_choice
from validation.sim.automatic_choice import RECEPTORS, Choice

DOCS = Path(__file__).parents[3] / "docs/validation"
GOOD = Choice("detection", RECEPTORS, 62, 45.0, 1, "areas", 1.0, 0.6, 2e-6)


def stored():
    with (DOCS / "data/automatic_choice.csv").open(encoding="utf-8", newline="") as file:
        return [
            Choice(
                row["task"],
                row["sweep"],
                int(row["receptors"]),
                float(row["fov_deg"]),
                int(row["eyes"]),
                row["samples"],
                *(float(row[name]) for name in ("number", "error", "time")),
            )
            for row in csv.DictReader(file)
        ]


def test_the_stored_page_holds_the_bounds():
    choices = stored()
    assert [(c.task, c.sweep, c.receptors, c.fov_deg, c.eyes) for c in choices] == automatic_choice.settings()
    assert automatic_choice.broken_bounds(choices) == []
    assert automatic_choice.table(choices) in (DOCS / "automatic_choice.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"error": 6.3}, "the predicted error is 6.30 times the tolerance"),
        ({"samples": "rays", "number": 128.0}, "128 rays per receptor"),
    ],
)
def test_what_is_wrong_is_named(changes, complaint):
    assert automatic_choice.broken_bounds([GOOD]) == []
    (broken,) = automatic_choice.broken_bounds([replace(GOOD, **changes)])
    assert complaint in broken


def test_a_cliff_is_named():
    """Only a jump of the cost between neighbouring resolutions of one task counts as a cliff."""
    costly = replace(GOOD, receptors=63, number=4.0)
    assert automatic_choice.broken_bounds([GOOD, costly]) == ["detection: 62 and 63 receptors differ by 4"]
    assert automatic_choice.broken_bounds([GOOD, replace(costly, number=3.0)]) == []
    for other in (replace(costly, receptors=80), replace(costly, task="maze")):
        assert automatic_choice.broken_bounds([GOOD, other]) == []


def test_a_small_eye_is_measured_and_drawn(tmp_path):
    choices = [automatic_choice.measure("detection", RECEPTORS, n, 45.0, 1) for n in (4, 5)]
    assert automatic_choice.broken_bounds(choices) == []
    assert min(automatic_choice.relative_times(choices)) == 1
    automatic_choice.draw(choices, tmp_path / "figure.png")
    assert (tmp_path / "figure.png").stat().st_size > 10_000
