"""Calls of `optics` with an eye or an ommatidium, for the walk of arguments."""

import numpy as np

import optics
from optics import Eye, Pupil, Waveguide, Zernike
from sim.render.receptors_in_time import ReceptorsInTime
from tests.walked_arguments import NoEffect, Walk, With

LENS = {"aperture_radius": 10e-6, "thin_lens_focal_length": 80e-6}
EYE = Eye(Pupil(**LENS), (2, 2), 60.0, bands=1)
SCENE = np.linspace(0, 1, 64).reshape(1, 8, 8)
CAMERA_LENS = Pupil(0.1e-3, thin_lens_focal_length=2e-3)
COLOURS = np.linspace(0, 1, 4 * 8 * 3).reshape(4, 8, 3)
FACET = optics.FacetLens(12e-6, 14e-6)
EYELET = optics.Ommatidium(FACET, Waveguide(2e-6))
COMPOUND = optics.AppositionEye(EYELET, 1, 2.0)
TINT = optics.Spectrum((500,), (0.1,))
IN_COLOUR = {"wavelength": 400e-9}


def looked(**given):
    """Return kernel and signals of an eye."""
    eye = Eye(**{"pupil": Pupil(**LENS), "resolution": (2, 2), "fov_deg": 60.0, "bands": 1, **given})
    layers = len(eye.spectral_bands.wavelengths)
    scene = np.linspace(0, 1, layers * 64).reshape(layers, 8, 8)
    noisy = eye.see(scene, 2, rng=np.random.default_rng(0), polarization=(0.5, 20.0) if eye.microvilli else None)
    return eye.kernel(2), noisy, eye.tolerance


def photographed(**given):
    """Return the image of a camera, and the spectral bands of its eye."""
    sensor = optics.Sensor((2, 4), 4e-6, **given)
    scene = np.linspace(0, 1, 8 * 10 * 3).reshape(8, 10, 3)[:, :8]
    found = optics.camera_image(scene, CAMERA_LENS, sensor, rng=np.random.default_rng(0))
    return found, optics.camera_eye(CAMERA_LENS, sensor).spectral_bands.wavelengths


def in_time(**given):
    """Return responses to two frames."""
    receptors = ReceptorsInTime(optics.ReceptorDynamics(**given), 1, (1, 1, 1, 2), 0.02)
    receptors.start(np.full((1, 1, 1, 1, 2), 0.5, np.float32), np.arange(1))
    return [receptors.step(np.array([0.2, 0.9], np.float32).reshape(1, 1, 1, 1, 2), np.arange(1)) for _ in range(2)]


def guided(**given):
    guide = Waveguide(2e-6, **{"length": 2e-4, **given})
    modes = guide.modes(5e-7)
    return [mode.field(1e-7, 2e-7) for mode in modes], [guide.absorbed(mode) for mode in modes]


def ommatidium(**given):
    return optics.Ommatidium(FACET, Waveguide(2e-6), **given).sensitivity(np.linspace(0, 0.05, 3), np.zeros(3))


def facet(**given):
    return optics.FacetLens(12e-6, 14e-6, **given).pupil()


def colours(**asked):
    kinds = optics.Receptors((440, 530), **asked)
    eye = Eye(None, (2, 2), bands=2, receptors=kinds)
    return eye.see(np.linspace(0, 1, 8).reshape(2, 2, 2), 1), eye.spectral_bands.wavelengths


