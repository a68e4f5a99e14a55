"""Models that are too large to build, or have positions that are not finite, are refused by name before memory is
allocated.
"""

import os

import mujoco
import pytest

from sim.scene.source import load

GEOM = "<geom name='ball' size='1'/>"


def model(inside, assets=""):
    return f"<mujoco><asset>{assets}</asset><worldbody>{inside}</worldbody></mujoco>"


BOMBS = {
    "a million copies": (
        model(f"<replicate count='1000000'><body>{GEOM}</body></replicate>"),
        "replicates to 2,000,004",
    ),
    "copies of copies": (
        model("<replicate count='200'>" * 3 + GEOM + "</replicate>" * 3),
        "elements: must be at most 20,000",
    ),
    "10**400 copies": (model(f"<replicate count='1{'0' * 400}'>{GEOM}</replicate>"), "elements: must be at most"),
    "a height field of 60,000 x 60,000": (
        model("<geom type='hfield' hfield='land'/>", "<hfield name='land' nrow='60000' ncol='60000' size='1 1 1 1'/>"),
        "hfield 'land' has 3,600,000,000",
    ),
    "nowhere": (model("<geom name='ball' size='1' pos='inf 0 0'/>"), "geom 'ball': pos = "),
    "no number": (model("<geom name='ball' size='1' pos='0 nan 0'/>"), "geom 'ball': pos = "),
    "no size": (model("<geom name='ball' size='inf'/>"), "geom 'ball': size = "),
    "a light nowhere": (model(f"{GEOM}<light name='sun' pos='0 0 inf'/>"), "light 'sun': pos = "),
    "a body nowhere": (model(f"<body name='stone' pos='inf 0 0'>{GEOM}</body>"), "body 'stone': pos = "),
}


@pytest.mark.parametrize("bomb", BOMBS)
@pytest.mark.parametrize("as_file", [False, True], ids=["text", "file"])
def test_bombs_are_refused_by_name_before_they_are_built(tmp_path, bomb, as_file):
    text, reason = BOMBS[bomb]
    if as_file:
        (tmp_path / "model.xml").write_text(text)
        text = tmp_path / "model.xml"
    with pytest.raises(ValueError, match=r"^mirror: ") as error:
        load(text)
    assert reason in str(error.value)
    assert "\n" not in str(error.value)


def test_models_that_fit_are_as_they_were():
    text = model(
        f"<replicate count='50' offset='3 0 0'>{GEOM}</replicate>",
        "<hfield name='land' nrow='100' ncol='100' size='1 1 1 1'/>",
    )
    assert load(text).ngeom == 50
    assert load(mujoco.MjSpec.from_string(text)).ngeom == 50


def test_what_a_file_includes_is_counted_too(tmp_path):
    (tmp_path / "bomb.xml").write_text(BOMBS["copies of copies"][0])
    (tmp_path / "between.xml").write_text("<mujoco><include file='bomb.xml'/><include file='between.xml'/></mujoco>")
    main = tmp_path / "main.xml"
    main.write_text("<mujoco><include file='between.xml'/></mujoco>")
    with pytest.raises(ValueError, match=r"bomb.xml' replicates to .* elements: must be at most 20,000"):
        load(main)


@pytest.mark.parametrize("element", ["<include file='pipe'/>", "<asset><mesh name='a' file='pipe'/></asset>"])
def test_pipes_in_the_place_of_files_are_refused(tmp_path, element):
    """MuJoCo would wait forever for someone to write into such a pipe."""
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "main.xml").write_text(f"<mujoco><compiler meshdir='.'/>{element}</mujoco>")
    with pytest.raises(ValueError, match=r"main.xml': (include|mesh) '.*pipe': must be a regular file"):
        load(tmp_path / "main.xml")


def test_a_file_that_includes_itself_is_mujocos_to_refuse(tmp_path):
    (tmp_path / "main.xml").write_text("<mujoco><include file='main.xml'/></mujoco>")
    with pytest.raises(ValueError, match="already included"):
        load(tmp_path / "main.xml")
