"""Bounced light, light of the sky and light of glowing geoms, on any model: against Mitsuba's `path` with three
vertices.
"""

import mujoco
import numpy as np
import pytest

import optics
import sim
from tests.sim.render.test_model_renderer import MODEL, SIDE

SIZE = (10, 14)
FOV = 2 * np.degrees(np.arctan(np.tan(np.radians(22.5)) * SIZE[1] / SIZE[0]))
EYE = optics.Eye(resolution=SIZE, fov_deg=FOV, bands=3)
RAYS = 1024
LAMPS = MODEL.replace('active="0"', 'diffuse=".3 .3 .3" ambient="0 0 0" specular="0 0 0"')
SKY = LAMPS.replace(
    "<asset>",
    '<asset><texture name="s" type="skybox" builtin="gradient" rgb1=".2 .5 .9" rgb2="1 1 1" width="64" height="64"/>',
)
GLOW = LAMPS.replace("<asset>", '<asset><material name="lamp" emission="2" rgba=".9 .6 .2 1"/>').replace(
    '<geom type="sphere"', '<geom type="box" size=".5 .05 .4" pos="-.2 1.2 .4" material="lamp"/><geom type="sphere"'
)
MODELS = {"lamps": LAMPS, "sky": SKY, "glow": GLOW}


@pytest.fixture(scope="module", params=MODELS)
def kind(request):
    return request.param


@pytest.fixture(scope="module")
def posed(kind):
    model = mujoco.MjModel.from_xml_string(MODELS[kind])
    data = mujoco.MjData(model)
    data.qpos[0] = 0.4
    mujoco.mj_forward(model, data)
    return model, data


@pytest.fixture(scope="module")
def truth(posed):
    """Return Mitsuba's signals (channel, y, x) by the number of a path's vertices."""
    model, data = posed
    mirror, bands, found = sim.mirror(model), EYE.spectral_bands, {}
    mirror.sync(data)
    for depth in (2, 3):
        how = {"type": "path", "max_depth": depth, "rr_depth": 100}
        light = mirror.render("side", SIZE[1], SIZE[0], spp=8192, wavelengths=bands.wavelengths, integrator=how)
        found[depth] = np.einsum("cb,byx->cyx", bands.weights, light)
    return found


def seen(posed, light="bounce", rays=RAYS):
    model, data = posed
    return sim.ModelRenderer(model, EYE, [SIDE], 1, sim.Fidelity(rays, bands=3, light=light)).signals([data])[0, 0]


def test_light_that_is_reflected_twice_is_mitsubas(posed, truth):
    """The means agree within 3 standard errors, which are a few thousandths and follow from the scatter over receptors.
    The test fails for direct light alone, and for a reference without the second reflection.
    """
    found, once = seen(posed), seen(posed, "direct")
    error = (found - truth[3]).std(axis=(1, 2), ddof=1) / np.sqrt(truth[3][0].size)  # standard error of both sides
    assert (error < 4e-3 * truth[3].mean(axis=(1, 2))).all()
    assert (np.abs((found - truth[3]).mean(axis=(1, 2))) < 3 * error).all()
    for wrong, right in ((once, truth[3]), (found, truth[2])):
        assert (np.abs((wrong - right).mean(axis=(1, 2))) > 6 * error).any()


def test_what_glows_is_seen_in_direct_light_too():
    """A plate of emission 2 ahead of the eye is twice as bright as its colour in full daylight."""
    text = """<mujoco><visual><headlight active="0"/></visual>
        <asset><material name="lamp" emission="2" rgba=".5 .5 .5 1"/></asset><worldbody>
        <geom type="box" size=".1 2 2" pos="2 0 0" material="lamp"/><body name="eye"/></worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    with pytest.warns(sim.MirrorWarning, match="light of material 'lamp' on surfaces"):
        renderer = sim.ModelRenderer(model, EYE, [sim.Mount("eye")], 1, sim.Fidelity(1, bands=3))
    linear = ((0.5 + 0.055) / 1.055) ** 2.4
    np.testing.assert_allclose(renderer.signals([data]), 2 * linear, rtol=0.02)  # three bands of daylight
    assert not renderer.only_directional


def test_a_furnace_keeps_what_it_has():
    """Light with at most two reflections adds up to g (1 + r + r²) in a closed room whose walls have radiance g and
    reflectance r, whatever the room's shape.
    """
    plates = "".join(
        f'<geom type="box" size="{x} {y} {z}" pos="{px} {py} {pz}" material="wall"/>'
        for axis in range(3)
        for side in (-1, 1)
        for x, y, z in [[0.1 if k == axis else 2.2 for k in range(3)]]
        for px, py, pz in [[side * 2 if k == axis else 0 for k in range(3)]]
    )
    text = f"""<mujoco><visual><headlight active="0"/></visual>
        <asset><material name="wall" emission="1" rgba=".7 .7 .7 1"/></asset>
        <worldbody>{plates}<body name="eye" pos=".3 .2 0"/></worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    reflectance = ((0.7 + 0.055) / 1.055) ** 2.4
    levels = [1.0, 1 + reflectance + reflectance**2]
    found = []
    for light in ("direct", "bounce"):
        renderer = sim.ModelRenderer(model, EYE, [sim.Mount("eye")], 1, sim.Fidelity(2, bands=3, light=light))
        found.append(renderer.signals([data]))
    for one in found:
        assert np.ptp(one / one[:, :, :, :1, :1]) < 1e-4
    np.testing.assert_allclose(found[1] / found[0], levels[1], rtol=2e-3)


