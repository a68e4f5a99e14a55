"""Sources of a mirror, and the one-line error for a broken model."""

import mujoco
import numpy as np
import pytest

import sim

BALL = '<mujoco><visual><headlight active="0"/></visual><worldbody><geom name="ball" size="1"/></worldbody></mujoco>'


def test_models_specs_files_and_text_are_the_same(tmp_path):
    path = tmp_path / "ball.xml"
    path.write_text(BALL)
    model = mujoco.MjModel.from_xml_path(str(path))
    mujoco.mj_saveModel(model, str(tmp_path / "ball.mjb"))
    sources = [model, mujoco.MjSpec.from_string(BALL), path, str(path), BALL, tmp_path / "ball.mjb"]
    for source in sources:
        mirror = sim.mirror(source)
        assert mirror.model.geom("ball").size[0] == 1
        assert list(mirror.geoms) == [0]


@pytest.mark.parametrize(
    ("xml", "named"),
    [
        ('<mujoco><asset><mesh name="m" file="gone.stl"/></asset></mujoco>', "gone.stl.*; put the file there"),
        ('<mujoco><asset><texture type="2d" file="gone.png"/></asset></mujoco>', "gone.png.*; put the file there"),
        ('<mujoco><asset><hfield name="h" file="gone.png" size="1 1 1 1"/></asset></mujoco>', "gone.png.*; put"),
        ('<mujoco><worldbody><geom type="cone" size="1"/></worldbody></mujoco>', "cone.*line 1.*; correct"),
        ('<mujoco><worldbody><goem size="1"/></worldbody></mujoco>', "goem.*; correct"),
        ('<mujoco><worldbody><geom name="b" size="0"/></worldbody></mujoco>', "size.*b.*; correct"),
        ("<mujoco><worldbody>", "worldbody; correct"),
    ],
)
@pytest.mark.parametrize("as_file", [False, True], ids=["text", "file"])
def test_what_does_not_compile_ends_in_one_line(tmp_path, xml, named, as_file):
    source = xml
    if as_file:
        source = tmp_path / "broken.xml"
        source.write_text(xml)
        named = f"broken.xml' does not compile: .*{named}"
    with pytest.raises(ValueError, match=named) as caught:
        sim.mirror(source)
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith("mirror: ")


def test_what_is_no_model_is_named(tmp_path):
    with pytest.raises(ValueError, match=r"no file 'nowhere\.xml'"):
        sim.mirror("nowhere.xml")
    with pytest.raises(ValueError, match="model is a int"):
        sim.mirror(3)
    broken = tmp_path / "broken.mjb"
    broken.write_bytes(b"no model")
    with pytest.raises(ValueError, match=r"broken\.mjb' does not compile"):
        sim.mirror(broken)


def test_data_of_another_model_and_lost_bodies_are_named():
    mirror = sim.mirror(
        BALL.replace("<geom", '<body name="b"><freejoint/><geom').replace("/></world", "/></body></world")
    )
    other = mujoco.MjModel.from_xml_string(BALL.replace("</world", '<geom size="2"/></world'))
    with pytest.raises(ValueError, match="data has 2 geoms and 1 bodies, but the model has 1 and 2"):
        mirror.sync(mujoco.MjData(other))
    data = mujoco.MjData(mirror.model)
    with pytest.raises(ValueError, match=r"call mujoco.mj_forward\(model, data\) first"):
        sim.mirror(mirror.model, data)
    mujoco.mj_forward(mirror.model, data)
    mirror.sync(data)
    data.geom_xpos[0, 1] = np.nan
    with pytest.raises(ValueError, match="geom 'ball' has no finite position"):
        mirror.sync(data)
