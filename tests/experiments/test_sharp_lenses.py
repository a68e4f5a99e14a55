"""Lenses of every power: the glass follows its design, and the measured benefit of sharpness is that of the synthetic
training runs."""

import math

import numpy as np
import pytest

from evolve.config.run_config import EyeConfig
from experiments.designed import Design, Trained
from experiments.glass import paraboloid, power
from experiments.sharp_lenses import APERTURES, POWERS, SEEDS, SHARP, _message, designs, lens_of, page, worth
from experiments.store import Origin


def lived(design, fitness):
    return Trained(**vars(design), fitness=fitness, success_rate=0.5, episodes=32, steps=1000, seconds=1.0)


def lives(fitness_of):
    """Synthetic training runs with a little noise; fitness_of: a lens's Strehl ratio and power -> fitness."""
    random = np.random.default_rng(0)
    return [
        lived(d, fitness_of(lens_of(d.relative_aperture, d.glass_power).strehl, d.glass_power) + random.normal())
        for d in designs()
    ]


def test_every_lens_has_every_life():
    asked = designs()
    assert len(asked) == len(set(asked)) == len(APERTURES) * len(POWERS) * len(SEEDS)
    assert {d.seed for d in asked[: len(asked) // len(SEEDS)]} == {SEEDS[0]}


def test_glass_has_the_power_that_its_design_says():
    for design in designs()[: len(APERTURES) * len(POWERS)]:
        assert power(design.animal, EyeConfig()) == pytest.approx(design.glass_power, abs=1e-9)
        assert design.config(()).eye.optics
    assert not Design("detection", 2, 3, 3, 45.0, 0.01, 0).config(()).eye.optics
    assert Design("detection", 2, 3, 3, 45.0, 0.01, 0).animal.relief is None
    with pytest.raises(ValueError, match=r"glass of power 3 behind a = 0\.5 is 2\.76 of the height"):
        paraboloid(3.0, 0.5, 45.0, 1.9, EyeConfig())


@pytest.mark.slow
def test_lenses_are_sharpest_in_focus():
    for aperture in APERTURES:
        strehl = {power: lens_of(aperture, power).strehl for power in POWERS if 0.75 < power < 1.15}
        assert max(strehl, key=strehl.get) == 1.0
        assert strehl[1.0] > 0.98
        assert strehl[0.8] < SHARP < strehl[0.95]


def test_what_sharpness_is_worth():
    """Sharp lenses have 20 more fitness in one case and none in the other; the rest of the fitness is constant."""
    paid, unpaid = lives(lambda strehl, _: 100 + 20 * (strehl > SHARP)), lives(lambda *_: 100)
    for aperture in APERTURES:
        found, nothing = worth(paid, aperture), worth(unpaid, aperture)
        assert found.low < 20 < found.high
        assert found.low > 18
        assert nothing.low < 0 < nothing.high
    assert "higher fitness" in _message(paid)
    assert "no significant effect" in _message(unpaid)


@pytest.mark.slow
def test_lenses_far_from_focus_do_not_count():
    rows = lives(lambda _, power: 100 if abs(power - 1) < 0.25 else -1000)
    assert all(abs(worth(rows, aperture).mean) < 1 for aperture in APERTURES)
    assert worth([row for row in rows if row.glass_power == 1.0], 0.3) is None


def test_page(tmp_path):
    rows = lives(lambda strehl, _: 100 * math.sqrt(strehl))
    page(rows, Origin.here(1.0, "worker"), "Yes.").publish(tmp_path)
    text = (tmp_path / "sharp_lenses.md").read_text()
    assert "| 0.45 | 1 | 0.982 | 0.95 |" in text
    assert "4 independent training runs" in text
    assert (tmp_path / "figures" / "sharp_lenses.png").stat().st_size > 10_000
