"""User models in closed form and by area sampling: they agree with rays by Mitsuba, or the error gives the reason."""

import mujoco
import numpy as np
import pytest

import optics
import sim

# A rover that slides and turns, a ball that rolls along a rail, and a ball whose pose is set from outside.
ROOM = """<mujoco><visual><headlight active="0"/></visual>
<asset>
  <texture name="bars" type="2d" builtin="gradient" rgb1=".9 .8 .2" rgb2=".1 .2 .6" width="64" height="1"/>
  <material name="bars" texture="bars" texrepeat="3 1" specular="0"/>
</asset>
<worldbody>
  <light type="directional" dir="-.5 -.3 -.9" diffuse=".8 .7 .6" ambient="0 0 0" specular="0 0 0"/>
  <light type="directional" dir=".6 .4 -.8" diffuse=".3 .4 .5" ambient="0 0 0" specular="0 0 0"/>
  <geom name="floor" type="plane" size="4 4 1" rgba=".3 .3 .3 1"/>
  <geom name="east" type="box" pos="3.5 0 .5" size=".5 3 .5" material="bars"/>
  <geom name="west" type="box" pos="-3.5 0 .5" size=".5 3 .5" rgba=".2 .6 .3 1"/>
  <geom name="north" type="box" pos="0 3.5 .5" size="4 .5 .5" rgba=".7 .2 .2 1"/>
  <geom name="south" type="box" pos="0 -3.5 .5" size="4 .5 .5" rgba=".8 .8 .8 1"/>
  <body name="rover" pos="-1 0 .25">
    <joint name="x" type="slide" axis="1 0 0"/><joint name="y" type="slide" axis="0 1 0"/>
    <joint name="turn" type="hinge" axis="0 0 1"/>
    {rover}
  </body>
  <body name="roller" pos="1 .5 .3"><joint name="roll" type="slide" axis="0 1 0"/>
    <geom name="ball" type="sphere" size=".3" rgba=".9 .5 .1 1"/></body>
  <body name="puck" pos="1.2 -1 .2" mocap="true"><geom name="puck" type="sphere" size=".2" rgba=".2 .4 .9 1"/></body>
  {extra}
</worldbody></mujoco>"""
ROVER = '<geom name="rover" type="sphere" size=".2" rgba=".5 .5 .5 1"/>'
MOUNTS = sim.ring("rover", 3, 120.0, 0.2 + 1e-6)
EYE = optics.Eye(resolution=(4, 6), fov_deg=60, bands=5, noise_sigma=0.01)
WORLDS = 6


def model(rover=ROVER, extra="", text=ROOM):
    return mujoco.MjModel.from_xml_string(text.format(rover=rover, extra=extra))


def moments(model, n=WORLDS, seed=0):
    rng, datas = np.random.default_rng(seed), [mujoco.MjData(model) for _ in range(n)]
    for data in datas:
        data.qpos[:4] = [*rng.uniform(-0.6, 0.6, 2), rng.uniform(-0.9, 0.9), rng.uniform(-1, 1)]
        mujoco.mj_forward(model, data)
    return datas


def rendered(model, datas, tracer="mitsuba", mounts=MOUNTS, eye=EYE, **how):
    fidelity = sim.Fidelity(how.pop("rays", 4), bands=eye.bands, **how)
    renderer = sim.ModelRenderer(model, eye, mounts, len(datas), fidelity, tracer=tracer)
    return renderer.signals(datas), renderer.tracer.name


def test_the_same_rays_see_the_same_by_either_tracer():
    """Both tracers follow the same rays in direct light. Only the few rays that graze an edge differ."""
    room, tilted = model(), sim.Mount("rover", azimuth_deg=20, elevation_deg=10, roll_deg=30, offset=(0, 0, 0.3))
    for mounts, rover in ((MOUNTS, ROVER), ([tilted], "")):
        room = model(rover or '<geom type="sphere" size=".1" group="4" mass="1"/>')
        datas = moments(room)
        ours, name = rendered(room, datas, "closed_form", mounts)
        theirs, _ = rendered(room, datas, "mitsuba", mounts)
        assert name == "closed_form"
        off = np.abs(ours - theirs)
        assert np.mean(off > 1e-3) < 0.03
        assert off.max() < 0.3  # a quarter of a receptor's rays
        assert theirs.std() > 0.02


def test_light_that_bounces_is_the_same_by_either_tracer():
    room = model()
    datas = moments(room)
    ours, theirs = (rendered(room, datas, tracer, rays=256, light="bounce")[0] for tracer in ("closed_form", "mitsuba"))
    direct, _ = rendered(room, datas, rays=256)
    assert np.abs(ours - direct).max() > 0.02
    assert np.sqrt(np.mean((ours - theirs) ** 2)) < 0.1 * np.sqrt(np.mean((theirs - direct) ** 2))


@pytest.mark.parametrize("lens", [None, optics.Pupil(20e-6, thin_lens_focal_length=240e-6)], ids=["perfect", "lens"])
def test_areas_see_what_many_rays_see(lens):
    eye = optics.Eye(lens, resolution=(4, 6), fov_deg=60, bands=5, sensor_width=280e-6)
    room = model()
    datas = moments(room)
    seen, name = rendered(room, datas, "auto", eye=eye, samples="areas")
    truth, _ = rendered(room, datas, eye=eye, rays=1024 if lens is None else 64)
    scale = eye.throughput
    assert name == "areas"
    assert np.sqrt(np.mean((seen - truth) ** 2)) < 0.01 * scale
    assert truth.std() > 0.03 * scale


