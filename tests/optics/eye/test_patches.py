"""Patches of a retina, and eyes between two media."""

import math

import numpy as np
import pytest

import optics
from optics import Eye, Pupil, medium


def fov(width, focal):
    return math.degrees(2 * math.atan(width / (2 * focal)))


WHOLE = Eye(Pupil(40e-6, thin_lens_focal_length=250e-6), (15, 15), fov(200e-6, 240e-6), 200e-6, 2)
PATCH = {"sensor_width": 200e-6 * 5 / 15, "full_aperture": 200e-6, "resolution": (5, 5), "bands": 2}


def test_a_patch_sees_what_the_middle_of_the_whole_sees():
    """The patch is also narrower than the pupil."""
    patch = Eye(WHOLE.pupil, fov_deg=fov(PATCH["sensor_width"], 240e-6), **PATCH)
    assert patch.sensor_width < 2 * WHOLE.pupil.radius
    assert patch.throughput == pytest.approx(WHOLE.throughput)
    scene = np.random.default_rng(0).random((2, 60, 60)).astype(np.float32)
    np.testing.assert_allclose(patch.see(scene, 4), WHOLE.see(scene, 4)[:, 5:10, 5:10], atol=2e-4)


def test_a_patch_aside_has_the_kernel_of_its_direction():
    patch = Eye(WHOLE.pupil, fov_deg=fov(PATCH["sensor_width"], 240e-6), eccentricity_deg=(20, -10), **PATCH)
    aside = WHOLE.kernel(3, direction_deg=(20, -10))
    np.testing.assert_allclose(patch.kernel(3), aside, atol=1e-6)
    on_axis = WHOLE.kernel(3)
    assert aside.shape != on_axis.shape or np.abs(aside - on_axis).max() > 0.01


def test_the_kernel_aside_is_the_picture_aside():
    """The reference is a PSF computed at the same place, summed in cells around the geometric image. Light from the
    right and from above travels to the left (+x) and down (-y)."""
    direction, cells = (15.0, 8.0), 3
    kernel = WHOLE.kernel(cells, direction_deg=direction)[0]
    angle = [math.radians(at) for at in direction]
    z, cell, finer = WHOLE.sensor_distance, WHOLE.receptor_pitch / cells, 9
    centre = z * math.tan(angle[0]), -z * math.tan(angle[1])
    side = finer * kernel.shape[0]
    picture = optics.psf(
        WHOLE.pupil, WHOLE.spectral_bands.wavelengths[:1], z, source_angle=(angle[0], -angle[1]), centre=centre,
        dx=cell / finer, shape=(side, side),
    )  # fmt: skip
    sums = picture.psf[0].reshape(kernel.shape[0], finer, kernel.shape[1], finer).sum(axis=(1, 3)) * picture.dx**2
    assert np.abs(kernel - sums).max() < 2e-3


def test_a_patch_of_a_human_fovea():
    """The pupil is 1.5 mm wide, and the patch of the retina half a millimetre. The contrast of stripes is limited by
    diffraction.
    """
    focal, n = 16.7e-3, medium("vitreous").at(550e-9)
    pupil = Pupil(0.75e-3, thin_lens_focal_length=focal * n, medium_n=medium("vitreous"), object_n=1.0)
    asked = {"resolution": (32, 32), "fov_deg": fov(96e-6, focal), "sensor_width": 96e-6}
    eye = Eye(pupil, full_aperture=8e-3, bands=1, noise_sigma=0.0, **asked)
    assert eye.retina_distance == pytest.approx(focal * n, rel=1e-6)
    assert eye.throughput == pytest.approx((1.5 / 8) ** 2)
    period = 4  # receptors
    scene = np.ones((1, 2 * 64, 2 * 64)) * (1 + np.cos(2 * np.pi * (np.arange(128) + 0.5) / (2 * period)))
    seen = eye.see(scene, 2)[0, 16]
    contrast = (seen.max() - seen.min()) / (seen.max() + seen.min())
    wavelength = float(eye.spectral_bands.wavelengths[0])
    s = 1 / (period * eye.receptor_pitch) * wavelength * focal / 1.5e-3  # in units of the cut-off, measured in air
    diffraction = 2 / math.pi * (math.acos(s) - s * math.sqrt(1 - s * s))
    cells = np.sinc(1 / period) * np.sinc(1 / (2 * period))  # receptor's aperture; light from the whole cell
    sampled = math.cos(math.pi / period)  # receptors next to the stripes' middle
    assert contrast == pytest.approx(diffraction * cells * sampled, rel=0.03)


def test_a_retina_behind_water_sees_the_angles_before_it():
    """The focal length f of a fish's eye stays the same if it is taken out of the water, and so do the places on the
    retina to which directions are imaged.
    """
    f = WHOLE.sensor_distance
    pupil = Pupil(30e-6, thin_lens_focal_length=1.33 * f, medium_n=1.33, object_n=1.0)
    eye = Eye(pupil, (15, 15), WHOLE.fov_deg, 200e-6, 1)
    assert eye.retina_distance == pytest.approx(1.33 * f)
    described = eye.describe()
    assert described.diffraction_cpd == pytest.approx(2 * 30e-6 / described.wavelength * math.radians(1), rel=0.02)
    same = Eye(Pupil(30e-6, thin_lens_focal_length=f), (15, 15), WHOLE.fov_deg, 200e-6, 1)
    assert described.sampling_cpd == pytest.approx(same.describe().sampling_cpd)
    assert described.acceptance_angle_deg == pytest.approx(same.describe().acceptance_angle_deg, rel=0.02)


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ({"pupil": Pupil(150e-6)}, "aperture_radius = 0.00015: must be at most sensor_width / 2"),
        ({"pupil": Pupil(150e-6), "full_aperture": 200e-6}, "must be at most full_aperture / 2"),
        ({"full_aperture": -1.0}, "full_aperture = -1"),
        ({"eccentricity_deg": 3.0}, "eccentricity_deg = 3.0"),
        ({"eccentricity_deg": (0.0, 90.0)}, "eccentricity_deg = 90"),
    ],
)
def test_bad_input_names_itself(asked, message):
    with pytest.raises(ValueError, match=message):
        Eye(**asked)
