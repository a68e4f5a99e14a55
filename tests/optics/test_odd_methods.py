"""Arguments of methods, with values of the wrong kind: an answer, or a one-line error of this project. See
`test_odd_arguments`."""

from functools import cache

import numpy as np
import pytest

import optics
from tests.odd_arguments import complaints, masked_complaints
from tests.slow_part import slow

GREEN = {"wavelength": 500e-9}
ANGLES = {"angle_x": np.array([0.0, 0.01]), "angle_y": np.array([0.0, 0.01])} | GREEN
SPECTRUM = {"wavelengths": np.array([500e-9, 600e-9])}
VIEW = {"sensor_distance": 240e-6, "dx": 0.5e-6, "shape": (17, 17)}
LENS = optics.Pupil(20e-6, thin_lens_focal_length=240e-6)
D65 = optics.illuminant("D65")


@cache
def eye():
    return optics.Eye(LENS, resolution=(3, 3))


@cache
def facets():
    return optics.AppositionEye(
        optics.Ommatidium(optics.FacetLens(25e-6, 30e-6), optics.Waveguide(2e-6)), rings=1, interommatidial_deg=2.0
    )


@cache
def focus():
    pupil = optics.Pupil(100e-6, thin_lens_focal_length=240e-6)
    return optics.vector_focus(pupil, dx=0.1e-6, shape=(17, 17), tolerance=0.1)


@cache
def white():
    return optics.white_psf(LENS, **VIEW)


def mode():
    return facets().ommatidium.rhabdom.modes(500e-9)[0]


def noise():
    return np.random.default_rng(0)


# A bound method and a valid call of it, created when the test runs.
CALLS = {
    "AppositionEye.contrast": lambda: (facets().contrast, {"cycles_per_degree": 0.1, "azimuth_deg": 0.0} | GREEN),
    "AppositionEye.field": lambda: (facets().field, GREEN),
    "BSplineRelief.paraboloid": lambda: (
        optics.BSplineRelief.paraboloid, {"height": 1e-6, "curvature": 0.1, "radius": 1.0}),
    "Cornu.at": lambda: (optics.Cornu(1.5, 0.01, 0.1).at, GREEN),
    "Eye.in_bands": lambda: (eye().in_bands, {"radiance": D65}),
    "Eye.kernel": lambda: (eye().kernel, {"samples_per_receptor": 2, "z": 1.0, "direction_deg": (0.0, 0.0)}),
    "Eye.psf": lambda: (eye().psf, {"z": 1.0}),
    "Eye.see": lambda: (eye().see, {
        "radiance": np.ones((4, 6, 6)), "samples_per_receptor": 2, "rng": noise(), "z": 1.0,
        "sight": eye().sight(2), "polarization": None}),
    "Eye.sight": lambda: (eye().sight, {
        "samples_per_receptor": 2, "z": np.array([1.0]), "depth_layers": 1, "tolerance": None, "light_from": "cells"}),
    "FacetLens.focal_length": lambda: (optics.FacetLens(25e-6, 30e-6).focal_length, GREEN),
    "FacetLens.object_focal_length": lambda: (optics.FacetLens(25e-6, 30e-6).object_focal_length, GREEN),
    "FacetLens.power": lambda: (optics.FacetLens(25e-6, 30e-6).power, GREEN),
    "FacetLens.principal_planes": lambda: (optics.FacetLens(25e-6, 30e-6).principal_planes, GREEN),
    "Grid.moved": lambda: (optics.Grid.square(5, 1e-6).moved, {"centre": (0.0, 0.0)}),
    "Grid.square": lambda: (optics.Grid.square, {"n": 5, "dx": 1e-6}),
    "HumanEye.frequency": lambda: (optics.HumanEye(1e-3).frequency, {"cycles_per_degree": np.array([1.0])}),
    "MTF.first": lambda: (optics.mtf(white()).first, {"count": 1}),
    "MTF.profile": lambda: (optics.mtf(white()).profile, {"frequencies": np.array([0.0, 1e4])}),
    "Microvilli.absorbed": lambda: (optics.Microvilli().absorbed, {"light": focus()}),
    "Microvilli.polarization_sensitivity": lambda: (optics.Microvilli().polarization_sensitivity,
        {"light": focus(), "radius": 0.5e-6, "centre": None}),
    "Microvilli.signal": lambda: (optics.Microvilli().signal,
        {"light": focus(), "radius": 0.5e-6, "centre": None, "with_error": False}),
    "Mode.field": lambda: (mode().field, {"x": np.zeros(1), "y": np.zeros(1)}),
    "Ommatidium.acceptance_angle": lambda: (facets().ommatidium.acceptance_angle, {"azimuth_deg": 0.0} | GREEN),
    "Ommatidium.mode_power": lambda: (facets().ommatidium.mode_power, ANGLES),
    "Ommatidium.modes": lambda: (facets().ommatidium.modes, GREEN),
    "Ommatidium.sensitivity": lambda: (facets().ommatidium.sensitivity, ANGLES),
    "PhotonBudget.photons": lambda: (
        optics.PhotonBudget().photons, {"bands": optics.SpectralBands.uniform(4), "etendue": 1e-15}),
    "Pigment.at": lambda: (optics.Pigment(530.0).at, SPECTRUM),
    "Polygon.regular": lambda: (optics.Polygon.regular, {"n": 6, "rotation_deg": 0.0}),
    "Pupil.image_distance": lambda: (LENS.image_distance, {"source_distance": 1.0}),
    "Receptors.arranged": lambda: (optics.receptors_of("rgb").arranged, {"mosaic": [[0, 1], [2, 0]]}),
    "Receptors.catch": lambda: (optics.receptors_of("rgb").catch, {"nm": np.array([500.0, 600.0])}),
    "Receptors.layout": lambda: (optics.receptors_of("rgb").layout, {"resolution": (3, 3)}),
    "RefractiveIndex.at": lambda: (optics.RefractiveIndex(1.5, 0.0, 0.0, 0.0).at, GREEN),
    "RefractiveIndex.from_abbe": lambda: (optics.RefractiveIndex.from_abbe, {"n_d": 1.5, "abbe_number": 50.0}),
    "Rings.zone_plate": lambda: (optics.Rings.zone_plate,
        {"aperture_radius": 1e-3, "focal_length": 1e-2, "open_centre": True} | GREEN),
    "Sellmeier.at": lambda: (optics.Sellmeier((1.0,), (0.01,)).at, GREEN),
    "SpectralBands.of": lambda: (
        optics.SpectralBands.uniform(4).of, {"radiance": D65, "receptors": "rgb", "nonnegative": False}),
    "SpectralBands.uniform": lambda: (optics.SpectralBands.uniform, {"bands": 4, "receptors": "rgb"}),
    "Spectrum.at": lambda: (optics.Spectrum((400.0, 700.0), (1.0, 1.0)).at, SPECTRUM),
    "Waveguide.absorbed": lambda: (optics.Waveguide(2e-6).absorbed, {"mode": mode()}),
    "Waveguide.guided_length": lambda: (optics.Waveguide(2e-6).guided_length, {"mode": mode()}),
    "Waveguide.modes": lambda: (optics.Waveguide(2e-6).modes, GREEN),
    "Waveguide.v_number": lambda: (optics.Waveguide(2e-6).v_number, GREEN),
    "WhitePSF.encircled_energy": lambda: (
        white().encircled_energy, {"radii": 1e-6, "centre": None, "with_error": False}),
    "WhitePSF.mtf": lambda: (white().mtf, {"tolerance": 0.02}),
    "WhitePSF.strehl_ratio": lambda: (white().strehl_ratio, {"with_error": False}),
    "Zernike.at": lambda: (optics.Zernike([0, 0, 0, 0.1], 1e-3).at, {"x": np.zeros(1), "y": np.zeros(1)}),
}  # fmt: skip


