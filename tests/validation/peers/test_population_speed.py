"""The chart of populations: rows follow their definitions; phase and scale agree with Fresnel's integral."""

import sys
from dataclasses import replace

import numpy as np
import pytest

import optics
from validation.peers import new_wavefronts, population_speed
from validation.reference import relative_l2


def defocused(rng):
    return optics.Pupil(1e-3, wavefront=optics.Zernike({(2, 0): rng.uniform(0.1, 0.2)}), thin_lens_focal_length=22e-3)


def test_rows_of_a_small_population(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(population_speed, "TOLERANCES", (0.01,))
    monkeypatch.setattr(population_speed, "GOAL", 0.0)
    monkeypatch.setattr(population_speed, "FEW", 2)
    monkeypatch.setattr(population_speed, "AGAIN", 1)
    monkeypatch.setattr(new_wavefronts, "cases", lambda: iter([new_wavefronts.Case("defocus", defocused, 33, 1.0)]))
    monkeypatch.setattr(new_wavefronts, "TIMED", 1)
    monkeypatch.setattr(new_wavefronts, "BEFORE", 0)
    monkeypatch.setattr(
        sys,
        "argv",
        ["population_speed", "--eyes", "10", "--without-peers", "--out", str(tmp_path), "--docs", str(tmp_path)],
    )
    assert population_speed.main() == 0
    assert "all bounds hold" in capsys.readouterr().out
    page = (tmp_path / "population_speed.md").read_text()
    assert page.startswith("# Whole populations")
    assert page.count("\npsf ") == 3
    assert page.count("\ndefocus                        33 x 33 ") == 1
    assert (tmp_path / "population_speed.png").stat().st_size > 10_000


def test_errors_that_exceed_what_was_predicted_are_broken(monkeypatch):
    monkeypatch.setattr(population_speed, "TOLERANCES", (0.01,))
    monkeypatch.setattr(population_speed, "FEW", 1)
    monkeypatch.setattr(population_speed, "AGAIN", 1)
    population = population_speed.eyes(4)
    wrong = {i: 1.1 * population_speed.exact(population[i]) for i in range(4)}
    _, broken = population_speed.ours(population, wrong)
    assert any("predicted errors hold for 0.000" in line for line in broken)


def test_single_psfs_with_too_large_errors_are_broken(monkeypatch):
    def wrong(case, pupil, own=new_wavefronts._psf, **changed):
        found = own(case, pupil, **changed)
        return replace(found, tensor=1.1 * found.psf) if "dtype" in changed else found

    monkeypatch.setattr(new_wavefronts, "_psf", wrong)
    monkeypatch.setattr(new_wavefronts, "TIMED", 1)
    monkeypatch.setattr(new_wavefronts, "BEFORE", 0)
    _, broken = new_wavefronts.table(iter([new_wavefronts.Case("defocus", defocused, 33)]))
    assert "defocus, 33 x 33: error 9" in broken[0]


@pytest.mark.parametrize("parts", [1, 4])
def test_what_peers_are_given_is_the_field(parts):
    """The Fourier sum of the field gives Fresnel's image in the focal plane, except for an error due to the sampled
    edge.
    """
    [pupil] = population_speed.eyes(1)
    field, pitch = population_speed.pupil_field(pupil, 256, parts)
    at = (np.arange(population_speed.N) - population_speed.N // 2) * population_speed.DX
    places = (np.arange(256) - 128) * pitch
    waves = np.exp(-2j * np.pi * np.outer(at, places) / (population_speed.WAVE * population_speed.Z))
    out = waves @ field @ waves.T
    image = population_speed.finished(out * population_speed._scale(field, pitch, out), pupil)
    fresnel = optics.psf(
        pupil,
        [population_speed.WAVE],
        population_speed.Z,
        dx=population_speed.DX,
        shape=(population_speed.N, population_speed.N),
        method="fresnel",
    ).psf[0]
    assert relative_l2(image, fresnel) < 0.02
    assert relative_l2(image, np.roll(fresnel, 1, axis=0)) > 0.05
