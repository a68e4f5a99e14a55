"""Changes of a model after its renderer was created are refused, unless eyes follow them."""

import copy

import mujoco
import numpy as np
import pytest

import sim
from optics import Eye

MODEL = mujoco.MjModel.from_xml_string("""
    <mujoco><visual><headlight active="0"/></visual><asset>
      <texture name="tiles" type="2d" builtin="checker" rgb1="1 1 1" rgb2="0 0 0" width="8" height="8"/>
      <hfield name="hills" nrow="3" ncol="3" size="1 1 .5 .1"/>
      <hfield name="unseen" nrow="3" ncol="3" size="1 1 .5 .1"/>
      <material name="tiles" texture="tiles"/>
      <material name="red" rgba=".8 .1 .1 1"/><material name="clear" rgba="1 1 1 0"/><material name="spare"/>
    </asset><worldbody>
      <light name="sun" type="directional" dir="0 0 -1"/><light name="off" type="directional" active="false"/>
      <geom name="wall" type="box" size=".1 1 1" pos="2 0 1" euler="0 0 10" material="red"/>
      <geom name="land" type="hfield" hfield="hills" pos="0 3 0"/>
      <geom name="ghost" size=".2" pos="1 0 1" rgba="1 0 0 0"/>
      <geom name="pane" size=".2" pos="1 1 1" material="clear"/>
      <geom name="own" size=".1" pos="0 9 0" rgba=".2 .2 .2 1" material="spare"/>
      <body name="post" pos="2 2 1"><geom name="ball" size=".2" rgba=".1 .9 .1 1"/></body>
      <geom name="apart" group="4" size=".1" pos="0 0 9"/>
      <body><freejoint/><geom name="stone" size=".1" pos="0 -1 0" rgba=".1 .9 .1 1"/></body>
      <site name="eye" pos="0 0 1" group="3"/></worldbody></mujoco>""")
WORLDS = 2


def renderer_of(varied=()):
    eye = Eye(resolution=(3, 3), bands=1)
    return sim.ModelRenderer(MODEL, eye, [sim.Mount("eye")], WORLDS, sim.Fidelity(1, bands=1), varied=varied)


@pytest.fixture(scope="module")
def renderer():
    return renderer_of()


def worlds(change=None, shared=False):
    """Return poses of worlds in which the model of the last world, or of all worlds, has changed."""
    models = [copy.copy(MODEL)] * WORLDS if shared else [copy.copy(MODEL) for _ in range(WORLDS)]
    if change is not None:
        change(models[-1])
    datas = [mujoco.MjData(model) for model in models]
    for model, data in zip(models, datas, strict=True):
        mujoco.mj_forward(model, data)
    return datas


def setting(field, value, kind=None, name=None):
    """Return a change of a field, or of one named entry of it."""

    def change(model):
        getattr(model, field)[... if kind is None else getattr(model, kind)(name).id] = value

    return change


ANEW = "which still shows the old value: make a new renderer"
HANG = "is static in the renderer's model and has moved: must be on a joint or on a mocap body"
OTHER = f"differs from the renderer's model, {ANEW}"


def headlight(active):
    return lambda model: setattr(model.vis.headlight, "active", active)


