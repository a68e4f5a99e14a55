"""Models too large to build, or standing nowhere, are refused by name before anything of their size is built."""

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
