"""Every argument of the public interface, with values of the wrong kind: an answer, or a one-line error of this
project."""

import math

import numpy as np
import pytest

import optics
from tests.odd_arguments import complaints, masked_complaints
from tests.slow_part import slow

LENS = optics.Pupil(20e-6, thin_lens_focal_length=240e-6)
WIDE = optics.Pupil(100e-6, thin_lens_focal_length=240e-6)
PICTURE = {
    "sensor_distance": 240e-6,
    "dx": 0.5e-6,
    "shape": (9, 9),
    "tolerance": 1e-2,
    "method": "auto",
    "dtype": "float32",
}
SOURCE = {"source_distance": math.inf, "source_angle": (0.0, 0.0), "centre": (0.0, 0.0)}

# Valid calls, small enough that hundreds of variants take seconds.
SHAPES = {
    "Bitmap": {"image": np.eye(3)},
    "Annulus": {"inner": 0.3},
    "Disk": {"radius": 0.3, "centre": (0.0, 0.1)},
    "Oblong": {"width": 0.3, "height": 0.2, "centre": (0.0, 0.0), "rotation_deg": 0.0},
    "Polygon": {"vertices": np.array([[0, 0], [0.5, 0], [0, 0.5]])},
    "Rings": {"radii": [0.1, 0.2, 0.3, 0.4]},
    "Slit": {"width": 0.3, "height": 0.3},
    "Spider": {"vanes": 3, "width": 0.1, "rotation_deg": 0.0},
    "hexagonal_segments": {"rings": 1, "gap": 0.01, "rotation_deg": 0.0, "without": (0,)},
}
ELEMENTS = {
    "BallLens": {"radius": 1e-3, "core_n": 1.5, "surface_n": 1.38, "medium_n": 1.336, "shape": lambda u: 1 - u * u},
    "BSplineRelief": {"control_points": np.zeros((4, 4))},
    "FacetLens": {
        "diameter": 25e-6,
        "radius_front": 30e-6,
        "radius_back": -math.inf,
        "thickness": 0.0,
        "n": 1.45,
        "medium_n": 1.34,
    },
    "FreeSpace": {"distance": 1e-3, "medium_n": 1.0},
    "GaussianMask": {"waist": 1e-5},
    "HeightMap": {"samples": np.zeros((4, 4))},
    "HumanEye": {"aperture_radius": 1e-3, "wavefront": "standard_observer"},
    "MaskMap": {"samples": np.ones((4, 4)), "reach": 1e-4},
    "Misaligned": {"pupil": LENS, "decentre": (1e-6, 0.0), "tilt": (1e-3, 0.0)},
    "PixelRelief": {"samples": np.zeros((4, 4))},
    "PointSource": {"distance": 1.0, "angle": (0.0, 0.0)},
    "Pupil": {
        "aperture_radius": 2e-5,
        "height": None,
        "n": 1.5,
        "medium_n": 1.0,
        "object_n": None,
        "thin_lens_focal_length": 240e-6,
        "aperture": optics.Circle(),
        "wavefront": None,
        "mask": None,
    },
    "WavefrontMap": {"samples": np.zeros((4, 4)), "radius": 1.0},
    "Zernike": {"coefficients_um": [0, 0, 0, 0.1], "radius": 1e-3},
    "medium": {"name": "water"},
    "phase_pupil": {"aperture_radius": 2e-5, "phase": np.ones((4, 4)), "pixels": False, "mask": None},
}
SPECTRA = {
    "Cornu": {"a": 1.5, "b_um": 0.01, "c_um": 0.1},
    "PhotonBudget": {"illuminance": 1e4, "integration_time": 0.02, "quantum_efficiency": 0.5},
    "Pigment": {"lambda_max_nm": 530.0, "chromophore": "A1"},
    "Receptors": {"types": (530.0,), "mosaic": None, "range_nm": None},
    "RefractiveIndex": {"a": 1.5, "b": 0.0, "c": 0.0, "d": 0.0},
    "Sellmeier": {"strengths": (1.0,), "poles_um2": (0.01,)},
    "Spectrum": {"wavelengths_nm": (400.0, 700.0), "values": (1.0, 1.0)},
    "illuminant": {"name": "D65"},
    "light_level": {"name": "starlight"},
    "optical_sensitivity": {
        "diameter": 2e-5,
        "focal_length": 5e-5,
        "receptor": 2e-6,
        "length": 1e-4,
        "absorption": 6.7e3,
        "light": "white",
    },
    "receptors_of": {"receptors": "rgb"},
    "reflectance": {"name": "foliage"},
}
SENSOR = {
    "pixels": (2, 2),
    "pitch": 4e-6,
    "filters": "bayer",
    "photon_budget": optics.PhotonBudget(),
    "full_well": 1e4,
    "read_noise": 2.0,
    "bits": 12,
    "bands": 2,
}
CAMERA = {"lens": LENS, "sensor": optics.Sensor(**SENSOR), "sensor_distance": 240e-6, "tolerance": 0.1}
EYES = {
    "Fovea": {"e2_deg": 1.0, "center_deg": (0.0, 0.0)},
    "VisualStreak": {"e2_deg": 5.0, "elevation_deg": 0.0},
    "Sensor": SENSOR,
    "camera_eye": CAMERA,
    "camera_image": {
        **CAMERA,
        "scene": np.ones((2, 2, 3)),
        "depth": 1.0,
        "samples_per_pixel": 1,
        "field_zones": 1,
        "rng": None,
    },
    "acceptance_function": {
        "ommatidium": optics.Ommatidium(optics.FacetLens(25e-6, 30e-6), optics.Waveguide(2e-6)),
        "wavelengths": [500e-9, 550e-9],
        "loss": 5e-3,
    },
    "AppositionEye": {
        "ommatidium": optics.Ommatidium(optics.FacetLens(25e-6, 30e-6), optics.Waveguide(2e-6)),
        "rings": 1,
        "interommatidial_deg": 2.0,
    },
    "Eye": {
        "pupil": LENS,
        "resolution": (3, 3),
        "fov_deg": 45.0,
        "sensor_width": 200e-6,
        "bands": 4,
        "noise_sigma": 0.01,
        "tolerance": 0.01,
        "receptors": "rgb",
        "full_aperture": None,
        "eccentricity_deg": (0.0, 0.0),
        "microvilli": None,
        "photon_budget": None,
        "pupil_turned": False,
    },
    "Microvilli": {"azimuth_deg": 0.0, "dichroic_ratio": 10.0},
    "ReceptorDynamics": {
        "time_constant_ms": 10.0,
        "order": 1,
        "latency_ms": 0.0,
        "adaptation": "none",
        "adaptation_ms": 1e3,
        "dark_light": 1e-3,
        "event_threshold": None,
        "motion": "none",
        "motion_ms": 35.0,
        "frames": None,
    },
    "TurbidMedium": {
        "attenuation": optics.Spectrum((500,), (0.1,)),
        "veil": optics.Spectrum((500,), (0.5,)),
        "refractive_index": None,
    },
    "fog": {"visibility": 20.0},
    "immersed": {"eye": optics.Eye(LENS), "medium": optics.fog(20.0)},
    "sea_water": {"chlorophyll": 1.0},
    "turbid_medium": {"name": "fog"},
    "Waveguide": {
        "diameter": 2e-6,
        "n_core": 1.363,
        "n_clad": 1.34,
        "length": 1e-4,
        "absorption": 6e3,
        "proximal_diameter": None,
    },
    "anatomical_acuity": {"density": 1e11, "nodal_distance": 0.017, "lattice": "hexagon"},
    "eye_parameter": {"diameter": 2e-5, "interommatidial_deg": 2.0},
    "hexagonal_directions": {"rings": 1, "interommatidial_deg": 2.0},
    "ideal_contrast_sensitivity": {
        "cycles_per_degree": [1.0, 2.0],
        "contrast": [0.9, 0.8],
        "photons": 1e6,
        "area": 1.0,
        "d_prime": 1.0,
    },
    "least_eye_parameter": {"wavelength": 500e-9, "lattice": "hexagon"},
    "sampling_acuity": {"spacing_deg": 1.0, "lattice": "hexagon"},
    "mean_human_mtf": {"cycles_per_degree": [1.0, 2.0], "pupil_diameter": 3e-3},
    "snyder_acceptance": {"diameter": 2e-5, "focal_length": 5e-5, "rhabdom": 2e-6, "wavelength": 500e-9},
}
PICTURES = {
    "plan": dict(pupil=LENS, wavelength=550e-9, **PICTURE, **SOURCE),
    "psf": dict(pupil=LENS, wavelengths=[550e-9], field=False, **PICTURE, **SOURCE),
    "psf_batch": dict(pupils=[LENS], wavelengths=[550e-9], source_distances=[math.inf], **PICTURE),
    "through_focus": {
        "pupil": LENS,
        "sensor_distances": [240e-6],
        "wavelengths": [550e-9],
        "dx": 5e-7,
        "shape": (9, 9),
    },
    "vector_focus": {
        "pupil": WIDE,
        "wavelength": 550e-9,
        "sensor_distance": 240e-6,
        "polarization": None,
        "source_angle": (0.0, 0.0),
        "apodization": "flat",
        "dx": 0.3e-6,
        "shape": (5, 5),
        "tolerance": 0.1,
    },
}
SPOT = optics.psf(LENS, sensor_distance=240e-6, dx=0.5e-6, shape=(33, 33))
MEASURES = {
    "encircled_energy": {"result": SPOT, "radii": 1e-6, "centre": None},
    "image_quality": {"result": SPOT, "nyquist": 1e5, "throughput": 1.0, "noise_sigma": 0.01, "tolerance": 0.02},
    "mtf": {"result": SPOT, "arriving": None, "tolerance": 0.02},
    "strehl_ratio": {"result": SPOT},
}
BEHIND_SYSTEMS = {
    "wavelength": 550e-9,
    "source": optics.PointSource(),
    "out_dx": 1e-6,
    "out_shape": (9, 9),
    "tolerance": 1e-2,
    "dtype": "float32",
}
FIELDS = {
    "propagate": {
        "u": np.ones((8, 8)),
        "dx": 1e-6,
        "wavelength": 550e-9,
        "distance": 1e-4,
        "out_dx": 1e-6,
        "out_shape": (8, 8),
        "out_centre": (0.0, 0.0),
        "medium_n": 1.0,
        "tolerance": 1e-2,
        "method": "auto",
        "dtype": "float32",
    },
    "propagate_through": {"elements": [LENS, optics.FreeSpace(1e-3)], "u": None, **BEHIND_SYSTEMS},
    "propagate_through_batch": {"systems": [[LENS, optics.FreeSpace(1e-3)]], **BEHIND_SYSTEMS},
}
CALLS = SHAPES | ELEMENTS | SPECTRA | EYES | PICTURES | MEASURES | FIELDS


