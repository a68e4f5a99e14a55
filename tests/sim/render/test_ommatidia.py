"""Rendered signals of compound eyes, compared with the same eye made of mounts and with integrals of radiance."""

import dataclasses

import mujoco
import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

import optics
import sim
from optics.spectra.spectrum import daylight
from sim.render.receptor_noise import NoiseModel

OMMATIDIUM = optics.Ommatidium(optics.FacetLens(16e-6, 12e-6), optics.Waveguide(1.9e-6))
WORLD = """
<mujoco><visual><headlight active="0"/></visual>
  <asset>
    <texture name="t" type="2d" builtin="checker" width="32" height="32" rgb1=".9 .3 .1" rgb2=".1 .3 .8"/>
    <material name="t" texture="t" texrepeat="2 2" texuniform="true"/>
  </asset>
  <worldbody>
    <light type="directional" dir=".6 .3 -1" diffuse=".9 .9 .9"/>
    <geom type="plane" size="4 4 .1" material="t"/>
    <geom type="sphere" size=".1" pos="-.93 .377 .679" rgba="1 1 1 1"/>
    <geom type="box" size=".4 .3 .5" pos="1 .4 .5" rgba=".8 .7 .2 1"/>
    <body name="head" pos="-1 0 1"><freejoint/><geom size=".1" group="4"/></body>
    <body pos="1 -.5 .8"><joint axis="0 0 1"/><geom type="ellipsoid" size=".2 .3 .25" rgba=".7 .2 .6 1"/></body>
  </worldbody>
</mujoco>"""
HEAD = (sim.Mount("head", azimuth_deg=5.0, roll_deg=20.0),)
DEGREES = np.array([[0.0, -20.0], [12.0, -8.0], [-15.0, -5.0], [80.0, -40.0]])


@pytest.fixture(scope="module")
def world():
    model = mujoco.MjModel.from_xml_string(WORLD)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def signals(world, eye, mounts=HEAD, rays=2048):
    model, data = world
    return sim.ModelRenderer(model, eye, mounts, 1, sim.Fidelity(rays, eye.bands)).signals(data)[0]


def of_mounts(world, ommatidium, degrees):
    """Return the signals (channel, mount), relative to white, of mounts in these directions, each with one receptor."""
    guide, lens = ommatidium.rhabdom, ommatidium.pupil
    focal = ommatidium.rhabdom_distance * lens.index_before(550e-9) / lens.index_behind(550e-9)
    eye = optics.Eye(
        lens,
        (1, 1),
        fov_deg=float(np.degrees(2 * np.arctan(guide.diameter / 2 / focal))),
        sensor_width=guide.diameter,
        waveguide=guide,
        full_aperture=2 * lens.radius,
    )
    bands, accepted = eye.spectral_bands, np.asarray(eye.kernel(1)).sum(axis=(1, 2))
    white = eye.aperture_throughput * (bands.weights * daylight(bands.wavelengths)) @ accepted
    mounts = [sim.Mount("head", azimuth, elevation) for azimuth, elevation in degrees]
    return signals(world, eye, mounts)[:, :, 0, 0].T / white[:, None]


def comatic():
    """An ommatidium with coma, whose field is asymmetric along both axes."""
    side = np.linspace(-1, 1, 41)
    x, y = side, side[:, None]
    coma = 0.4e-6 * (3 * (x**2 + y**2) - 2) * (x + 0.5 * y)
    lens = optics.Pupil(
        8e-6, thin_lens_focal_length=36e-6, medium_n=1.34, object_n=1.0, wavefront=optics.WavefrontMap(coma)
    )
    return optics.Ommatidium(lens, optics.Waveguide(1.9e-6))


@pytest.mark.parametrize(
    "make", [pytest.param(lambda: OMMATIDIUM, marks=pytest.mark.slow), comatic], ids=["facet", "coma"]
)
def test_signals_equal_those_of_the_same_eye_made_of_mounts(world, make):
    """Also without symmetry: with a coma reversed along x or y, signals differ by more than ten times the tolerance."""
    ommatidium = make()
    found = signals(world, sim.CompoundEye(DEGREES, ommatidium), (sim.Mount("head"),))[0, :, 0]
    expected = of_mounts(world, ommatidium, DEGREES)
    assert np.all(expected.max(axis=0) > 0.05)
    assert found == pytest.approx(expected, rel=0.01, abs=4e-3)


