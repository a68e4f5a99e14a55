"""The vector focus against sums of plane waves, Rayleigh-Sommerfeld's integral at low NA, and published spots."""

import math

import numpy as np
import pytest

import optics

WAVELENGTH = 500e-9


def lens(sine, z=1e-3, aplanatic=False, **options):
    radius = z * sine if aplanatic else z * math.tan(math.asin(sine))
    return optics.Pupil(radius, thin_lens_focal_length=z, **options)


def focus(sine, aplanatic=False, **options):
    kind = "aplanatic" if aplanatic else "flat"
    options = {"dx": 10e-9, "shape": (81, 81), **options}
    return optics.vector_focus(lens(sine, aplanatic=aplanatic), WAVELENGTH, apodization=kind, **options)


def width(profile, dx):
    """Return the full width at half maximum, by linear interpolation from the middle outwards."""
    half = profile[len(profile) // 2 :]
    at = int(np.argmax(half < half[0] / 2))
    return 2 * dx * (at - 1 + (half[at - 1] - half[0] / 2) / (half[at - 1] - half[at]))


def test_spot_of_an_objective_of_na_09():
    """The published spot is 365 nm wide along the polarisation and 270 nm across. Scalar theory gives 253 nm with a
    flat wave, or 277 nm.
    """
    found = focus(0.9, aplanatic=True, polarization=(1, 0))
    assert width(found.psf[40], 10e-9) == pytest.approx(365e-9, abs=1.5e-9)
    assert width(found.psf[:, 40], 10e-9) == pytest.approx(270e-9, abs=1.5e-9)
    assert width(focus(0.9).scalar[40], 10e-9) == pytest.approx(253e-9, abs=1.5e-9)


@pytest.mark.parametrize("polarization", [(1, 0), (0, 1), (1, 1j), (1, -2)])
def test_it_is_the_sum_of_plane_waves_turned_with_their_rays(polarization):
    """The reference is a double integral over directions. The lens preserves the s-component of the field, and turns
    the p-component with the ray.
    """
    found = focus(0.8, aplanatic=True, polarization=polarization, dx=90e-9, shape=(5, 7))
    nodes, weights = np.polynomial.legendre.leggauss(60)
    alpha, k = math.asin(0.8), 2 * math.pi / WAVELENGTH
    theta, weight = alpha * (nodes + 1) / 2, weights * alpha / 2
    phi = np.arange(64) * 2 * np.pi / 64
    t, p = (a.ravel() for a in np.meshgrid(theta, phi, indexing="ij"))
    amplitude = np.repeat(weight, 64) * (2 * np.pi / 64) * np.sqrt(np.cos(t)) * np.sin(t)
    jones = np.array(polarization) / np.linalg.norm(polarization)
    radial, azimuthal = jones[0] * np.cos(p) + jones[1] * np.sin(p), jones[1] * np.cos(p) - jones[0] * np.sin(p)
    # The ray from pupil point p runs towards -p: the radial field tips forwards.
    e = np.array(
        [
            radial * np.cos(t) * np.cos(p) - azimuthal * np.sin(p),
            radial * np.cos(t) * np.sin(p) + azimuthal * np.cos(p),
            radial * np.sin(t),
        ]
    )
    x, y = np.meshgrid((np.arange(7) - 3) * 90e-9, (np.arange(5) - 2) * 90e-9)
    turn = np.sin(t) * (np.cos(p) * x[..., None] + np.sin(p) * y[..., None])
    field = np.einsum("cn,yxn->cyx", e * amplitude, np.exp(-1j * k * turn)) * k * 1e-3 / (2 * np.pi)
    expected = np.abs(field) ** 2 / (np.pi * (0.8e-3) ** 2)
    np.testing.assert_allclose(found.intensity, expected, rtol=0, atol=1e-8 * expected.max())


def test_at_low_na_it_is_rayleigh_sommerfelds():
    pupil = optics.Pupil(0.1e-3, thin_lens_focal_length=1e-3)
    window = {"dx": 0.5e-6, "shape": (33, 33)}
    exact = optics.psf(pupil, [WAVELENGTH], 1e-3, dtype="float64", tolerance=1e-6, **window).psf[0]
    vector = optics.vector_focus(pupil, WAVELENGTH, **window)
    off = np.linalg.norm(vector.scalar - exact) / np.linalg.norm(exact)
    assert off < 1e-3  # 1 / (2k z (1 - cos θ)) of the near term, and the remainder of the edge
    assert np.linalg.norm(vector.psf - exact) / np.linalg.norm(exact) == pytest.approx(0.21 * 0.0995**2, rel=0.3)


def test_defocus_and_spherical_relief_are_in_it():
    """20 µm behind the focus, the scalar integral with the same wavefront is the reference."""
    pupil = optics.Pupil(0.15e-3, optics.BSplineRelief.paraboloid(0, 40.0, 0.15e-3), thin_lens_focal_length=1e-3)
    window = {"dx": 0.5e-6, "shape": (33, 33)}
    exact = optics.psf(pupil, [WAVELENGTH], 1.02e-3, dtype="float64", tolerance=1e-6, **window).psf[0]
    scalar = optics.vector_focus(pupil, WAVELENGTH, 1.02e-3, **window).scalar
    assert np.linalg.norm(scalar - exact) / np.linalg.norm(exact) < 2e-3


def test_all_components_together_hold_the_light_of_scalar_theory():
    """The polarisation vectors of all plane waves have the length 1, so the integrals over the plane agree."""
    found = focus(0.7, dx=0.15e-6, shape=(135, 135))
    assert found.psf.sum() == pytest.approx(found.scalar.sum(), rel=2e-3)
    assert found.intensity[2].sum() > 0.1 * found.psf.sum()


def test_rings_have_more_light_along_the_axis():
    ring = optics.vector_focus(lens(0.9, aperture=optics.Annulus(0.9)), WAVELENGTH, polarization=(1, 0), dx=20e-9)
    whole = optics.vector_focus(lens(0.9), WAVELENGTH, polarization=(1, 0), dx=20e-9)
    share = [found.intensity[2].sum() / found.psf.sum() for found in (ring, whole)]
    assert share[0] > 1.3 * share[1]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"polarization": (0, 0)}, "polarization = .*not \\(0, 0\\)"),
        ({"polarization": "x"}, "polarization = 'x'"),
        ({"apodization": "aplan"}, "did you mean 'aplanatic'"),
        (
            {"pupil": optics.Pupil(1e-3, optics.PixelRelief(np.eye(4) * 1e-7), thin_lens_focal_length=1e-3)},
            "PixelRelief",
        ),
        ({"polarization": (1, 0.8, 0.8, 0)}, "Stokes"),
        ({"polarization": (0, 0, 0, 0)}, "S0 positive"),
        ({"polarization": (1, 0, 1)}, "polarization = "),
        ({"source_angle": (2.0, 0)}, "source_angle"),
        ({"source_angle": (0.1, 0), "apodization": "aplanatic"}, "lit along its axis"),
        (
            {"pupil": optics.Pupil(20e-6, thin_lens_focal_length=1e-3), "apodization": "aplanatic"},
            "Fresnel number .* at least 20",
        ),
        ({"dx": 1.0}, "widen the tolerance|needs"),
        ({"dx": 1.0, "pupil": lens(0.7, aplanatic=True), "apodization": "aplanatic"}, "smaller for an aplanatic"),
        ({"tolerance": 0.0}, "tolerance = 0"),
        ({"pupil": optics.Pupil(1e-3), "apodization": "aplanatic"}, "must be an ideal lens without relief"),
        ({"sensor_distance": -1}, "sensor_distance = -1"),
    ],
)
def test_bad_arguments_are_named(change, words):
    with pytest.raises(ValueError, match=words):
        optics.vector_focus(**{"pupil": lens(0.7), "wavelength": WAVELENGTH, **change})