@pytest.mark.fast_cases(8)
@pytest.mark.parametrize("name", [slow(name) if name in ("propagate", "vector_focus") else name for name in CALLS])
def test_any_argument(name):
    assert complaints(getattr(optics, name), CALLS[name]) == {}


@pytest.mark.parametrize("name", CALLS)
def test_masked_elements_are_refused(name):
    """NumPy would use the numbers under the mask as data."""
    assert masked_complaints(getattr(optics, name), CALLS[name], np.random.default_rng(len(name))) == {}


def test_nothing_of_the_face_is_forgotten():
    """Omitted names are results of optics itself, or take the same arguments as names that are tested here."""
    made = {
        "AcceptanceFunction",
        "AccuracyError",
        "BackendError",
        "MTF",
        "Mode",
        "PSFBatch",
        "PSFResult",
        "Plan",
        "PropagationResult",
    }
    made |= {
        "BandMedium",
        "ExitPupil",
        "ExitPupils",
        "LensMTF",
        "SpectralBands",
        "StackResult",
        "VectorFocus",
        "WhitePSF",
        "ThroughFocus",
        "Relief",
        "Circle",
        "Combined",
    }
    like_others = {
        "difference",
        "intersection",
        "union",
        "Grid",
        "Ommatidium",
        "white_psf",
        "lens_mtf",
        "read_exit_pupil",
        "read_exit_pupils",
        "require",
        "srgb_basis",  # has no argument
    }
    assert CALLS.keys() | made | like_others == set(optics.__all__)
