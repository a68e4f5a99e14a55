"""Signals of eyes on any model, against Mitsuba's `direct` integrator with many samples in a mirror of the same
model.
"""

import gc

import mujoco
import numpy as np
import pytest

import optics
import sim
from sim.tracing import model_tracer, movers

BANDS = 3
SIZE = (40, 56)
MODEL = """
<mujoco>
  <visual><headlight active="0"/></visual>
  <asset>
    <texture name="t" type="2d" builtin="checker" width="32" height="32" rgb1=".9 .3 .1" rgb2=".1 .3 .8"/>
    <material name="t" texture="t" texrepeat="4 4"/>
    <mesh name="wedge" vertex="-.3 -.3 -.2  .4 -.3 -.2  0 .4 -.2  0 0 .4"/>
  </asset>
  <worldbody>
    <light type="directional" dir="-.3 .5 -1" diffuse=".6 .6 .6"/>
    <light type="point" pos="1 -1 3" diffuse=".4 .4 .4" attenuation="0 0 1"/>
    <geom type="plane" size="4 4 .1" material="t"/>
    <geom type="box" size=".4 .3 .5" pos="-1 .4 .5" rgba=".8 .7 .2 1"/>
    <body name="arm" pos=".3 0 .8"><joint name="turn" axis="0 0 1"/>
      <light type="spot" pos="0 -.9 1.5" dir=".2 .5 -1" cutoff="30" exponent="4" diffuse=".9 .5 .5"
             attenuation="0 0 1"/>
      <geom type="capsule" fromto="0 0 0 .8 0 .2" size=".12" rgba=".2 .7 .3 1"/>
      <geom type="ellipsoid" size=".2 .3 .25" pos=".9 0 .3" rgba=".7 .2 .6 1"/>
      <geom type="cylinder" size=".2 .1" pos="-.5 .3 .3" euler="30 20 0" rgba=".7 .6 .6 1"/>
      <geom type="box" size=".2 .1 .15" pos="-.5 -.6 .5" euler="30 20 50" rgba=".3 .6 .9 1"/>
      <geom type="sphere" size=".15" pos="0 -.6 .2" rgba=".9 .9 .9 1"/>
      <geom type="box" size=".1 .1 .1" pos="0 .6 .2" euler="10 40 0" material="t"/>
      <geom type="mesh" mesh="wedge" pos=".5 -.7 0" rgba=".4 .9 .4 1"/>
    </body>
    <camera name="side" pos="0 -4 2.5" xyaxes="1 0 0 0 .5 1" fovy="45"/>
  </worldbody>
</mujoco>
"""
FOV = 2 * np.degrees(np.arctan(np.tan(np.radians(22.5)) * SIZE[1] / SIZE[0]))
EYE = optics.Eye(resolution=SIZE, fov_deg=FOV, bands=BANDS)
ANGLES = (0.0, 1.5, 3.0)


def posed(model, angle):
    data = mujoco.MjData(model)
    data.qpos[0] = angle
    mujoco.mj_forward(model, data)
    return data


@pytest.fixture(scope="module")
def model():
    return mujoco.MjModel.from_xml_string(MODEL)


@pytest.fixture(scope="module")
def truth(model):
    """Return Mitsuba's signals (pose, channel, y, x)."""
    mirror, bands, found = sim.mirror(model), EYE.spectral_bands, []
    for angle in ANGLES:
        mirror.sync(posed(model, angle))
        light = mirror.render("side", SIZE[1], SIZE[0], spp=256, wavelengths=bands.wavelengths, sampler="multijitter")
        found.append(np.einsum("cb,byx->cyx", bands.weights, light))
    return np.array(found)


SIDE = sim.Mount("side")


def signals(model, rays=64, mounts=(SIDE,)):
    renderer = sim.ModelRenderer(model, EYE, mounts, len(ANGLES), sim.Fidelity(rays, bands=BANDS))
    return renderer.signals([posed(model, angle) for angle in ANGLES])


def differ(found, truth):
    """Return the root-mean-square difference and the difference of the means, in units of white's signal."""
    return np.sqrt(np.mean((found - truth) ** 2)), np.abs((found - truth).mean(axis=(2, 3))).max()


# 64 jittered rays in a pixel at an edge of contrast 1 have an error of about 0.03, and a sixth of the pixels is at
# edges. NOISE is three times the measured error. In the mean of an image this error vanishes.
NOISE, BIAS = 0.012, 6e-4


