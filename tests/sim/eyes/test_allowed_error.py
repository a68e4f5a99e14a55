import pytest

import optics
from sim.eyes.allowed_error import allowed_error

LENS = optics.Pupil(25e-6, thin_lens_focal_length=241e-6)


def eye(**settings):
    return optics.Eye(resolution=(4, 4), fov_deg=45.0, sensor_width=200e-6, bands=3, **settings)


def test_half_of_the_noise_is_allowed():
    """The default tolerance is half of the noise, which makes the total at most an eighth larger."""
    assert allowed_error(eye(noise_sigma=0.04), None) == pytest.approx(0.02)


def test_little_noise_allows_what_is_little_beside_white():
    """The tolerance is a share of white's signal if noise is small. A lens a quarter as wide as the retina transmits
    1/16 of the light.
    """
    assert allowed_error(eye(noise_sigma=1e-6), None) == pytest.approx(0.005)
    assert allowed_error(eye(noise_sigma=1e-6, pupil=LENS), None) == pytest.approx(0.005 / 16)


def test_what_is_asked_for_is_allowed_whatever_the_noise():
    assert allowed_error(eye(noise_sigma=0.04), 1e-3) == 1e-3


@pytest.mark.parametrize("wrong", [0.0, -1.0, float("nan"), float("inf")])
def test_no_tolerance_is_refused(wrong):
    with pytest.raises(ValueError, match=r"tolerance = .*must be positive"):
        allowed_error(eye(), wrong)
