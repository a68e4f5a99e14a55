"""Colours of textures from image files, against rgba of the same values.

MuJoCo displays both alike, whether or not a file has a colour chunk. The tests detect values that are taken for linear
light (0.502 instead of 0.216 for a level of 128), also in a single kind of texture or file.
"""

import warnings
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

import optics
import sim
from optics import Spectrum
from sim.pictures.quick_camera import QuickCamera
from sim.scene import source
from sim.scene.cameras import Viewpoint
from sim.scene.color import decode_srgb
from sim.scene.mirror import MirrorWarning
from sim.scene.surfaces import linear

from .png import flat

HEIGHT = 200.0  # of the camera above the tiles [m]: rays are parallel to 2°
FOVY = 2 * np.degrees(np.arctan(0.5 / HEIGHT))
NM = np.array([450.0, 550.0, 650.0])
WORLD = """<mujoco><visual><headlight active="0"/><map zfar="1e3"/></visual><asset>{assets}</asset><worldbody>
 <light type="directional" dir="0 0 -1" diffuse="{lamp} {lamp} {lamp}"/>
 <camera name="top" pos="0 0 {height}" fovy="{fovy}"/>{geoms}</worldbody></mujoco>"""
SIZES = {"box": ".5 .5 .1", "plane": ".5 .5 .1", "sphere": ".5"}
GREY = '<texture name="t" type="2d" file="t.png" colorspace="{}"/><material name="m" texture="t"/>'


def drawn_tile(rng, is_grey=False, glow=0.0):
    """Return a random textured tile: its file, texture, geom and material, and the equal rgba.

    A grey tile is flat, so that it lights no other tile if it glows.
    """
    channels = int(rng.integers(1, 3 if is_grey else 5))
    color = rng.integers(1, 256, 1 if channels < 3 else 3)
    geom = rng.choice(["box", "plane"] if is_grey else list(SIZES))
    tint = 1.0 if is_grey else rng.choice([np.ones(3), rng.uniform(0.3, 1, 3)])
    pixels = [*color, *([255] if channels in (2, 4) else [])]
    return SimpleNamespace(
        file=flat(pixels, bits=int(rng.choice([8, 16])), is_tagged=bool(rng.random() < 0.3)),
        texture="2d" if geom == "plane" else rng.choice(["2d", "cube"]),
        geom=geom,
        emission=glow,
        tint=np.broadcast_to(tint, 3),
        rgba=np.broadcast_to(color, 3) / 255 * tint,
    )


def model_of(tiles, is_textured):
    """Return the compiled model of a row of tiles, with the textures or with the equal rgba."""
    assets, geoms = [], []
    for k, tile in enumerate(tiles):
        material = f'<material name="m{k}" emission="{tile.emission}" specular="0" shininess="0" '
        if is_textured:
            assets.append(f'<texture name="t{k}" type="{tile.texture}" file="t{k}.png"/>')
            assets.append(f'{material} texture="t{k}" rgba="{_text(tile.tint)} 1"/>')
        else:
            assets.append(f'{material} rgba="{_text(tile.rgba)} 1"/>')
        x = k - (len(tiles) - 1) / 2
        geoms.append(f'<geom type="{tile.geom}" size="{SIZES[tile.geom]}" pos="{x} 0 0" material="m{k}"/>')
    lamp = 0.8 if tiles[0].emission == 0 else 0.0
    xml = WORLD.format(assets="".join(assets), geoms="".join(geoms), height=HEIGHT, fovy=FOVY, lamp=lamp)
    return mujoco.MjModel.from_xml_string(xml, {f"t{k}.png": tile.file for k, tile in enumerate(tiles)})


def _text(values):
    return " ".join(f"{value:.9g}" for value in values)


def in_mirror(model):
    """Return the radiance of the tiles' middles, (band, tile), in the mirror."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MirrorWarning)  # a lamp that is off
        mirror = sim.mirror(model)
    image = mirror.render("top", 3 * model.ngeom, 3, spp=4, wavelengths=NM * 1e-9)
    return image[:, 1, 1::3]


def in_eye(model):
    """Return the signals of an eye above the tiles' middles, (channel, tile)."""
    fov = 2 * np.degrees(np.arctan(model.ngeom / 2 / HEIGHT))
    eye = optics.Eye(resolution=(3, 3 * model.ngeom), fov_deg=fov, bands=4)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MirrorWarning)  # light of glowing tiles
        renderer = sim.ModelRenderer(model, eye, [sim.Mount("top")], 1, sim.Fidelity(4, bands=4))
    return renderer.signals([data])[0, 0, :, 1, 1::3]


