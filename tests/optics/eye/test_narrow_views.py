"""Narrow views through strong reliefs: light goes everywhere, and kernels can still be computed."""

import math

import numpy as np
import pytest

import optics


@pytest.mark.fast_cases(1)
@pytest.mark.parametrize("seed", [0, 1])
def test_cells_hold_the_light_that_the_direct_sum_sends_there(seed):
    """The height of the glass changes by 140 waves over 38 µm, so that the kernel is computed as a far field from few
    nodes.
    """
    pupil = optics.Pupil(19e-6, optics.BSplineRelief(150e-6 * np.random.default_rng(seed).random((4, 4))))
    eye = optics.Eye(pupil, (15, 15), 20.0, bands=1)
    kernel = eye.kernel(4)[0]
    assert 0.98 < kernel.sum() < 1.01
    cell, parts = eye.receptor_pitch / 4, 24
    brightest = np.argsort(kernel.ravel())[::-1]
    for at in brightest[[0, 500, 5000]]:
        down, right = np.array(np.divmod(at, len(kernel))) - len(kernel) // 2
        dx = cell / parts
        middle = right * cell + dx / 2, down * cell + dx / 2  # for an even number of samples
        there = optics.psf(
            pupil,
            eye.spectral_bands.wavelengths,
            eye.retina_distance,
            dx=dx,
            shape=(parts, parts),
            centre=middle,
            method="rayleigh_sommerfeld",
            tolerance=1e-4,
        )
        assert kernel.flat[at] == pytest.approx(there.psf.sum() * dx**2, rel=1e-2)


@pytest.mark.fast_cases(2)
@pytest.mark.parametrize(
    "aperture", [optics.Circle(), optics.Slit(0.05, 1.0), optics.Annulus(0.95)], ids=["circle", "slit", "ring"]
)
def test_kernels_lose_no_more_than_the_tolerance_whatever_the_edge(aperture):
    """Diffracted light is proportional to the ratio of perimeter to area. For this slit, the ratio is twenty times that
    of a circle.
    """
    focal = 2e-3
    width = 2 * focal * math.tan(math.radians(22.5))
    pupil = optics.Pupil(100e-6, thin_lens_focal_length=focal, aperture=aperture)
    eye = optics.Eye(pupil, resolution=(41, 41), fov_deg=45, sensor_width=width, bands=1, tolerance=1e-2)
    outline = aperture.outline.length / (2 * math.pi**2 * aperture.area)
    evanescent = outline * float(eye.spectral_bands.wavelengths[0]) / 100e-6
    assert eye.kernel(1).sum() > 1 - 1.3e-2 - evanescent
