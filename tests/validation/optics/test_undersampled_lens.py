"""An undersampled lens loses its light, a well-sampled one does not, and optics.psf never does."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from validation.optics import undersampled_lens
from validation.pages.page import blanked
from validation.reference import airy_encircled_energy


@pytest.fixture(scope="module")
def measured():
    published = [
        undersampled_lens.measure(
            undersampled_lens.Lens(f, undersampled_lens.FOCAL_LENGTH, undersampled_lens.GRID),
            undersampled_lens.PUBLISHED,
        )
        for f in undersampled_lens.F_NUMBERS
    ]
    return published, undersampled_lens.measure(
        undersampled_lens.Lens(
            2.0,
            undersampled_lens.SMALL * undersampled_lens.FOCAL_LENGTH,
            undersampled_lens.SMALL * undersampled_lens.GRID,
        ),
        undersampled_lens.SWEEP,
    )


def test_all_bounds_hold(measured):
    assert undersampled_lens.broken_bounds(*measured) == []


def test_a_psf_from_the_undersampled_lens_is_caught(measured):
    published, sweep = measured
    broken = undersampled_lens.broken_bounds([replace(row, ours=row.textbook[-1]) for row in published], sweep)
    assert [words.split(",")[0] for words in broken] == ["f/2", "f/8", "f/13.5"]


def test_slow_lens_has_airys_energy(measured):
    """The encircled energy is 0.8378 at f/13.5. At f/2 it is lower, because the exact PSF differs from Airy's."""
    published, _ = measured
    lens = published[2].lens
    airy = airy_encircled_energy(np.array(lens.dark_ring), undersampled_lens.WAVELENGTH, lens.radius, lens.focal_length)
    assert published[2].exact == pytest.approx(float(airy), abs=5e-4)
    assert published[0].exact < float(airy) - 5e-3


def test_energy_of_a_known_function():
    """The encircled energy of a Gaussian, interpolated between samples, is 1 - exp(-2r²/w²). With this sampling, its
    aliases are about 1e-9.
    """
    dx, waist = 1.0, 2.5
    x = (np.arange(64) - 32) * dx
    u = np.exp(-(x[None, :] ** 2 + x[:, None] ** 2) / waist**2)
    total = np.pi * waist**2 / 2
    assert undersampled_lens.energy_inside(u, dx, 3.3) / total == pytest.approx(
        1 - np.exp(-2 * (3.3 / waist) ** 2), abs=1e-8
    )


def test_figure_and_page(tmp_path, capsys):
    assert undersampled_lens.main(["--out", str(tmp_path), "--docs", str(tmp_path)]) == 0
    assert (tmp_path / "undersampled_lens.png").stat().st_size > 10_000
    fresh, stored = (
        (path / "undersampled_lens.md").read_text(encoding="utf-8") for path in (tmp_path, Path("docs/validation"))
    )
    assert blanked(fresh) == blanked(stored)
    assert "all bounds hold" in capsys.readouterr().out
