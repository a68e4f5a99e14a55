"""URDF models, whose visuals MuJoCo discards unless the file says otherwise."""

import mujoco
import pytest

import optics
import sim

KEEP = '<mujoco><compiler discardvisual="false"/></mujoco>'
MASS = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
BOX = '<visual><geometry><box size="1 1 1"/></geometry></visual>'


def robot(settings: str) -> mujoco.MjModel:
    """A robot of two links that have visuals only."""
    links = "".join(f'<link name="{name}">{MASS}{BOX}</link>' for name in ("base", "head"))
    joint = '<joint name="neck" type="continuous"><parent link="base"/><child link="head"/><axis xyz="0 0 1"/></joint>'
    return mujoco.MjModel.from_xml_string(f'<robot name="robot">{settings}{links}{joint}</robot>')


@pytest.mark.parametrize(
    "show", [sim.mirror, lambda model: sim.ModelRenderer(model, optics.Eye(resolution=(2, 2)), [sim.Mount("head")])]
)
def test_discarded_visuals_are_named(show):
    with pytest.raises(ValueError, match=f"MuJoCo discards the visuals of a URDF, unless its <robot> contains {KEEP}"):
        show(robot(""))


def test_the_recommended_setting_keeps_visuals():
    model = robot(KEEP)
    assert model.ngeom == 2
    with pytest.warns(sim.MirrorWarning):  # the headlight's ambient part
        assert len(sim.mirror(model).geoms) == 2
