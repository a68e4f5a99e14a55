"""The chart of populations: its rows are what they say, and its phase and scale those of Fresnel's integral."""

import sys

import numpy as np
import pytest

import optics
from validation import D2_populations as D2
from validation.reference import relative_l2


def test_rows_of_a_small_population(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(D2, "TOLERANCES", (0.01,))
    monkeypatch.setattr(D2, "GOAL", 0.0)
    monkeypatch.setattr(D2, "FEW", 2)
    monkeypatch.setattr(D2, "AGAIN", 1)
    monkeypatch.setattr(
        sys, "argv", ["D2", "--eyes", "10", "--without-peers", "--out", str(tmp_path), "--docs", str(tmp_path)]
    )
    assert D2.main() == 0
    assert "all bounds hold" in capsys.readouterr().out
    page = (tmp_path / "D2.md").read_text()
    assert page.startswith("# D2: whole populations")
    assert page.count("\npsf ") == 3
    assert (tmp_path / "D2_populations.png").stat().st_size > 10_000


def test_errors_that_exceed_what_was_predicted_are_broken(monkeypatch):
    monkeypatch.setattr(D2, "TOLERANCES", (0.01,))
    monkeypatch.setattr(D2, "FEW", 1)
    monkeypatch.setattr(D2, "AGAIN", 1)
    population = D2.eyes(4)
    wrong = {i: 1.1 * D2.exact(population[i]) for i in range(4)}
    _, broken = D2.ours(population, wrong)
    assert any("predicted errors hold for 0.000" in line for line in broken)


@pytest.mark.parametrize("parts", [1, 4])
def test_what_peers_are_given_is_the_field(parts):
    """Its Fourier sum to the focal plane is Fresnel's picture, but for the edge."""
    [pupil] = D2.eyes(1)
    field, pitch = D2.pupil_field(pupil, 256, parts)
    at = (np.arange(D2.N) - D2.N // 2) * D2.DX
    places = (np.arange(256) - 128) * pitch
    waves = np.exp(-2j * np.pi * np.outer(at, places) / (D2.WAVE * D2.Z))
    out = waves @ field @ waves.T
    image = D2.finished(out * D2._scale(field, pitch, out), pupil)
    fresnel = optics.psf(pupil, [D2.WAVE], D2.Z, dx=D2.DX, shape=(D2.N, D2.N), method="fresnel").psf[0]
    assert relative_l2(image, fresnel) < 0.02
    assert relative_l2(image, np.roll(fresnel, 1, axis=0)) > 0.05
