"""The example of tolerancing runs, and its criterion is Strehl's ratio."""

import runpy
import sys
from pathlib import Path

import numpy as np
import pytest

SCRIPT = Path(__file__).parents[3] / "examples" / "08_tolerancing.py"


def aligned(example, shift):
    """Return the lens with an error of the last distance only."""
    return example["system"](np.zeros((3, 2)), np.zeros((3, 2)), np.array([0.0, 0.0, shift]))


def exit_pupil(example):
    """Return the radius of the exit pupil, which is the image of the first lens by the other lenses, and its distance
    from the focus.
    """
    radius, behind = example["RADIUS"], 0.0
    for f, spacing in zip(example["FOCAL_LENGTHS"][1:], example["SPACINGS"], strict=True):
        before = spacing - behind
        behind = 1 / (1 / f - 1 / before)
        radius *= abs(behind / before)
    return radius, example["back_focal_length"]() - behind


def test_defocus_lowers_the_peak_as_in_closed_form():
    """The light converges from the exit pupil of radius h to the focus at the distance z. On the axis at the distance
    z', the intensity is (z/z')² sinc²(W/λ) with W = h² (1/z - 1/z')/2 (Born & Wolf, §8.8). The rims of the other lenses
    diffract a few percent.
    """
    example = runpy.run_path(str(SCRIPT))
    (radius, near), shifts = exit_pupil(example), np.array([0.0, 7e-3, -7e-3])
    peaks = np.array([example["peak"](aligned(example, shift)) for shift in shifts])
    strehl = np.sinc(radius**2 / 2 * (1 / near - 1 / (near + shifts)) / example["WAVELENGTH"]) ** 2
    assert max(strehl[1:]) < 0.8
    np.testing.assert_allclose(peaks / peaks[0], strehl * (near / (near + shifts)) ** 2, rtol=0.1)


@pytest.mark.slow
def test_wider_tolerances_lower_the_yield(monkeypatch, capsys, tmp_path):
    monkeypatch.setattr(sys, "argv", [str(SCRIPT), "--trials", "4", "--out", str(tmp_path / "yield.png")])
    runpy.run_path(str(SCRIPT), run_name="__main__")
    lines = capsys.readouterr().out.splitlines()
    medians = [float(line.split("median ratio ")[1].split(",")[0]) for line in lines[:3]]
    assert medians[0] > medians[1] > medians[2]
    assert (tmp_path / "yield.png").stat().st_size > 5000
