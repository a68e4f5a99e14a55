"""Wrong units and refusals: the true reason, in one line, at once."""

import numpy as np
import pytest

import optics

PHASE = np.random.default_rng(0).random((32, 32)) * 6.28


@pytest.mark.parametrize("radius", [25e-6, 1e-3])
@pytest.mark.parametrize("relief", [optics.HeightMap, optics.PixelRelief, lambda h: optics.BSplineRelief(h[:4, :4])])
def test_heights_in_radians_are_no_lengths(radius, relief):
    """Heights in radians would otherwise need 290 GiB."""
    with pytest.raises(
        ValueError, match=r"height spans \d.* must be in metres, at most 100 radii or 0.001 m \(a phase φ \[rad\]"
    ):
        optics.Pupil(radius, height=relief(PHASE))
    optics.Pupil(radius, height=relief(PHASE * 1e-7))


def test_steep_heights_need_no_memory_to_be_refused():
    with pytest.raises(optics.AccuracyError, match=r"needs .* (samples across|nodes), .* GB"):
        optics.psf(optics.Pupil(5e-3, height=PHASE[:12, :12] * 5e-2))


def test_a_refusal_names_what_there_is():
    """An aperture 25 m wide has no relief to flatten, so the message names its radius. A relief of millimetres is
    named."""
    with pytest.raises(optics.AccuracyError, match=r"the pupil \(radius 25 m, Fresnel number [\d.e+]+\)$"):
        optics.psf(optics.Pupil(25))
    for radius in (25e3, 10 ** np.random.default_rng(1).uniform(1, 5)):  # nanometres, and any other unit
        with pytest.raises(optics.AccuracyError, match=r"needs .* the pupil \(radius [\d.e+]+ m, Fresnel number"):
            optics.psf(optics.Pupil(radius))
    with pytest.raises(optics.AccuracyError, match=r"Fresnel number [\d.]+\); a flatter height needs less$"):
        optics.psf(optics.Pupil(25e-6, np.random.default_rng(0).random((8, 8)) * 0.9e-3))


def test_a_wrapped_height_map_before_a_vector_focus_needs_no_pixels():
    """`optics.vector_focus` refuses pixels, so its message does not recommend them."""
    x = (np.arange(128) + 0.5) / 64 - 1
    wrapped = (-(60e-6**2) * (x**2 + x[:, None] ** 2) / 480e-6) % 1.1e-6
    with pytest.raises(optics.AccuracyError, match=r"height jumps by .*: must be smooth, for each point to have one"):
        optics.vector_focus(
            optics.Pupil(60e-6, wrapped, thin_lens_focal_length=480e-6), sensor_distance=480e-6, tolerance=1e-4
        )


def test_pixels_are_square():
    heights = np.random.default_rng(0).random((16, 48)) * 3e-7
    with pytest.raises(optics.AccuracyError, match=r"PixelRelief\(height\) represents the steps of as many rows as"):
        optics.psf(optics.Pupil(15e-6, heights), dtype="float64", tolerance=1e-7, method="rayleigh_sommerfeld")


def test_a_wrapped_height_map_points_at_pixels():
    x = (np.arange(128) + 0.5) / 64 - 1
    for radius in (60e-6, 200e-6):  # too slow at this tolerance
        wrapped = (-(radius**2) * (x**2 + x[:, None] ** 2) / (8 * radius)) % 1.1e-6
        with pytest.raises(optics.AccuracyError, match=r"height jumps by .* optics\.PixelRelief\(height\)"):
            optics.psf(optics.Pupil(radius, height=wrapped), sensor_distance=8 * radius, tolerance=1e-4)
    smooth = optics.HeightMap(-(60e-6**2) * (x**2 + x[:, None] ** 2) / (480e-6))
    assert smooth.jump == 0
    assert optics.HeightMap(wrapped).jump == pytest.approx(1.1e-6, rel=0.05)


@pytest.mark.parametrize(
    ("pupil", "options"),
    [
        (optics.Pupil(25e-6, aperture=optics.Polygon.regular(6)), {}),
        (optics.Pupil(25e-6), {"source_angle": (0.1, 0.0)}),
        (optics.Pupil(25e-6, optics.BSplineRelief(np.eye(4) * 1e-6)), {}),
    ],
)
def test_hankel_is_refused_for_want_of_symmetry(pupil, options):
    with pytest.raises(optics.AccuracyError, match="rotationally symmetric relief") as error:
        optics.psf(pupil, method="hankel", **options)
    assert "grazing" not in str(error.value)


def test_refusals_name_the_tolerance_that_was_asked_for():
    lens = optics.Pupil(25e-6, thin_lens_focal_length=240e-6)
    with pytest.raises(optics.AccuracyError, match=r"^tolerance = 2e-05: "):
        optics.psf(lens, [550e-9], tolerance=2e-5, centre=(3e-4, 3e-4))


def test_a_lens_focuses_where_nobody_says_otherwise():
    lens = optics.Pupil(100e-6, thin_lens_focal_length=2e-3)
    assert optics.strehl_ratio(optics.psf(lens))[0] == pytest.approx(1, abs=1e-3)
    near = optics.psf(lens, source_distance=6e-3)
    assert near.sensor_distance == pytest.approx(3e-3)
    assert optics.psf_batch([lens, optics.Pupil(20e-6)], shape=(5, 5)).psf.shape == (2, 1, 1, 5, 5)
    assert optics.psf(optics.Pupil(20e-6), shape=(5, 5)).sensor_distance == 240e-6
    for bad, distance in ((-2e-3, 1.0), (2e-3, 1e-3)):
        with pytest.raises(ValueError, match=r"sensor_distance is missing: a lens of focal length .* no real image"):
            optics.psf(optics.Pupil(100e-6, thin_lens_focal_length=bad), source_distance=distance)