def test_signals_are_integrals_of_radiance_times_acceptance(world):
    """The radiance is that of a pinhole eye with 161 x 161 receptors, one ray each, around each ommatidium's axis."""
    eye = sim.CompoundEye(DEGREES, OMMATIDIUM)
    found = signals(world, eye, (sim.Mount("head"),))[0, :, 0]
    table, bands = eye.acceptance(0), eye.spectral_bands
    side, half = 161, 0.28
    pinhole = optics.Eye(resolution=(side, side), fov_deg=float(np.degrees(2 * np.arctan(half))), noise_sigma=0.0)
    model, data = world
    mounts = [sim.Mount("head", *degrees) for degrees in DEGREES.tolist()]
    renderer = sim.ModelRenderer(model, pinhole, mounts, 1, sim.Fidelity(1, 4))
    radiance = renderer.receptor_radiance(data)[:, 0]
    right = (np.arange(side) + 0.5) / side * 2 * half - half
    up = -right[:, None]
    cosine = 1 / np.sqrt(1 + right**2 + up**2)
    accepted = RegularGridInterpolator(
        (table.sines, table.sines), np.moveaxis(table.values, 0, -1), bounds_error=False, fill_value=0.0
    )
    weights = accepted(np.stack([up * cosine, -right * cosine], axis=-1)) * (cosine**3)[..., None]
    light = np.einsum("benm,nmb->be", radiance, weights)
    white = daylight(bands.wavelengths) * weights.sum(axis=(0, 1))
    assert found == pytest.approx((bands.weights @ light) / (bands.weights @ white)[:, None], abs=3e-3)


def test_white_light_gives_one_and_ommatidia_differ_in_their_fields():
    """Two different ommatidia in a white box with light from all lamps see the same white."""
    model = mujoco.MjModel.from_xml_string("""
      <mujoco><visual><headlight active="0"/></visual><worldbody>
        <light type="directional" dir="0 0 -1" diffuse="1 1 1"/>
        <geom type="plane" size="400 400 .1" rgba="1 1 1 1"/><body name="head" pos="0 0 1"/>
      </worldbody></mujoco>""")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    wide = optics.Ommatidium(optics.FacetLens(12e-6, 9e-6), optics.Waveguide(3e-6))
    eye = sim.CompoundEye([[0.0, -89.0], [10.0, -60.0]], [OMMATIDIUM, wide])
    renderer = sim.ModelRenderer(model, eye, (sim.Mount("head"),), 1, sim.Fidelity(64, 4))
    found = renderer.signals(data)[0, 0, :, 0]
    assert found == pytest.approx(renderer.brightest, rel=1e-3)
    # Each of the three types sees white: its catch of the lamp's light, which is daylight.
    assert found == pytest.approx(1.0, rel=2e-3)


def test_a_mosaic_picks_each_ommatidiums_types(world):
    eye = sim.CompoundEye(DEGREES, OMMATIDIUM)
    every = signals(world, eye, rays=8)[0, :, 0]
    types = np.array([[0, 2], [1, 1], [2, 0], [2, 1]])
    found = signals(world, dataclasses.replace(eye, types=types), rays=8)[0, :, 0]
    assert found == pytest.approx(np.take_along_axis(every, types.T, axis=0), rel=1e-6)


def test_more_than_four_bands_have_their_own_weights(world):
    eye = sim.CompoundEye(DEGREES, OMMATIDIUM, bands=6)
    model, data = world
    renderer = sim.ModelRenderer(model, eye, HEAD, 1, sim.Fidelity(8, 6))
    light = renderer.radiance(data)[0, 0].reshape(4, 8, 6)
    weights = renderer.sensor.facets.weights.reshape(4, 8, 6)
    due = (light * weights).sum(axis=1) / weights.sum(axis=1)
    assert renderer.receptor_radiance(data)[:, 0, 0, 0] == pytest.approx(due.T, rel=1e-4)


