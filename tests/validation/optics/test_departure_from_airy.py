"""The chart's bounds hold, and they fail for a PSF equal to Airy's or a departure of another order."""

from dataclasses import replace

import pytest

from validation.optics import departure_from_airy


@pytest.fixture(scope="module")
def rows():
    return [departure_from_airy.measure(aperture) for aperture in departure_from_airy.APERTURES]


def test_all_bounds_hold(rows):
    assert departure_from_airy.broken_bounds(rows) == []


def test_known_departure_at_f2(rows):
    """The deviation at NA 0.24, which is close to f/2 (0.2425), is 4.5e-2, as in `ideal_lens_psf` at the Fresnel number
    27.
    """
    row = next(row for row in rows if row.aperture == 0.24)
    assert row.tangent_misfit == pytest.approx(4.52e-2, rel=0.03)
    assert row.peak_ratio == pytest.approx(1 - 0.24**2, abs=2e-3)


def test_airy_in_place_of_the_psf_is_caught_at_every_aperture(rows):
    paraxial = [replace(row, error=row.tangent_misfit) for row in rows]
    assert len(departure_from_airy.broken_bounds(paraxial)) == len(rows)


def test_another_order_is_caught(rows):
    linear = [replace(row, tangent_misfit=0.75 * row.aperture) for row in rows]
    assert departure_from_airy.broken_bounds(linear) == ["Airy (tan) departs like NA^1.00, must be NA^2"]


def test_figure_and_exit_code(tmp_path, capsys):
    assert departure_from_airy.main(["--out", str(tmp_path)]) == 0
    assert (tmp_path / "departure_from_airy.png").stat().st_size > 10_000
    assert "all bounds hold" in capsys.readouterr().out