def test_auto_takes_the_closed_form_and_the_default_stays_with_mitsuba():
    room = model()
    datas = moments(room, 1)
    assert rendered(room, datas, "auto")[1] == "closed_form"
    with_a_box = model(extra='<body mocap="true" pos="0 2 .2"><geom type="box" size=".1 .1 .1"/></body>')
    assert rendered(with_a_box, moments(with_a_box, 1), "auto")[1] == "mitsuba"
    fidelity = sim.Fidelity(4, bands=5)
    assert sim.ModelRenderer(room, EYE, MOUNTS, 1, fidelity).tracer.name == "mitsuba"


WALL = '<geom name="odd" type="{}" {}/>'
REASONS = {
    "geom 'cart' moves and is a box": '<body mocap="true" pos="0 2 .2">'
    '<geom name="cart" type="box" size=".1 .1 .1"/></body>',
    "geom 'odd' is neither a plane nor a box": WALL.format("cylinder", 'pos="0 2 .5" size=".1 .5"'),
    "box 'odd' is not aligned with the axes": WALL.format("box", 'pos="0 2 .5" size=".1 .1 .5" euler="0 0 20"'),
    "geom 'odd' is a mirror": '</worldbody><asset><material name="shiny" reflectance=".5"/></asset><worldbody>'
    + WALL.format("box", 'pos="0 2 .5" size=".1 .1 .5" material="shiny"'),
    "ends below the eyes": WALL.format("box", 'pos="0 2 .1" size=".1 .1 .1"'),
    "light 'lamp' shines from a place nearby": '<light name="lamp" pos="0 0 2" dir="0 0 -1"/>',
    "light 'low' shines from below": '<light name="low" type="directional" dir="0 .2 .9"/>',
    "light 'torch' moves": '<body mocap="true"><light name="torch" type="directional" dir="0 .2 -1"/>'
    '<geom type="sphere" size=".1" pos="0 0 .1"/></body>',
}


@pytest.mark.parametrize("reason", list(REASONS))
def test_what_has_no_closed_form_says_why(reason):
    with pytest.raises(ValueError, match=f"this world has no closed form: .*{reason}"):
        rendered(room := model(extra=REASONS[reason]), moments(room, 1), "closed_form")
    with pytest.raises(ValueError, match=f"samples = 'areas': this world has no closed form: .*{reason}"):
        rendered(room, moments(room, 1), samples="areas")


@pytest.mark.parametrize(
    ("joint", "reason"),
    [
        ('<joint name="lean" type="hinge" axis="0 1 0"/>', "on body 'rover', which may tilt by joint 'lean'"),
        (
            '<joint name="lift" type="slide" axis="0 0 1"/>',
            "on body 'rover', which may change its height by joint 'lift'",
        ),
        ('<geom type="sphere" size=".1" pos="0 0 .3"/>', "body 'rover', on which the eyes are, has 2 geoms"),
        ('<geom type="box" size=".1 .1 .1"/>', "moves and is a box"),
    ],
)
def test_eyes_must_stay_level(joint, reason):
    room = model(joint + ROVER if "joint" in joint else ROVER + joint)
    data = mujoco.MjData(room)
    mujoco.mj_forward(room, data)
    with pytest.raises(ValueError, match=reason):
        rendered(room, [data], "closed_form")


def test_other_reasons_are_named_too():
    room = model()
    datas = moments(room, 1)
    with pytest.raises(ValueError, match="the eyes are on several bodies"):
        rendered(room, datas, "closed_form", [*MOUNTS, sim.Mount("roller", offset=(0.4, 0, 0))])
    with pytest.raises(ValueError, match="do not look straight out from the skin of geom 'rover'"):
        rendered(room, datas, "closed_form", [sim.Mount("rover", azimuth_deg=90, offset=(0.21, 0, 0))])
    with pytest.raises(ValueError, match="sizes or colours of geom 'ball' differ between worlds"):
        sim.ModelRenderer(room, EYE, MOUNTS, 1, sim.Fidelity(4, bands=5), varied=("ball",), tracer="closed_form")
    with pytest.raises(ValueError, match="the headlight moves with each eye"):
        rendered(lit := model(text=ROOM.replace('active="0"', 'active="1"')), moments(lit, 1), "closed_form")
    glow = '<material name="glow" emission="1" rgba="1 1 1 1"/></asset>'
    shining = model(
        extra='<geom name="sign" type="box" pos="0 2.9 .5" size=".1 .1 .5" material="glow"/>',
        text=ROOM.replace("</asset>", glow),
    )
    with pytest.raises(ValueError, match="geom 'sign' glows"):
        rendered(shining, moments(shining, 1), "closed_form")
    sky = '<texture type="skybox" builtin="flat" rgb1=".2 .3 .5" width="8" height="8"/></asset>'
    outdoors = model(text=ROOM.replace("</asset>", sky))
    with pytest.raises(ValueError, match="there is a sky"):
        rendered(outdoors, moments(outdoors, 1), "closed_form")


def test_a_textured_ball_that_turns_is_refused():
    """Closed forms have a fixed orientation, but a user may rotate a mocap body."""
    geom = '<geom name="globe" type="sphere" size=".3" material="bars"/>'
    ball = f'<body name="globe" mocap="true" pos="1 1 .3">{geom}</body>'
    room = model(extra=ball)
    datas = moments(room, 1)
    rendered(room, datas, "closed_form")
    datas[0].mocap_quat[1] = 0.7, 0, 0, 0.7
    mujoco.mj_forward(room, datas[0])
    with pytest.raises(ValueError, match="'globe' has a texture and has turned"):
        rendered(room, datas, "closed_form")
