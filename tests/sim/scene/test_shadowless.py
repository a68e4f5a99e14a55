"""Lights that cast no shadow: obstacles outside an image leave it unchanged, on every path to an image or a signal.

Obstacles are black, and outside the convex hull of wall and floor. They therefore send no light into the scene, and the
light that they catch would otherwise be lost.
"""

import mujoco
import numpy as np
import pytest

import optics
import sim
from sim.pictures.quick_camera import QuickCamera

WALL_AND_FLOOR = """<geom type="box" size=".1 4 1" pos="2.1 0 0" rgba=".9 .2 .2 1"/>
    <geom type="plane" size="1 4 .1" pos="1 0 -1" rgba=".8 .8 .8 1"/>"""
LAMPS = {
    "headlight": "",
    "directional": '<light type="directional" dir=".8 .1 -.5" diffuse=".8 .8 .8" castshadow="{}"/>',
    "point": '<light type="point" pos="-1 .3 4" diffuse=".8 .8 .8" castshadow="{}"/>',
    "spot": '<light type="spot" pos="-1 .3 4" dir=".6 0 -.8" cutoff="70" diffuse=".8 .8 .8" castshadow="{}"/>',
}


def plates(rng):
    """Return black boxes behind and above the camera, outside its image: a large one, and one in between."""
    near, far = rng.uniform(0.3, 0.6), rng.uniform(1.2, 2)
    plates = [
        f'size=".01 9 9" pos="-{far} 0 0"',
        f'size="9 9 .01" pos="0 0 {far}"',
        f'size=".01 .2 .2" pos="-{near} 0 0"',
    ]
    return "".join(f'<geom type="box" {plate} rgba="0 0 0 1"/>' for plate in plates)


def model_of(kind, obstacles, castshadow="false"):
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><visual><headlight active="{int(kind == "headlight")}" ambient="0 0 0" diffuse=".8 .8 .8"/></visual>
        <statistic center="1 0 0" extent="3"/><worldbody>{LAMPS[kind].format(castshadow)}{WALL_AND_FLOOR}{obstacles}
        <camera name="ahead" xyaxes="0 -1 0 .1 0 1"/></worldbody></mujoco>"""
    )


def from_mirror(integrator):
    def radiance(model):
        # The same seed gives the same rays, with and without obstacles.
        return sim.mirror(model).render("ahead", 12, 9, integrator, spp=16)

    return radiance


def quick(model):
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return QuickCamera(model).picture(data, "ahead", 24, 18) / 255


def signals(light):
    def seen(model):
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        eye = optics.Eye(resolution=(9, 12), fov_deg=40, bands=3)
        fidelity = sim.Fidelity(16, bands=3, light=light)
        return sim.ModelRenderer(model, eye, [sim.Mount("ahead")], 1, fidelity, tracer="auto").signals([data])

    return seen


PATHS = {
    "direct": from_mirror("direct"),
    "path": from_mirror({"type": "path", "max_depth": 4}),
    "quick": quick,
    "eye": signals("direct"),
    "eye with a bounce": signals("bounce"),
}


@pytest.mark.filterwarnings("ignore::sim.MirrorWarning")
@pytest.mark.fast_cases(6)
@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("kind", LAMPS)
def test_obstacles_outside_an_image_leave_it_unchanged(kind, path):
    obstacles = plates(np.random.default_rng(len(kind + path)))
    clear, behind = (PATHS[path](model_of(kind, each)) for each in ("", obstacles))
    assert clear.max() > 0.1
    np.testing.assert_allclose(behind, clear, atol=1e-6)  # rounding


@pytest.mark.filterwarnings("ignore::sim.MirrorWarning")
@pytest.mark.fast_cases(5)
@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("kind", [kind for kind in LAMPS if kind != "headlight"])
def test_other_lights_cast_shadows(kind, path):
    obstacles = plates(np.random.default_rng(len(kind + path)))
    assert PATHS[path](model_of(kind, obstacles, castshadow="true")).max() < 1e-6


@pytest.mark.filterwarnings("ignore::sim.MirrorWarning")
@pytest.mark.parametrize("variant", ["scalar_spectral", "llvm_ad_spectral"])
def test_lights_without_shadows_follow_the_model(variant):
    """The wall ahead is red under the headlight, whichever way the camera turns, and dark under a lamp that left."""
    model = model_of(
        "point", '<body name="lamp" mocap="true"><light type="point" pos="0 0 1" castshadow="false"/></body>'
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    mirror = sim.mirror(model, data, variant=variant)
    before = mirror.render("ahead", 4, 3, spp=4).mean()
    data.mocap_pos[0] = [1e4, 0, 0]  # behind the wall
    mujoco.mj_forward(model, data)
    mirror.sync(data)
    assert 0.1 < mirror.render("ahead", 4, 3, spp=64).mean() < 0.9 * before
