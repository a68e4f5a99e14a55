"""Limits of an eye's parameters, and the lengths that follow from them in closed form."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

import optics
from optics import Eye, PhotonBudget, Pupil
from optics.eye import geometry
from optics.eye.eye_spec import EyeSpec
from optics.eye.receptor_lattice import even_lattice
from tests.optics.device_types import Float64


@pytest.mark.parametrize(
    ("name", "low", "high"),
    [("fov_deg", 1e-3, 170), ("vertical_fov_deg", 1e-3, 170), ("noise_sigma", 0, 1e6), ("tolerance", 1e-6, 0.5)],
)
def test_limits_of_parameters(name, low, high):
    for limit, beyond in ((low, low - 1e-9), (high, high * (1 + 1e-6))):
        assert getattr(EyeSpec(**{name: limit}), name) == limit
        with pytest.raises(ValueError, match=rf"^{name} = .*: must lie in"):
            EyeSpec(**{name: beyond})


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"sensor_width": 0.0}, "sensor_width = 0"),
        ({"most_seconds": -1}, "most_seconds = -1"),
        ({"dtype": "float16"}, "dtype = 'float16': must be 'float32' or 'float64'"),
        ({"pupil_turned": True}, "pupil_turned = True and pupil = None"),
        ({"pupil_turned": 1}, "pupil_turned = 1"),
        ({"photon_budget": 3}, "photon_budget = 3"),
        ({"dynamics": 3}, "dynamics = 3"),
        ({"resolution": (0, 3)}, "resolution"),
        ({"bands": "auto"}, "bands = 'auto': must be a number of bands, except in an Eye"),
        ({"full_aperture": 0.0}, "full_aperture = 0"),
        ({"pupil": Pupil(1.01e-4)}, r"pupil.aperture_radius = 0.000101: must be at most sensor_width / 2 = 0.0001 m"),
        ({"pupil": Pupil(1.01e-4), "full_aperture": 2e-4}, "must be at most full_aperture / 2 = 0.0001 m"),
        ({"eccentricity_deg": (80.1, 0)}, "eccentricity_deg = 80.1"),
        ({"eccentricity_deg": (0, -80.1)}, "eccentricity_deg = -80.1"),
    ],
)
def test_parameters_that_are_refused(given, message):
    with pytest.raises(ValueError, match=message):
        EyeSpec(**given)


def test_the_widest_pupil_fits_exactly():
    for given in ({}, {"full_aperture": 2e-4, "sensor_width": 1e-5}):
        assert EyeSpec(Pupil(1e-4 * (1 + 4e-10)), **given).relative_aperture == pytest.approx(1)
        with pytest.raises(ValueError, match="aperture_radius"):
            EyeSpec(Pupil(1e-4 * (1 + 2e-9)), **given)
    assert EyeSpec(eccentricity_deg=(80, -80)).eccentricity_deg == (80, -80)


def test_lengths_of_an_eye():
    eye = EyeSpec(
        resolution=(4, 10), fov_deg=90.0, sensor_width=2e-4, vertical_fov_deg=2 * math.degrees(math.atan(0.6))
    )
    assert eye.sensor_distance == pytest.approx(1e-4)
    assert eye.retina_distance == eye.sensor_distance
    assert eye.receptor_pitch == pytest.approx(2e-5)
    assert eye.receptor_size == pytest.approx((3e-5, 2e-5))
    assert eye.smallest_receptor == eye.receptor_size
    assert eye.smallest_share == 1.0
    assert eye.fovy_deg == pytest.approx(eye.vertical_fov_deg)
    assert (eye.relative_aperture, eye.throughput, eye.parallax, eye.widest_pupil) == (1.0, 1.0, 0.0, 2e-4)
    assert eye.lattice is eye.photons is eye.receptor_photons is eye.mosaic is None
    _, across = eye.receptor_angles_deg
    np.testing.assert_allclose(across[0, 5], math.degrees(math.atan(0.2 / math.hypot(1, 0.45))), rtol=1e-9)
    right, up = eye.receptor_directions_deg
    np.testing.assert_allclose(np.tan(np.radians(right[2])), (np.arange(10) - 4.5) / 5)
    np.testing.assert_allclose(np.tan(np.radians(up[:, 3])), [0.45, 0.15, -0.15, -0.45])
    square = EyeSpec(resolution=(4, 10), fov_deg=90.0, sensor_width=2e-4)
    assert square.fovy_deg == pytest.approx(2 * math.degrees(math.atan(0.4)))
    assert square.receptor_size == (2e-5, 2e-5)


def test_light_behind_a_pupil():
    mask = optics.MaskMap(np.full((4, 4), 0.5))
    pupil = Pupil(25e-6, aperture=optics.Annulus(0.6), mask=mask)
    eye = EyeSpec(pupil, (5, 10), 90.0, 2e-4)
    assert eye.relative_aperture == pytest.approx(0.25)
    assert eye.aperture_throughput == pytest.approx(0.25**2 * 0.64)
    assert eye.throughput == pytest.approx(0.25**2 * 0.64 / 4, rel=1e-3)
    assert eye.parallax == pytest.approx(5e-5 * 1e-4 / 2e-5)
    tall = EyeSpec(pupil, (5, 10), 90.0, 2e-4, vertical_fov_deg=2 * math.degrees(math.atan(0.25)))
    assert tall.parallax == pytest.approx(5e-5 * 1e-4 / 1e-5)
    wide = EyeSpec(pupil, (5, 10), 90.0, 2e-4, full_aperture=4e-4)
    assert (wide.relative_aperture, wide.widest_pupil) == (pytest.approx(0.125), 4e-4)


def test_photons_of_receptors():
    budget = PhotonBudget(100.0, 0.02)
    eye = EyeSpec(resolution=(2, 4), fov_deg=90.0, sensor_width=2e-4, photon_budget=budget, full_aperture=4e-4)
    etendue = math.pi / 4 * (5e-5) ** 2 * (4e-4 / 1e-4) ** 2
    assert geometry.etendue(4e-4, 25e-10, 1e-4) == pytest.approx(etendue)
    np.testing.assert_allclose(eye.photons, budget.photons(eye.spectral_bands, etendue))
    np.testing.assert_allclose(eye.receptor_photons, eye.photons[:, None, None])
    mosaic = EyeSpec(
        resolution=(2, 4),
        fov_deg=90.0,
        sensor_width=2e-4,
        photon_budget=budget,
        full_aperture=4e-4,
        receptors=optics.receptors_of("rgb").arranged(((0, 1), (1, 2))),
    )
    red, green, blue = mosaic.photons
    np.testing.assert_allclose(mosaic.receptor_photons, [[[red, green, red, green], [green, blue, green, blue]]])
    assert (mosaic.channels, eye.channels) == (1, 3)


def test_receptors_with_a_density():
    """The left half of the retina is three times as dense as the right half."""
    eye = EyeSpec(resolution=(2, 4), fov_deg=90.0, sensor_width=2e-4, density=np.array([[3.0, 1.0]]))
    np.testing.assert_allclose(eye.lattice.columns, [[-2, -4 / 3, -2 / 3, 0, 2]] * 2)
    assert eye.smallest_receptor == pytest.approx((5e-5, 5e-5 * 2 / 3))
    assert eye.smallest_share == pytest.approx(2 / 3)
    own = even_lattice((2, 4))
    assert EyeSpec(resolution=(2, 4), density=own).lattice is own
    for given, message in (
        ({"fov_deg": Float64(45.0)}, "density is given and fov_deg is a Dr.Jit array"),
        ({"pupil": Pupil(1e-5), "waveguide": optics.Waveguide(2e-6)}, "density and waveguide are given"),
        ({"resolution": (4, 2)}, r"density is a lattice of \(2, 4\) receptors: must be of \(4, 2\)"),
    ):
        with pytest.raises(ValueError, match=f"^{message}"):
            EyeSpec(**({"resolution": (2, 4), "density": own} | given))


def test_focal_lengths_of_fields_of_view():
    for degrees in (10.0, 100.0, 170.0):
        exact = 3.0 / (2 * math.tan(math.radians(degrees / 2)))
        assert geometry.focal_length(3.0, degrees) == pytest.approx(exact)
        assert float(geometry.focal_length(3.0, Float64(degrees))[0]) == pytest.approx(exact)
    geometry.check_vertical(None, Float64(1.0))
    with pytest.raises(ValueError, match=r"^vertical_fov_deg is given and fov_deg is a Dr.Jit array"):
        geometry.check_vertical(10.0, Float64(1.0))


def test_tangents_of_directions():
    assert geometry.tangents((45.0, 30.0)) == pytest.approx((1.0, -1 / math.sqrt(3)))
    for good in ((80, -80), (-80, 80)):
        assert geometry.direction("x", good) == good


def test_distances_behind_a_pupil():
    assert geometry.behind_pupil(None, 2.0) == 2.0
    assert geometry.behind_pupil(Pupil(1e-5, medium_n=1.5), 2.0) == 2.0
    assert geometry.behind_pupil(Pupil(1e-5, medium_n=1.5, object_n=1.2), 2.0) == pytest.approx(2.5)


def test_a_lens_that_is_no_pupil():
    """The message says so if the object has a pupil."""
    for given, its in ((SimpleNamespace(pupil=Pupil(1e-5)), True), (SimpleNamespace(pupil=3), False)):
        with pytest.raises(ValueError, match=r"^pupil = ") as refused:
            geometry.check_pupil(given, 1.0, None)
        assert ("(it has one, its `pupil`)" in str(refused.value)) == its


def test_fields_of_view_in_water():
    """The retina is at the same distance, so that the tangent of half the field is divided by the ratio of indices."""
    water = optics.sea_water(1)
    index = water.refractive_index.at(550e-9)
    pupil = Pupil(1e-5, medium_n=1.4, object_n=1.1)
    eye = Eye(pupil, fov_deg=60.0, vertical_fov_deg=40.0)
    wet = optics.immersed(eye, water)
    for before, after in ((60, wet.fov_deg), (40, wet.vertical_fov_deg)):
        assert math.tan(math.radians(after / 2)) == pytest.approx(math.tan(math.radians(before / 2)) * 1.1 / index)
    assert wet.retina_distance == pytest.approx(eye.retina_distance)
    assert wet.pupil.index_before(550e-9) == pytest.approx(index)
    assert optics.immersed(Eye(pupil), water).vertical_fov_deg is None
    filled = optics.immersed(Eye(Pupil(1e-5)), water)
    assert (filled.fov_deg, filled.pupil.object_n) == (45.0, None)
    assert filled.pupil.index_behind(550e-9) == pytest.approx(index)
    for same, medium in ((eye, None), (Eye(), water)):
        assert optics.immersed(same, medium) is same
    for wrong, medium in ((3, water), (eye, 3)):
        with pytest.raises(ValueError, match=r"^(eye|medium) = 3"):
            optics.immersed(wrong, medium)
