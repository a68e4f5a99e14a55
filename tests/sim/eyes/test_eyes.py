"""Positions and directions of eyes."""

import dataclasses
import math
from functools import cache

import mujoco
import numpy as np
import pytest

import sim
from optics import (
    FacetLens,
    Fovea,
    MaskMap,
    Ommatidium,
    PhotonBudget,
    Pupil,
    ReceptorDynamics,
    Receptors,
    Waveguide,
    Zernike,
)
from sim.eyes.eyes import BODY_RADIUS, camera_rotations, eye_positions, eye_rotations

FACET = Ommatidium(FacetLens(20e-6, 18e-6), Waveguide(2e-6))


def test_eyes_spread_evenly_from_left_to_right():
    three = sim.Eyes(n_eyes=3, placement_range_deg=90)
    np.testing.assert_allclose(np.degrees(three.azimuths()), [45, 0, -45], atol=1e-12)
    assert np.array_equal(sim.Eyes(n_eyes=1, placement_range_deg=90).azimuths(), [0.0])
    assert three.names() == ("left", "center", "right")


def test_eyes_look_outwards_with_the_left_on_the_left():
    azimuths = np.radians([90.0, 0.0])  # to the left, and ahead (x ahead, y left, z up)
    right, up, axis = np.moveaxis(eye_rotations(azimuths), -1, 0)
    np.testing.assert_allclose(axis, [[0, 1, 0], [1, 0, 0]], atol=1e-15)
    np.testing.assert_allclose(right, [[1, 0, 0], [0, -1, 0]], atol=1e-15)
    np.testing.assert_allclose(up, [[0, 0, 1], [0, 0, 1]], atol=1e-15)
    np.testing.assert_allclose(eye_positions(azimuths), BODY_RADIUS * axis, atol=1e-15)
    np.testing.assert_allclose(np.linalg.det(camera_rotations(azimuths)), 1.0)


@pytest.mark.parametrize(("n_eyes", "first"), [(1, "center"), (2, "left"), (3, "left"), (4, "eye_0")])
def test_cameras_of_a_world_are_the_eyes(n_eyes, first):
    eyes = sim.Eyes(n_eyes=n_eyes, placement_range_deg=200, resolution=(3, 5), fov_deg=60)
    model = sim.build_world("detection", eyes=eyes).model
    data = mujoco.MjData(model)
    heading = 0.7
    data.qpos[2] = heading
    mujoco.mj_forward(model, data)
    assert (eyes.names()[0], model.ncam) == (first, n_eyes)
    for name, azimuth in zip(eyes.names(), eyes.azimuths(), strict=True):
        camera = model.camera(name).id
        outwards = [math.cos(azimuth + heading), math.sin(azimuth + heading), 0]
        np.testing.assert_allclose(-data.cam_xmat[camera].reshape(3, 3)[:, 2], outwards, atol=1e-12)
        np.testing.assert_allclose(
            data.cam_xpos[camera], data.xpos[model.body("agent").id] + BODY_RADIUS * np.array(outwards), atol=1e-12
        )
        # Receptors are square: the field is 60° across 5 of them, and 3 of the same pitch high.
        assert math.tan(math.radians(model.cam_fovy[camera]) / 2) == pytest.approx(math.tan(math.radians(30)) * 3 / 5)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("n_eyes", 0),
        ("resolution", (0, 3)),
        ("fov_deg", 180.0),
        ("fov_deg", math.nan),
        ("placement_range_deg", 361.0),
        ("placement_range_deg", -1e-9),
        ("sensor_width", 0.0),
        ("noise_sigma", -1.0),
        ("bands", 0),
        ("n_eyes", 2.5),
        ("n_eyes", "two"),
        ("n_eyes", math.inf),
        ("resolution", 15),
        ("resolution", (15,)),
        ("fov_deg", 0),
        ("fov_deg", "wide"),
        ("noise_sigma", None),
        ("acute_zone", 0.9),
        ("acute_zone", 2.0),
    ],
)
def test_values_out_of_range_are_named(name, value):
    with pytest.raises(ValueError, match=f"Eyes: {name} = "):
        sim.Eyes(**{name: value})


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("optics", Pupil(50e-6)),
        ("vertical_fov_deg", 30.0),
        ("dynamics", ReceptorDynamics(adaptation="naka_rushton")),
        ("density", Fovea(5.0)),
    ],
)
def test_compound_eyes_have_no_parts_of_camera_eyes(name, value):
    with pytest.raises(ValueError, match=f"Eyes: {name} = .*must be None for compound eyes"):
        sim.Eyes(ommatidium=FACET, **{name: value})