def in_quick_image(model):
    """Return the displayed colours of the tiles' middles, (tile, 3), in a quick image."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MirrorWarning)
        return QuickCamera(model).picture(data, "top", 3 * model.ngeom, 3)[1, 1::3].astype(float) / 255


@pytest.mark.fast_cases(2)
@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("seen", [in_mirror, in_eye])
def test_files_show_the_colours_of_rgba(seen, seed):
    """The tolerance is for spheres, whose textured form consists of triangles."""
    rng = np.random.default_rng(seed)
    tiles = [drawn_tile(rng) for _ in range(12)]
    np.testing.assert_allclose(seen(model_of(tiles, True)), seen(model_of(tiles, False)), rtol=2e-3)


@pytest.mark.fast_cases(3)
@pytest.mark.parametrize("glow", [0.0, 0.6])
@pytest.mark.parametrize("seen", [in_mirror, in_eye, in_quick_image])
def test_grey_files_glow_and_are_displayed_like_rgba(seen, glow):
    """The tolerance is one step of 8 bits, as in a quick image."""
    rng = np.random.default_rng(2)
    tiles = [drawn_tile(rng, is_grey=True, glow=glow) for _ in range(2)]
    np.testing.assert_allclose(seen(model_of(tiles, True)), seen(model_of(tiles, False)), atol=1.01 / 255)


@pytest.mark.parametrize(("level", "share"), [(64, 0.0513), (128, 0.2159), (200, 0.5776)])
def test_levels_reflect_their_share_of_light(level, share):
    """Shares are those of IEC 61966-2-1."""
    xml = f"<mujoco><asset>{GREY.format('auto')}</asset><worldbody/></mujoco>"
    model = mujoco.MjModel.from_xml_string(xml, {"t.png": flat([level])})
    np.testing.assert_allclose(linear(model, 0, np.ones(3)), share, rtol=1e-3)


@pytest.mark.fast_cases(1)
@pytest.mark.parametrize("seed", range(2))
def test_skies_of_files_show_the_light_of_builtin_skies(seed):
    rng = np.random.default_rng(seed)
    level, bits, channels = int(rng.integers(1, 256)), int(rng.choice([8, 16])), int(rng.choice([1, 3]))
    files = {"s.png": flat([level] * channels, bits=bits), "t.png": flat([level] * channels, is_tagged=True)}
    sides = " ".join(f'file{side}="s.png"' for side in ("right", "left", "up", "down", "front", "back"))
    grey = f"{level / 255:.9g}"
    skies = ('file="s.png"', 'file="t.png"', sides, f'builtin="flat" rgb1="{grey} {grey} {grey}" width="8" height="8"')
    view, found = Viewpoint.looking_at(np.zeros(3), rng.normal(size=3), 1.0), []
    for sky in skies:
        xml = (
            f'<mujoco><visual><headlight active="0"/></visual><asset><texture type="skybox" {sky}/></asset><worldbody>'
            '<geom size=".01" pos="0 0 -50"/></worldbody></mujoco>'
        )
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", MirrorWarning)
            mirror = sim.mirror(mujoco.MjModel.from_xml_string(xml, files))
        found.append(mirror.render(view, 1, 1, spp=1, wavelengths=NM * 1e-9)[:, 0, 0])
    # MuJoCo truncates builtin colours to 8 bits, so they may be one level darker.
    darker = decode_srgb(max(level - 1, 0) / 255) / decode_srgb(level / 255)
    np.testing.assert_allclose(found[:3], [found[0]] * 3, rtol=1e-5)
    assert np.all(found[3] <= found[0] * (1 + 1e-3))
    assert np.all(found[3] >= found[0] * darker * (1 - 1e-3))


def test_a_grey_file_multiplies_a_spectrum_by_its_light():
    leaf = Spectrum((300, 500, 780), (0.1, 0.9, 0.4))
    tile = SimpleNamespace(
        file=flat([128]), texture="2d", geom="box", emission=0.0, tint=np.ones(3), rgba=np.full(3, 128 / 255)
    )
    mirror = sim.mirror(model_of([tile], True), spectra={"m0": leaf})
    found = mirror.render("top", 1, 1, spp=1, wavelengths=NM * 1e-9)[:, 0, 0]
    white = sim.mirror(model_of([tile], False), spectra={"m0": leaf}).render("top", 1, 1, spp=1, wavelengths=NM * 1e-9)
    np.testing.assert_allclose(found, decode_srgb(128 / 255) * white[:, 0, 0], rtol=1e-3)


def requests(folder, requested):
    """Return sources of a model whose texture "t" has the value 128, with or without a request for linear light."""
    space = "linear" if requested else "auto"
    (folder / "t.png").write_bytes(flat([128]))
    text = '<mujoco><compiler texturedir="{}"/><asset>{}</asset><worldbody><geom size="1" material="m"/></worldbody>{}'
    text = text.format(folder, GREY.format(space), "{}</mujoco>")
    mark = '<custom><tuple name="linear_textures"><element objtype="texture" objname="t"/></tuple></custom>'
    xml, marked = text.format(""), text.format(mark if requested else "")
    (folder / "world.xml").write_text(xml)
    spec, arm, whole = mujoco.MjSpec.from_string(xml), mujoco.MjSpec.from_string(xml), mujoco.MjSpec()
    whole.attach(arm, prefix="arm_", frame=whole.worldbody.add_frame())
    return {
        "text": xml,
        "spec": spec,
        "attached": whole,
        "file": folder / "world.xml",
        "marked": mujoco.MjModel.from_xml_string(marked),
        "marked twice": marked,
    }


@pytest.mark.fast_cases(6)
@pytest.mark.parametrize("kind", ["text", "spec", "attached", "file", "marked", "marked twice"])
@pytest.mark.parametrize("requested", [True, False])
def test_linear_light_must_be_requested(tmp_path, kind, requested):
    """A request survives copies of the compiled model, and the source is not changed."""
    given = requests(tmp_path, requested)[kind]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MirrorWarning)  # ambient part of the headlight
        model = sim.mirror(given).model
    assert model.tex_colorspace[0] == mujoco.mjtColorSpace.mjCOLORSPACE_LINEAR  # in either case
    expected = 128 / 255 if requested else decode_srgb(128 / 255)
    mujoco.mj_saveModel(model, str(tmp_path / "world.mjb"))
    for each in (model, source.load(tmp_path / "world.mjb"), source.load(given)):
        np.testing.assert_allclose(linear(each, 0, np.ones(3)), expected, rtol=1e-5)
    assert not isinstance(given, mujoco.MjSpec) or not list(given.tuples)


def test_textures_without_a_name_can_request_linear_light():
    sky = '<texture type="skybox" builtin="flat" width="8" height="8" rgb1=".5 .5 .5" colorspace="linear"/>'
    model = source.load(f"<mujoco><asset>{sky}</asset><worldbody/></mujoco>")
    np.testing.assert_allclose(linear(model, 0, np.ones(3)), 127 / 255, rtol=1e-6)


def test_a_mark_lists_textures_only():
    mark = '<custom><tuple name="linear_textures"><element objtype="geom" objname="g"/></tuple></custom>'
    geom = '<geom name="g" size="1" material="m"/>'
    xml = f"<mujoco><asset>{GREY.format('auto')}</asset><worldbody>{geom}</worldbody>{mark}</mujoco>"
    model = mujoco.MjModel.from_xml_string(xml, {"t.png": flat([128])})
    with pytest.raises(ValueError, match="tuple 'linear_textures' lists an object that is not a texture"):
        sim.mirror(model)


def test_a_source_may_request_what_its_compiled_model_says(tmp_path):
    """Runs that were recorded before textures were display colours need this."""
    given = requests(tmp_path, False)
    for kind in ("text", "spec", "attached", "file"):
        model = source.load(source.with_compiled_color_spaces(given[kind]))
        np.testing.assert_allclose(linear(model, 0, np.ones(3)), 128 / 255, rtol=1e-5)
    with pytest.raises(ValueError, match="textures 't' of a compiled model cannot request linear light: must be MJCF"):
        source.with_compiled_color_spaces(given["marked"])
    plain = "<mujoco><worldbody/></mujoco>"
    assert source.with_compiled_color_spaces(plain) is plain