REFUSED = {
    "place": (setting("geom_pos", [2, 0, 1.5], "geom", "wall"), f"geom 'wall' {HANG}"),
    "turn": (setting("geom_quat", [0.9, 0, 0, 0.435889894], "geom", "wall"), f"geom 'wall' {HANG}"),
    "place of a body": (setting("body_pos", [2, 2, 1.001], "body", "post"), f"geom 'ball' {HANG}"),
    "heights": (setting("hfield_data", 0.5), f"hfield 'hills' differs in hfield_data from .*{ANEW}"),
    "material": (setting("mat_rgba", 1, "material", "red"), f"material 'red' differs in mat_rgba from .*{ANEW}"),
    "glow": (setting("mat_emission", 1, "material", "red"), f"material 'red' differs in mat_emission from .*{ANEW}"),
    "lamp": (setting("light_diffuse", 0.1, "light", "sun"), f"light 'sun' differs in light_diffuse from .*{ANEW}"),
    "switch": (setting("light_active", 1, "light", "off"), f"light 'off' differs in light_active from .*{ANEW}"),
    "ghost": (setting("geom_rgba", 1, "geom", "ghost"), "geom 'ghost' was invisible .* now: make a new renderer"),
    "pane": (setting("mat_rgba", 1, "material", "clear"), f"material 'clear' differs in mat_rgba from .*{ANEW}"),
    "other pane": (
        setting("geom_matid", 1, "geom", "pane"),
        "geom 'pane' was invisible .* now: make a new renderer",
    ),
    "headlight": (headlight(1), f"vis.headlight.active {OTHER}"),
    "its colour": (lambda model: model.vis.headlight.diffuse.fill(0.1), f"vis.headlight.diffuse {OTHER}"),
    "texture": (setting("mat_texid", -1, "material", "tiles"), f"mat_texid {OTHER}"),
    "tiles": (setting("mat_texrepeat", 3, "material", "tiles"), f"mat_texrepeat {OTHER}"),
    "group": (setting("geom_group", 4, "geom", "wall"), f"geom_group {OTHER}"),
    "kind of lamp": (setting("light_type", mujoco.mjtLightType.mjLIGHT_POINT, "light", "sun"), f"light_type {OTHER}"),
    "distance": (setting("light_attenuation", 0.5, "light", "sun"), f"light_attenuation {OTHER}"),
    "cone": (setting("light_cutoff", 20, "light", "sun"), f"light_cutoff {OTHER}"),
    "size": (setting("geom_size", 0.3, "geom", "ball"), "geom 'ball' differs in size from .* must be in `varied`"),
}
FOLLOWED = {
    "nothing": None,
    "what moves": setting("geom_pos", [0, -2, 0], "geom", "stone"),
    "a material without things": setting("mat_rgba", 0, "material", "spare"),
    "another ghost": setting("geom_rgba", [0, 1, 0, 0], "geom", "ghost"),
    "what is in no group": setting("geom_pos", [0, 0, 8], "geom", "apart"),
    "a field without a geom": lambda model: model.hfield_data.__setitem__(slice(9, None), 0.5),
}


@pytest.mark.parametrize("shared", [False, True])
@pytest.mark.parametrize("name", REFUSED)
def test_what_eyes_would_not_notice_is_refused(renderer, name, shared):
    change, words = REFUSED[name]
    datas = worlds(change, shared)
    for look in (renderer.signals, renderer.depth, renderer.ids):
        with pytest.raises(ValueError, match=words) as refused:
            look(datas)
        assert "\n" not in str(refused.value)


@pytest.mark.parametrize("shared", [False, True])
@pytest.mark.parametrize("name", FOLLOWED)
def test_what_makes_no_difference_is_not(renderer, name, shared):
    assert np.isfinite(renderer.signals(worlds(FOLLOWED[name], shared))).all()


def test_what_varies_is_not():
    """Geoms that vary between worlds are intersected like moving ones, so they may also change position."""
    renderer = renderer_of({"ball": (), "wall": ("red", "spare")})
    for change in (
        setting("geom_size", 0.3, "geom", "ball"),
        setting("geom_rgba", [0, 0, 1, 1], "geom", "ball"),
        setting("body_pos", [2, 2, 2], "body", "post"),
        setting("geom_matid", MODEL.material("spare").id, "geom", "wall"),
    ):
        assert np.isfinite(renderer.signals(worlds(change))).all()
    with pytest.raises(ValueError, match="material 'spare' differs in mat_rgba"):
        renderer.signals(worlds(setting("mat_rgba", 0.1, "material", "spare")))


def test_float32_is_no_difference(renderer):
    """Another simulator may give stacked float32 arrays, of objects 3 m away, without some fields."""
    exact = sim.Poses.from_data(worlds())
    names = ("geom_xpos", "geom_xmat", "site_xpos", "site_xmat", "cam_xpos", "cam_xmat", "xpos", "xmat")
    names = (*names, "light_xpos", "light_xdir")
    rounded = sim.Poses(**{name: np.asarray(getattr(exact, name), np.float32) for name in names})
    np.testing.assert_allclose(renderer.signals(rounded), renderer.signals(exact), atol=1e-6)


def test_another_models_things_are_refused(renderer):
    other = copy.copy(sim.Poses.from_data(worlds()))
    object.__setattr__(other, "mat_rgba", other.mat_rgba[:, :1])
    with pytest.raises(ValueError, match="poses of another model"):
        renderer.signals(other)