# Every field, a changed value, and the shape of the signals after the change.
OF_KIND = {"lens": ("sensor_width", "waveguide", "pupil_turned"), "facets": ("acute_zone",)}
CHANGES = {
    "n_eyes": (3, (3, 3, 4, 5)),
    "resolution": ((5, 4), (2, 3, 5, 4)),
    "fov_deg": (70.0, (2, 3, 4, 5)),
    "placement_range_deg": (90.0, (2, 3, 4, 5)),
    "optics": (Pupil(60e-6, thin_lens_focal_length=240e-6), (2, 3, 4, 5)),
    "sensor_width": (150e-6, (2, 3, 4, 5)),
    "noise_sigma": (0.02, (2, 3, 4, 5)),
    "bands": (5, (2, 3, 4, 5)),
    "receptors": ("lms", (2, 3, 4, 5)),
    "photon_budget": (PhotonBudget(illuminance=10.0), (2, 3, 4, 5)),
    "waveguide": (Waveguide(10e-6, 1.35), (2, 3, 4, 5)),
    "pupil_turned": (True, (2, 3, 4, 5)),
    "vertical_fov_deg": (60.0, (2, 3, 4, 5)),
    "density": (Fovea(5.0), (2, 3, 4, 5)),
    "dynamics": (ReceptorDynamics(adaptation="naka_rushton"), (2, 3, 4, 5)),
    "ommatidium": (FACET, (2, 3, 4, 5)),
    "acute_zone": (2.0, (2, 3, 4, 5)),
}


@pytest.mark.parametrize("field", [f.name for f in dataclasses.fields(sim.Eyes)])
def test_every_field_moves_what_is_seen(field):
    """Every field of `sim.Eyes` changes the signals; a field without an entry in `CHANGES` fails. (The sensor's width
    matters behind a lens of fixed focal length.)
    """
    value, shape = CHANGES[field]
    kind = next((kind for kind, fields in OF_KIND.items() if field in fields), "perfect")
    before = _settled(kind)
    after = _seen(sim.Eyes(**{**_given(kind), field: value}))
    assert after.shape == shape
    assert not np.array_equal(before, after)


def _given(kind):
    coma = Zernike({(3, -1): 0.2})
    lens = {"optics": Pupil(50e-6, thin_lens_focal_length=240e-6, wavefront=coma)}
    return {"resolution": (4, 5), **{"lens": lens, "facets": {"ommatidium": FACET}, "perfect": {}}[kind]}


@cache
def _settled(kind):
    """Return the signals before the change, after checking that they are reproducible."""
    first, again = (_seen(sim.Eyes(**_given(kind))) for _ in range(2))
    assert np.array_equal(first, again)
    first.flags.writeable = False
    return first


def _seen(eyes):
    worlds = sim.make_vec_env("foraging", eyes, 1, 7, rays_per_receptor=4)
    try:
        return worlds.reset()["eyes"][0, 0]
    finally:
        worlds.close()


def test_mosaics_and_pigments_change_the_number_of_channels():
    kinds = Receptors((350, 440, 530, 600))
    assert _seen(sim.Eyes(resolution=(4, 5), receptors=kinds)).shape == (2, 4, 4, 5)
    assert _seen(sim.Eyes(resolution=(4, 5), receptors=kinds.arranged(((0, 1), (2, 3))))).shape == (2, 1, 4, 5)
    assert _seen(sim.Eyes(resolution=(4, 5), receptors=(350,))).shape == (2, 1, 4, 5)


def test_unknown_receptors_come_with_the_nearest_name():
    with pytest.raises(ValueError, match=r"receptors = 'hunnybee': must be one of .*; did you mean 'honeybee'\?"):
        sim.Eyes(receptors="hunnybee")
    with pytest.raises(ValueError, match="no type is given; an eye needs at least one"):
        sim.Eyes(receptors=())


@pytest.mark.parametrize("placement", [0.0, 0.5, 360.0])
def test_placement_may_be_none_at_all_and_the_whole_way_round(placement):
    assert sim.Eyes(placement_range_deg=placement).placement_range_deg == placement


def test_a_mask_darkens_signals_once():
    """Half the amplitude everywhere is a quarter of the light."""
    seen = []
    for mask in (None, MaskMap(np.full((4, 4), 0.5), reach=60e-6)):
        pupil = Pupil(50e-6, thin_lens_focal_length=240e-6, mask=mask)
        eyes = sim.Eyes(1, (3, 3), optics=pupil, noise_sigma=1e-6)
        venv = sim.make_vec_env("detection", eyes=eyes, n_envs=2, seed=0, rays_per_receptor=16.0)
        seen.append(venv.reset()["eyes"].mean())
        venv.close()
    assert seen[1] == pytest.approx(seen[0] / 4, rel=1e-2)