def test_all_kinds_of_things_look_as_in_the_mirror(model, truth):
    rms, bias = differ(signals(model)[:, 0], truth)
    assert rms < NOISE
    assert bias < BIAS


def no_shadows(monkeypatch):
    monkeypatch.setattr(model_tracer.ModelTracer, "_shadowed", lambda self, *args: False)


def no_shadows_of_movers(monkeypatch):
    monkeypatch.setattr(movers.Movers, "block", lambda self, *args: False)


def normals_of_another_frame(monkeypatch):
    monkeypatch.setattr(movers._Frame, "to_world", lambda self, v: v)


@pytest.mark.parametrize("mutant", [no_shadows, no_shadows_of_movers, normals_of_another_frame])
def test_wrong_methods_are_noticed(model, truth, mutant, monkeypatch):
    mutant(monkeypatch)
    assert differ(signals(model)[:, 0], truth)[1] > 2 * BIAS


def test_lights_move_with_bodies(model, truth):
    """Each pose has its own light, which the light of another pose cannot replace."""
    assert differ(truth[[1, 2, 0]], truth)[0] > 3 * NOISE


def test_worlds_and_eyes_do_not_mix(model):
    """Each world and each eye has the same signals alone as among others."""
    mounts = [sim.Mount("side"), sim.Mount("arm", azimuth_deg=-90, offset=(0.2, -0.9, 0.4))]
    together = signals(model, 4, mounts)
    for e, mount in enumerate(mounts):
        np.testing.assert_array_equal(signals(model, 4, [mount])[:, 0], together[:, e])
    # kernels depend on the shapes of all scenes: if scenes of other tests are freed meanwhile, kernels are recorded
    # again
    gc.collect()
    renderer = sim.ModelRenderer(model, EYE, mounts, 1, sim.Fidelity(4, bands=BANDS))
    for world, angle in enumerate(ANGLES):
        np.testing.assert_array_equal(renderer.signals([posed(model, angle)])[0], together[world])
    # with several scenes in one kernel, Dr.Jit 1.5 records the second or third call again
    assert renderer.recordings <= 3


def test_the_sky_is_seen_where_nothing_is():
    model = mujoco.MjModel.from_xml_string("""<mujoco><visual><headlight ambient="0 0 0"/></visual>
        <asset><texture name="s" type="skybox" builtin="gradient" rgb1=".2 .5 .9" rgb2="1 1 1" width="64" height="64"/>
        </asset><worldbody><camera name="side" pos="0 -4 2.5" xyaxes="1 0 0 0 .5 1" fovy="45"/>
        <body><joint/><geom size=".4"/></body></worldbody></mujoco>""")
    with pytest.warns(sim.MirrorWarning, match="light of the sky on surfaces"):
        renderer = sim.ModelRenderer(model, EYE, [sim.Mount("side")], 1, sim.Fidelity(16, bands=BANDS))
    data = posed(model, 0)
    found = renderer.signals([data])[0, 0]
    bands = EYE.spectral_bands
    with pytest.warns(sim.MirrorWarning):
        mirror = sim.mirror(model)
    light = mirror.render("side", SIZE[1], SIZE[0], spp=16, wavelengths=bands.wavelengths)
    empty = np.isinf(renderer.depth([data])[0, 0])
    assert 0.5 < empty.mean() < 1
    error = (found - np.einsum("cb,byx->cyx", bands.weights, light))[:, empty]
    assert np.median(np.abs(error)) < 5e-3