def test_worlds_do_not_mix_and_colours_bounce():
    """A white floor lies next to a wall that is red in one world and grey in the other."""
    text = """<mujoco><visual><headlight active="0"/></visual><worldbody>
        <light type="directional" dir="1 0 -1"/>
        <geom name="floor" type="plane" size="5 5 .1" rgba=".9 .9 .9 1"/>
        <geom name="wall" type="box" size=".1 2 2" pos="1 0 2" rgba=".8 .8 .8 1"/>
        <body name="eye" pos="0 0 1"/></worldbody></mujoco>"""
    models = [mujoco.MjModel.from_xml_string(text) for _ in range(2)]
    models[1].geom("wall").rgba[:3] = 0.9, 0.05, 0.05
    datas = [mujoco.MjData(model) for model in models]
    for model, data in zip(models, datas, strict=True):
        mujoco.mj_forward(model, data)
    down = [sim.Mount("eye", elevation_deg=-80)]
    fidelity = sim.Fidelity(64, bands=3, light="bounce")
    both = sim.ModelRenderer(models[0], EYE, down, 2, fidelity, varied=["wall"]).signals(datas)[:, 0]
    grey, red = both.mean(axis=(2, 3))
    assert (red[1:] < grey[1:] - 0.01).all(), "a red wall reflects no green and blue"
    single = sim.ModelRenderer(models[1], EYE, down, 1, fidelity).signals(datas[1:])[0, 0]
    np.testing.assert_allclose(both[1], single, atol=5e-4)


CORNER = """<mujoco><visual><headlight active="0"/></visual><worldbody>
    <light type="directional" dir=".6 .3 -1"/>
    <geom type="plane" size="3 3 .1" rgba="{grey} 1"/>
    <geom type="box" size=".1 2 1" pos="1.5 0 1" rgba="{grey} 1"/>
    <body name="eye" pos="0 0 .7"/></worldbody></mujoco>"""


@pytest.mark.parametrize(("grey", "light"), [(".9 .9 .9", "bounce"), (".05 .05 .05", "direct")])
def test_light_bounces_where_it_counts(grey, light):
    """Bounced light is chosen in white corners and not in black ones. The predicted error of direct light agrees with a
    converged rendering.
    """
    model = mujoco.MjModel.from_xml_string(CORNER.format(grey=grey))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    eye = optics.Eye(resolution=(6, 6), fov_deg=60, bands=3, noise_sigma=0.04)
    arguments = model, eye, [sim.Mount("eye", elevation_deg=-20)], [data]
    found = sim.choose_model_fidelity(*arguments, light="auto")
    assert found.light == light
    levels = {level.stage: level for level in found.levels}
    seen = [
        sim.ModelRenderer(*arguments[:3], 1, sim.Fidelity(4096, bands=3, light=how)).signals([data])
        for how in ("direct", "bounce")
    ]
    left_out = np.abs(seen[1] - seen[0]).max(axis=2)
    error = np.sqrt(np.mean(np.square(left_out[left_out > 0.1 * found.tolerance]))) if light == "bounce" else 0
    if light == "bounce":
        assert f"{error:.1g}" in f"{levels['light'].why} {error * 1.02:.1g} {error * 0.98:.1g}"
        assert levels["light"].predicted_error is None
    else:
        assert levels["light"].predicted_error <= found.tolerance
        assert np.sqrt(np.mean(left_out**2)) <= found.tolerance
    plain = sim.choose_model_fidelity(*arguments)
    assert plain.light == "direct"
    assert "as requested" in plain.why


def test_rays_that_bounce_are_as_many_as_their_noise_wants():
    model = mujoco.MjModel.from_xml_string(CORNER.format(grey=".9 .9 .9"))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    eye = optics.Eye(resolution=(6, 6), fov_deg=60, bands=3, noise_sigma=0.04)
    arguments = model, eye, [sim.Mount("eye", elevation_deg=-20)]
    found = sim.choose_model_fidelity(*arguments, [data], light="bounce")
    assert found.samples == "rays"
    right = sim.ModelRenderer(*arguments, 1, sim.Fidelity(8192, bands=3, light="bounce")).signals([data])
    off = sim.ModelRenderer(*arguments, 1, found).signals([data]) - right
    assert np.sqrt(np.mean(off**2)) < 1.1 * found.tolerance
    fewer = sim.choose_model_fidelity(*arguments, [data])
    assert found.rays_per_receptor > fewer.rays_per_receptor
    with pytest.raises(ValueError, match="light = 'all': must be one of 'direct', 'bounce', 'auto'"):
        sim.choose_model_fidelity(*arguments, [data], light="all")


def test_edges_are_for_direct_light_and_all_light_for_areas():
    model = mujoco.MjModel.from_xml_string(LAMPS)
    with pytest.raises(ValueError, match="samples = 'edges': is for direct light"):
        sim.ModelRenderer(model, EYE, [SIDE], 1, sim.Fidelity(64, bands=3, light="bounce", samples="edges"))
    with pytest.raises(ValueError, match="samples = 'areas': this world has no closed form: "):
        sim.ModelRenderer(model, EYE, [SIDE], 1, sim.Fidelity(4, bands=3, light="all", samples="areas"))