@pytest.mark.fast_cases(8)
@pytest.mark.parametrize("name", [slow(name) if name == "AppositionEye.contrast" else name for name in CALLS])
@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # NaN in, NaN out
def test_any_argument(name):
    assert complaints(*CALLS[name]()) == {}


@pytest.mark.parametrize("name", CALLS)
def test_masked_elements_are_refused(name):
    """NumPy would use the numbers under the mask as data."""
    assert masked_complaints(*CALLS[name](), np.random.default_rng(len(name))) == {}


@pytest.mark.parametrize("odd", [None, "many", 0, 1.5, np.zeros((2, 2))])
def test_zones_of_the_field(odd):
    """This is a separate test, because "auto" and two zones take seconds."""
    with pytest.raises(ValueError, match=r"field_zones = .*: must be"):
        eye().sight(2, field_zones=odd)


@pytest.mark.parametrize("odd", [None, 1.0, np.ones(3), "D65"])
def test_a_scene_that_is_no_function(odd):
    with pytest.raises(ValueError, match="must be a function of angles x and y"):
        facets().see(odd)


def test_angles_of_different_shapes():
    with pytest.raises(ValueError, match=r"angle_x has shape \(2,\) and angle_y \(3,\): must be equal"):
        facets().ommatidium.mode_power(np.zeros(2), np.zeros(3))


def test_flags_of_measures():
    spot = optics.psf(LENS, **VIEW)
    for measure, others in (
        (optics.strehl_ratio, ()), (optics.encircled_energy, (1e-6,)), (optics.image_quality, (1e5,))
    ):  # fmt: skip
        with pytest.raises(ValueError, match=r"with_error = 'no': must be True or False"):
            measure(spot, *others, with_error="no")


@pytest.mark.parametrize(("rule", "shapes", "says"), [([], (optics.Circle(),), "rule"), ("union", None, "shapes")])
def test_openings_of_what_is_none(rule, shapes, says):
    with pytest.raises(ValueError, match=f"^{says} = .*: must be"):
        optics.Combined(rule, shapes)
