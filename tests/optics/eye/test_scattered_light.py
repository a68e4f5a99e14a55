"""Light scattered by masks and ripples reaches the kernel, except for less than the tolerance."""

import math

import numpy as np
import pytest

import optics

R, FOCAL, WAVE = 25e-6, 241.4e-6, 550e-9
AT = (np.arange(128) + 0.5) / 64 - 1
FROM_AXIS = np.hypot(AT, AT[:, None])


def ripple(cycles):
    return np.broadcast_to(np.cos(2 * np.pi * cycles * AT), (128, 128))


def behind(tolerance=0.05, focal=FOCAL, **parts):
    return optics.Eye(optics.Pupil(R, thin_lens_focal_length=focal, **parts), bands=1, tolerance=tolerance)


def phase(radians, cycles):
    return radians * WAVE / (2 * math.pi) * ripple(cycles)


EYES = {
    "a mask's orders": lambda: behind(mask=optics.MaskMap((1 + ripple(10)) / 2)),
    "a narrow beam": lambda: behind(mask=optics.GaussianMask(R / 30)),
    "a bright rim": lambda: behind(0.02, mask=optics.MaskMap(np.minimum(FROM_AXIS, 1) ** 6)),
    "a bright rim out of focus": lambda: behind(focal=1.3 * FOCAL, mask=optics.MaskMap(np.minimum(FROM_AXIS, 1) ** 6)),
    "a faint ripple": lambda: behind(height=phase(0.5, 10) / 0.5),
    "a faint ripple of a wavefront": lambda: behind(wavefront=optics.WavefrontMap(phase(0.5, 15), radius=1.5 * R)),
}


@pytest.mark.fast_cases(3)
@pytest.mark.parametrize("name", EYES)
def test_kernels_lose_no_more_than_the_tolerance_of_what_is_let_through(name):
    """Energy balance: all the light that a mask transmits reaches the sensor. Windows chosen from rays and edges alone
    would lose a third of the mask's light, two thirds of the beam's, and 0.06 to 0.15 of the others'."""
    eye = EYES[name]()
    lost = 1 - eye.kernel(4).sum() / eye.pupil.transmission
    assert -2e-3 < lost < eye.tolerance


@pytest.mark.slow
def test_waveguides_see_a_masks_orders():
    """Parseval's theorem gives a kernel's loss: see `test_guided_field.py`. A window without the orders would lose 34 %
    at a tolerance of 0.05."""
    focal, width = 50e-6, 27e-6
    mask = optics.MaskMap((1 + ripple(6)) / 2)
    pupil = optics.Pupil(12.5e-6, thin_lens_focal_length=67e-6, medium_n=1.34, object_n=1.0, mask=mask)
    fov = 2 * math.degrees(math.atan(width / (2 * focal)))
    loose, tight = (
        optics.Eye(pupil, (9, 9), fov, width, 1, waveguide=optics.Waveguide(1.6e-6), full_aperture=1e-4, tolerance=at)
        for at in (0.05, 0.005)
    )
    assert loose.kernel(4).sum() == pytest.approx(tight.kernel(4).sum(), rel=0.05)


def test_windows_of_even_masks_are_no_wider():
    """An amplitude of 1/2 everywhere scatters nothing."""
    plain, masked = behind(), behind(mask=optics.MaskMap(np.full((4, 4), 0.5)))
    assert masked.kernel(4).shape == plain.kernel(4).shape