OF_EYES = {
    "Eye": Walk(
        looked,
        {
            "pupil": None,
            "resolution": (2, 3),
            "fov_deg": 50.0,
            "sensor_width": 1e-4,
            "bands": 2,
            "noise_sigma": 0.1,
            "tolerance": 0.1,
            "dtype": "float64",
            "photon_budget": optics.PhotonBudget(100.0),
            "receptors": "honeybee",
            "full_aperture": 2e-5,
            "eccentricity_deg": (5.0, 0.0),
            "most_seconds": NoEffect("it only refuses: test_kept_kernels"),
            "waveguide": Waveguide(2e-6),
            "microvilli": optics.Microvilli(),
            "pupil_turned": With(True, {"pupil": Pupil(**LENS, wavefront=Zernike({(3, 1): 0.2}))}),
            "vertical_fov_deg": 30.0,
            "density": optics.Fovea(5.0),
            "dynamics": NoEffect("it needs time, which environments have: tests/sim/envs/test_receptors_in_time.py"),
        },
    ),
    "Sensor": Walk(
        photographed,
        {
            "filters": "rgb",
            "photon_budget": optics.PhotonBudget(3e3, 1e-3),
            "full_well": 3e3,
            "read_noise": 50.0,
            "bits": None,
            "bands": 4,
        },
    ),
    "camera_eye": Walk(
        lambda **asked: optics.camera_eye(CAMERA_LENS, optics.Sensor((2, 4), 4e-6), **asked).kernel(1),
        {"sensor_distance": 2.1e-3, "tolerance": 0.1},
    ),
    "camera_image": Walk(
        lambda **asked: optics.camera_image(COLOURS, **{"lens": CAMERA_LENS, **asked}),
        {
            "sensor": With(optics.Sensor((2, 4), 5e-6), {"sensor": optics.Sensor((2, 4), 4e-6)}),
            "depth": With(0.02, {"sensor": optics.Sensor((2, 4), 4e-6)}),
            "field_zones": With(3, {"sensor": optics.Sensor((2, 4), 1e-4, full_well=1e9, bits=None)}),
            "samples_per_pixel": With(2, {"sensor": optics.Sensor((2, 4), 4e-6)}),
            "rng": With(np.random.default_rng(0), {"sensor": optics.Sensor((2, 4), 4e-6)}),
            "sensor_distance": With(2.1e-3, {"sensor": optics.Sensor((2, 4), 4e-6)}),
            "tolerance": With(0.2, {"sensor": optics.Sensor((2, 4), 4e-6, bits=None)}),
        },
    ),
    "ReceptorDynamics": Walk(
        in_time,
        {
            "time_constant_ms": 30.0,
            "order": 2,
            "latency_ms": 20.0,
            "adaptation": "naka_rushton",
            "adaptation_ms": With(100.0, {"adaptation": "logarithmic"}),
            "dark_light": With(0.1, {"adaptation": "logarithmic"}),
            "event_threshold": 0.3,
            "motion": "barlow_levick",
            "motion_ms": With(5.0, {"motion": "hassenstein_reichardt"}),
            "frames": NoEffect("environments render them: tests/sim/envs/test_receptors_in_time.py"),
        },
    ),
    "Fovea": Walk(
        lambda **given: optics.Fovea(**given)(np.array([1.0, 9.0]), np.array([2.0, -5.0])),
        {"e2_deg": 3.0, "center_deg": (1.0, 0.0)},
    ),
    "VisualStreak": Walk(
        lambda **given: optics.VisualStreak(**given)(np.array([1.0, 9.0]), np.array([2.0, -5.0])),
        {"e2_deg": 3.0, "elevation_deg": 1.0},
    ),
    "TurbidMedium": Walk(
        lambda **given: repr(optics.immersed(EYE, optics.TurbidMedium(TINT, TINT, **given)).pupil),
        {"refractive_index": optics.medium("water")},
    ),
    "Eye.describe": Walk(lambda **asked: str(EYE.describe(**asked)), {"z": 1e-3, "direction_deg": (10.0, 5.0)}),
    "Eye.kernel": Walk(lambda **asked: EYE.kernel(2, **asked), {"z": 1e-3, "direction_deg": (10.0, 0.0)}),
    "Eye.psf": Walk(lambda **asked: EYE.psf(**asked).psf, {"z": 1e-3}),
    "Eye.see": Walk(
        lambda **asked: EYE.see(SCENE, 2, **asked),
        {
            "rng": np.random.default_rng(0),
            "z": 1e-3,
            "sight": EYE.sight(2, 1e-3),
            "polarization": NoEffect("see the table of eyes with microvilli, below"),
        },
    ),
    "Eye.sight": Walk(
        lambda **asked: str(EYE.sight(2, **asked)) + str(EYE.see(SCENE, 2, sight=EYE.sight(2, **asked))),
        {
            "z": 1e-3,
            "depth_layers": With(3, {"z": np.array([1e-3, 1.0])}),
            "field_zones": 3,
            "tolerance": With(0.3, {"z": np.array([1e-4, 1.0])}),
            "light_from": "centres",
        },
    ),
    "anatomical_acuity": Walk(lambda **asked: optics.anatomical_acuity(1e11, 0.017, **asked), {"lattice": "square"}),
    "ideal_contrast_sensitivity": Walk(
        lambda **asked: optics.ideal_contrast_sensitivity(1.0, 0.5, 1e6, 1.0, **asked), {"d_prime": 2.0}
    ),
    "least_eye_parameter": Walk(lambda **asked: optics.least_eye_parameter(5e-7, **asked), {"lattice": "square"}),
    "optical_sensitivity": Walk(
        lambda **asked: optics.optical_sensitivity(2e-5, 5e-5, 2e-6, **asked),
        {"length": 1e-4, "absorption": With(1e4, {"length": 1e-4}), "light": With("peak", {"length": 1e-4})},
    ),
    "sampling_acuity": Walk(lambda **asked: optics.sampling_acuity(1.0, **asked), {"lattice": "square"}),
    "PhotonBudget": Walk(
        lambda **given: looked(photon_budget=optics.PhotonBudget(**given)),
        {"illuminance": 100.0, "integration_time": 0.1, "quantum_efficiency": 0.1},
    ),
    "Pigment": Walk(lambda **given: optics.Pigment(530, **given).at(np.array([5e-7])), {"chromophore": "A2"}),
    "Receptors": Walk(colours, {"mosaic": ((0, 1), (1, 0)), "range_nm": (400, 700)}),
    "SpectralBands.uniform": Walk(
        lambda **asked: optics.SpectralBands.uniform(2, **asked).wavelengths, {"receptors": "honeybee"}
    ),
    "SpectralBands.band_values": Walk(
        lambda **asked: optics.SpectralBands.uniform(4).band_values(
            lambda at: 1.0 * (np.abs(at - 500e-9) < 3e-9), "rgb", **asked
        ),
        {"nonnegative": True},
    ),
}
OF_FACETS = {
    "FacetLens": Walk(
        facet,
        {
            "radius_back": -1e-5,
            "thickness": With(1e-5, {"radius_back": -1e-5}),
            "n": 1.5,
            "object_n": 1.33,
            "medium_n": 1.36,
            "shape": "circle",
        },
    ),
    **{
        f"FacetLens.{name}": Walk(
            lambda name=name, **asked: getattr(
                optics.FacetLens(12e-6, 14e-6, -2e-5, 1e-5, optics.RefractiveIndex(1.45, 4e-15)), name
            )(**asked),
            IN_COLOUR,
        )
        for name in ("focal_length", "object_focal_length", "principal_planes", "pupil")
    },
    "Ommatidium": Walk(ommatidium, {"distance": 5e-5}),
    "Ommatidium.modes": Walk(EYELET.modes, IN_COLOUR),
    "Ommatidium.mode_power": Walk(lambda **asked: EYELET.mode_power(np.zeros(1), np.zeros(1), **asked), IN_COLOUR),
    "Ommatidium.sensitivity": Walk(lambda **asked: EYELET.sensitivity(np.zeros(1), np.zeros(1), **asked), IN_COLOUR),
    "Ommatidium.acceptance_angle": Walk(EYELET.acceptance_angle, {**IN_COLOUR, "azimuth_deg": 15.0}),
    "acceptance_function": Walk(
        lambda **given: optics.acceptance_function(EYELET, [500e-9], **given).values, {"loss": 1e-2}
    ),
    "AppositionEye.contrast": Walk(lambda **asked: COMPOUND.contrast(0.2, **asked), {**IN_COLOUR, "azimuth_deg": 15.0}),
    "AppositionEye.field": Walk(COMPOUND.field, IN_COLOUR),
    "AppositionEye.see": Walk(lambda **asked: COMPOUND.see(lambda x, y: x, **asked), IN_COLOUR),
    "Waveguide": Walk(
        guided, {"n_core": 1.38, "n_clad": 1.33, "length": 1e-4, "absorption": 1e4, "proximal_diameter": 1e-6}
    ),
    "Mode": Walk(lambda **given: optics.Mode(1, 1, 2.0, 2.0, 1e-6, **given).field(1e-7, 2e-7), {"sine": True}),
}
