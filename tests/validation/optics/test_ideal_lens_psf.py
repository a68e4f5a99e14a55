"""The bounds of the validation hold, and its oracles reject the wrong method."""

from dataclasses import replace

import numpy as np
import pytest

from validation import reference
from validation.optics import ideal_lens_psf


@pytest.fixture(scope="module")
def rows():
    return [ideal_lens_psf.measure(f_number) for f_number in ideal_lens_psf.F_NUMBERS]


@pytest.fixture(scope="module")
def slow():
    return ideal_lens_psf.measure(ideal_lens_psf.SLOW_LENS[1], ideal_lens_psf.SLOW_LENS[0])


def test_all_bounds_hold(rows, slow):
    assert ideal_lens_psf.broken_bounds(rows, slow) == []


def test_actual_error_is_below_the_predicted_one(rows, slow):
    for row in [*rows, slow]:
        assert row.error <= row.plan.predicted_error <= ideal_lens_psf.MOST_ERROR


def test_airy_in_place_of_the_psf_is_caught_at_every_small_eye(rows, slow):
    """A paraxial method gives Airy's pattern. The exact oracle must reject it at f/16, where its error is 1.8e-3, as
    well as at f/2.
    """
    paraxial = [replace(row, error=reference.relative_l2(row.airy(row.x), row.exact(row.x), row.x)) for row in rows]
    complaints = ideal_lens_psf.broken_bounds(paraxial, slow)
    assert [c.split(":")[0] for c in complaints] == ["f/2", "f/4", "f/8", "f/16"]


def test_a_psf_that_fits_airy_at_f2_is_caught(rows, slow):
    too_good = [replace(row, airy_misfit=1e-4) if row.f_number == 2 else row for row in rows]
    assert any("f/2: misfit to Airy" in complaint for complaint in ideal_lens_psf.broken_bounds(too_good, slow))


def test_first_zero_lies_outside_airys_by_the_cosine(rows):
    """The exact dark ring is wider by a factor like 1/cos θ, which differs from 1 by order NA²: 2 % at f/2, and a
    quarter of that at f/4.
    """
    excess = [row.first_zero / row.airy_first_zero - 1 for row in rows[:3]]
    assert excess[0] == pytest.approx(0.0225, abs=2e-3)
    assert np.log2(excess[0] / excess[1]) == pytest.approx(2, abs=0.3)


def test_double_precision_meets_the_same_bound():
    assert ideal_lens_psf.measure(4, dtype="float64").error <= ideal_lens_psf.MOST_ERROR


def test_figure_and_exit_code(tmp_path, capsys):
    assert ideal_lens_psf.main(["--out", str(tmp_path)]) == 0
    assert (tmp_path / "ideal_lens_psf.png").stat().st_size > 10_000
    assert "all bounds hold" in capsys.readouterr().out
