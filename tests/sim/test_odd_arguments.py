"""Arguments of the wrong type or value in `sim`: a result, or a one-line error of our own. See the test of the same
name in optics.
"""

import numpy as np
import pytest

import optics
import sim
from tests.odd_arguments import complaints, masked_complaints

MOUNT = sim.Mount("head", 30.0)
VIEW = {"name": "left", "wavelengths_nm": np.array([450.0]), "radiance": np.ones((1, 2, 2), np.float32)}
CALLS = {
    "Eyes": {
        "n_eyes": 2,
        "resolution": (3, 3),
        "fov_deg": 45.0,
        "placement_range_deg": 60.0,
        "optics": None,
        "sensor_width": 200e-6,
        "noise_sigma": 0.01,
        "bands": 4,
        "receptors": "rgb",
        "photon_budget": None,
        "waveguide": None,
        "pupil_turned": False,
        "ommatidium": None,
        "acute_zone": 1.0,
    },
    "Fidelity": {"rays_per_receptor": 8.0, "bands": 4, "tolerance": None, "light": "direct", "samples": "rays"},
    "Mount": {
        "on": "head",
        "azimuth_deg": 0.0,
        "elevation_deg": 0.0,
        "roll_deg": 0.0,
        "offset": (0.0, 0.0, 0.0),
        "kind": None,
    },
    "CompoundEye": {
        "directions": [[0.0, 0.0], [20.0, 0.0]],
        "ommatidium": optics.Ommatidium(optics.FacetLens(25e-6, 30e-6), optics.Waveguide(2e-6)),
        "receptors": "rgb",
        "types": None,
        "bands": 4,
        "noise_sigma": 0.01,
        "photon_budget": None,
        "radius": None,
        "rows": None,
    },
    "hexagonal_rows": {"rows": 2, "columns": 3, "fov_deg": 60.0, "acute_zone": 1.0},
    "hexagonal_patch": {"rings": 1, "interommatidial_deg": 5.0, "azimuth_deg": 0.0, "elevation_deg": 0.0},
    "whole_head": {"interommatidial_deg": 30.0},
    "View": VIEW | {"receptors": None, "rgb": None},
    "both_sides": {"mounts": [MOUNT]},
    "build_world": {"task": "navigation", "seed": 0, "mazes": 1, "course": "short", "eyes": None, "spectra": None},
    "fan": {"mount": MOUNT, "n_eyes": 2, "placement_range_deg": 40.0, "elevation_deg": 0.0},
    "ring": {"on": "head", "n_eyes": 2, "placement_range_deg": 40.0, "radius": 0.1},
}


@pytest.mark.parametrize("name", CALLS)
def test_any_argument(name):
    assert complaints(getattr(sim, name), CALLS[name]) == {}


@pytest.mark.parametrize("name", CALLS)
def test_masked_elements_are_refused(name):
    """NumPy would use the numbers under the mask as data."""
    assert masked_complaints(getattr(sim, name), CALLS[name], np.random.default_rng(len(name))) == {}


def test_views_to_write(tmp_path):
    assert complaints(lambda views: sim.write_exr(tmp_path / "a.exr", views), {"views": [sim.View(**VIEW)]}) == {}


def test_environments():
    """These arguments are refused before any environment is built."""
    valid = {"mode": "training", "least_return": -50.0, "auxiliary": (), "spectra": None, "mazes": 1, "n_envs": 1}
    fixed = {"task": "detection", "eyes": sim.Eyes(1, (1, 1)), "rays_per_receptor": 1.0}
    assert complaints(lambda **asked: sim.make_vec_env(**fixed, **asked).close(), valid) == {}
