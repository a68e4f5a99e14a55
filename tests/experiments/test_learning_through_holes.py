"""The pinhole that gives the best learning: found if there is one, and not found otherwise."""

from dataclasses import replace

import numpy as np
import pytest

from experiments import learning_through_holes
from experiments.candidates import Row
from experiments.evolved import RunMetadata, Store
from experiments.store import Origin

ROW = Row(*("a", 0, 0, 0, 0, 0, 1.0, 0.5, 4, 2, 60.0, 45.0, 8, 8, 0.1, 5, 64, 1000))


def through_holes(peak, noise, group="0.001"):
    """Animals whose success falls on both sides of one pupil width, with random noise."""
    chance = np.random.default_rng(1)
    widths = np.linspace(0.05, 0.65, 40)
    success = 0.3 + 0.5 * np.exp(-0.5 * (np.log(widths / peak) / 0.4) ** 2) + noise * chance.normal(size=40)
    pairs = zip(widths, success, strict=True)
    return [replace(ROW, group=group, relative_aperture=a, success_rate=float(np.clip(s, 0, 1))) for a, s in pairs]


@pytest.mark.fast_cases(1)
@pytest.mark.parametrize("peak", [0.15, 0.25])
def test_the_best_width_is_found_with_an_interval_that_holds_it(peak):
    """The relative apertures of the animals are spread evenly, not on a logarithmic scale. A kernel mean would
    therefore be biased towards wide pupils.
    """
    found, p = learning_through_holes.best_width(through_holes(peak, 0.1))
    assert found.low <= peak <= found.high
    assert found.mean == pytest.approx(peak, rel=0.25)
    assert p < 0.01
    sure, _ = learning_through_holes.best_width(through_holes(peak, 0.0))
    assert sure.mean == pytest.approx(peak, rel=0.03)
    assert sure.high - sure.low < found.high - found.low


def test_curves_do_not_run_away_where_there_are_no_animals():
    """A resample may hold two of the four animals behind narrow pinholes, and a line through two points can rise
    without bound."""
    widths = [0.059, 0.069, 0.087, 0.097, *np.linspace(0.25, 0.64, 26)]
    success = [0.17, 0.16, 0.22, 0.09, *(0.5 - 3 * (np.linspace(0.25, 0.64, 26) - 0.34) ** 2)]
    rows = [
        replace(row, relative_aperture=a, success_rate=s)
        for row, a, s in zip(through_holes(0.3, 0.0), widths, success, strict=False)
    ]
    found, _ = learning_through_holes.best_width(rows)
    assert 0.25 < found.low < found.mean < found.high < 0.45


def test_no_width_is_best_where_nothing_is_learnt():
    flat = [replace(row, success_rate=0.33 + 0.1 * np.sin(37.0 * i)) for i, row in enumerate(through_holes(0.2, 0.0))]
    assert learning_through_holes.best_width(flat)[1] > 0.05
    conduct = [RunMetadata("0.001", 0, 40, 5, 5, 1.0, "", 0.001, 1e-4)]
    assert "| no best width |" in learning_through_holes.table(Store(flat, conduct, [], Origin.here(1.0), ""))
    with pytest.raises(ValueError, match="three animals"):
        learning_through_holes.best_width([replace(row, failed=1) for row in flat])


def test_widths_are_held_against_what_is_predicted_for_their_noise():
    rows = [*through_holes(0.2, 0.0), *through_holes(0.2, 0.0, "0.01")]
    conduct = [RunMetadata(group, 0, 40, 5, 5, 1.0, "", float(group), 1e-4) for group in ("0.001", "0.01")]
    bright, dark = learning_through_holes.table(Store(rows, conduct, [], Origin.here(1.0), "")).splitlines()[2:]
    assert [cell.strip() for cell in bright.split("|")[5:9]] == ["0.11", "0.12", "0.21", "0.41"]
    assert [cell.strip() for cell in dark.split("|")[5:9]] == ["0.21", "0.12", "0.21", "0.41"]