def test_rays_start_at_the_facets(world):
    """An eye with a radius of 90 cm sees the same as single ommatidia that are mounted 90 cm from the centre.

    A white sphere at 50 cm is behind the last ommatidium, and in front of the centre.
    """
    eye = sim.CompoundEye(DEGREES, OMMATIDIUM, radius=0.9)
    found = signals(world, eye, (sim.Mount("head"),), rays=256)[0, :, 0]
    for number, ((azimuth, elevation), way) in enumerate(zip(DEGREES.tolist(), eye.directions, strict=True)):
        mount = sim.Mount("head", azimuth, elevation, offset=tuple(0.9 * way))
        alone = signals(world, sim.CompoundEye([[1.0, 0, 0]], OMMATIDIUM), (mount,), rays=256)[0, :, 0, 0]
        assert found[:, number] == pytest.approx(alone, abs=6e-3)
    central = signals(world, dataclasses.replace(eye, radius=None), (sim.Mount("head"),), rays=256)[0, :, 0]
    assert np.abs(found - central).max() > 0.1


def test_shot_noise_is_that_of_each_facets_photons():
    """The variance of a signal s is s / N, with N the photons for white of this facet: a Poisson distribution."""
    narrow, wide = (optics.Ommatidium(optics.FacetLens(d, 24e-6), optics.Waveguide(4e-6)) for d in (12e-6, 24e-6))
    eye = sim.CompoundEye(
        [[0.0, 0], [30, 0]], [narrow, wide], (520,), bands=1, photon_budget=optics.PhotonBudget(10.0), noise_sigma=0.0
    )
    noise = NoiseModel.from_eye(eye)
    normals = np.random.default_rng(0).standard_normal((40_000, 1, 1, 1, 2)).astype(np.float32)
    level = np.full_like(normals, 0.25)
    variance = noise(level, normals)[:, 0, 0, 0].var(axis=0)
    assert variance == pytest.approx(0.25 / eye.photons[0], rel=0.05)
    assert variance[0] > 2.5 * variance[1]


def test_automatic_fidelity_uses_ommatidias_own_rays(world):
    model, data = world
    eye = sim.CompoundEye(DEGREES, OMMATIDIUM)
    fidelity = sim.choose_model_fidelity(model, eye, HEAD, data)
    assert fidelity.samples == "rays"
    assert fidelity.predicted_error <= 0.5 * eye.noise_sigma
    truth = signals(world, eye, rays=4096)
    found = signals(world, eye, rays=fidelity.rays_per_receptor)
    assert np.sqrt(np.square(found - truth).mean()) < 0.01


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"tracer": "closed_form"}, "tracer = 'closed_form': must be 'mitsuba' for a compound eye"),
        ({"fidelity": sim.Fidelity(4, 4, samples="areas")}, "samples = 'areas': must be 'rays' for a compound eye"),
        ({"fidelity": sim.Fidelity(4, 4, samples="edges")}, "samples = 'edges': must be 'rays' for a compound eye"),
        ({"eye": 3}, "eye = 3: must be a kind of Eye, such as .* or a sim.CompoundEye"),
        ({"n_envs": 2**28, "fidelity": sim.Fidelity(64, 4)}, "4 receptors would take .* GiB of memory"),
    ],
)
def test_what_a_compound_eye_cannot_do_is_refused(world, options, message):
    how = {"model": world[0], "eye": sim.CompoundEye(DEGREES, OMMATIDIUM), "mounts": HEAD, **options}
    with pytest.raises(ValueError, match=message):
        sim.ModelRenderer(**how)


def test_depth_and_flow_have_no_meaning_without_a_flat_retina(world):
    renderer = sim.ModelRenderer(world[0], sim.CompoundEye(DEGREES, OMMATIDIUM), HEAD)
    with pytest.raises(ValueError, match="depth, ids and flow: are defined on a flat retina"):
        renderer.depth(world[1])