def test_eyes_behind_a_pupil_see_it_too(model):
    """A defocused pupil with many rays: the mean over the image equals the perfect lens's times the throughput, and
    edges are softer.
    """
    pupil = optics.Pupil(aperture_radius=60e-6, thin_lens_focal_length=180e-6)
    blurred = optics.Eye(pupil, resolution=(15, 15), fov_deg=45, bands=BANDS)
    sharp = optics.Eye(resolution=(15, 15), fov_deg=45, bands=BANDS)
    data = posed(model, 0.0)
    found = {
        eye: sim.ModelRenderer(model, eye, [sim.Mount("side")], 1, sim.Fidelity(rays, bands=BANDS)).signals([data])[
            0, 0
        ]
        for eye, rays in ((blurred, 32), (sharp, 64))
    }
    through, without = found[blurred][:, 3:-3, 3:-3] / blurred.throughput, found[sharp][:, 3:-3, 3:-3]
    assert through.mean() == pytest.approx(without.mean(), rel=0.1)
    assert np.abs(np.diff(through)).mean() < 0.8 * np.abs(np.diff(without)).mean()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"n_envs": 0}, "n_envs = 0: must be a whole number"),
        ({"mounts": []}, r"mounts = \[\]: must contain at least one sim.Mount"),
        ({"eye": sim.Eyes()}, "eye = .*: must be a kind of Eye"),
        (
            {"fidelity": sim.Fidelity(4, bands=3, light="all", samples="areas")},
            "samples = 'areas': this world has no closed form: a wall does not stand on the floor",
        ),
        (
            {"eye": optics.Eye(resolution=(3, 3), eccentricity_deg=(0, -10))},
            r"eye: eccentricity_deg = \(0.0, -10.0\): must be \(0, 0\); eyes in a world look along their Mount, turn",
        ),
        ({"fidelity": 16}, "fidelity = 16: must be a kind of Fidelity"),
        ({"groups": (5,)}, "no visible geom"),
        ({"n_envs": 10**8}, "worlds with 1 eyes of 40 x 56 receptors would take .* GiB of memory"),
        ({"spectra": {"nothing": "D65"}}, "no material or light 'nothing'"),
    ],
)
def test_bad_arguments_are_named(model, change, words):
    arguments = {"eye": EYE, "mounts": [sim.Mount("side")], "n_envs": 1, **change}
    with pytest.raises(ValueError, match=words):
        sim.ModelRenderer(model, **arguments)


def test_bad_poses_are_named(model):
    renderer = sim.ModelRenderer(model, EYE, [sim.Mount("side")], 2, sim.Fidelity(1, bands=BANDS))
    with pytest.raises(ValueError, match="poses of 1 worlds, this renderer was built for n_envs = 2"):
        renderer.signals([posed(model, 0)])
    other = mujoco.MjModel.from_xml_string('<mujoco><worldbody><geom size=".1"/></worldbody></mujoco>')
    with pytest.raises(ValueError, match="poses of another model"):
        renderer.signals([mujoco.MjData(other)] * 2)
    lost = posed(model, 0)
    lost.geom_xpos[3] = np.nan
    with pytest.raises(ValueError, match="poses of world 1 are not finite"):
        renderer.signals([posed(model, 0), lost])


def test_an_only_worlds_data_need_not_be_in_a_list(model):
    renderer = sim.ModelRenderer(model, EYE, [sim.Mount("side")], 1, sim.Fidelity(1, bands=BANDS))
    data = posed(model, 0.3)
    for look in (renderer.signals, renderer.depth, renderer.ids, renderer.receptor_radiance):
        np.testing.assert_array_equal(look(data), look([data]))
    np.testing.assert_array_equal(renderer.flow(data, data), renderer.flow([data], [data]))


def test_data_before_mj_forward_is_refused(model):
    """Before mj_forward, all geoms would be at the origin, without size, and dark. The mirror refuses such data too."""
    words = r"contains no poses yet; call mujoco.mj_forward\(model, data\) first"
    renderer = sim.ModelRenderer(model, EYE, [sim.Mount("side")], 2, sim.Fidelity(1, bands=BANDS))
    for look in (renderer.signals, renderer.depth, renderer.ids):
        with pytest.raises(ValueError, match="data of world 1 " + words):
            look([posed(model, 0), mujoco.MjData(model)])
    with pytest.raises(ValueError, match=words):
        sim.mirror(model, mujoco.MjData(model))


def test_what_is_not_matt_is_named():
    model = mujoco.MjModel.from_xml_string("""<mujoco><asset>
        <material name="wet" specular="1" shininess=".9"/><material name="lamp" emission="1"/>
        <material name="mirror" reflectance=".5"/></asset><worldbody><light dir="0 0 -1"/>
        <geom name="floor" type="plane" size="1 1 1" material="mirror"/><geom size=".1" material="wet"/>
        <geom name="pane" size=".1" rgba="1 1 1 .5" pos="0 0 1"/><geom size=".1" material="lamp"/>
        <site name="eye" pos="0 -1 1"/></worldbody></mujoco>""")
    words = (
        "gloss of material 'wet'; light of material 'lamp' on surfaces; reflections in geom 'floor'; "
        "what is behind .* geom 'pane'"
    )
    with pytest.warns(sim.MirrorWarning, match=words):
        sim.ModelRenderer(model, EYE, [sim.Mount("eye")])
