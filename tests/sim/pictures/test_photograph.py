"""Photographs through the eyes of animals: white, colours, positions, ultraviolet, and files."""

import math

import numpy as np
import pytest
from PIL import Image

import optics
from optics.spectra.spectrum import daylight, srgb_basis
from sim import read_exr
from sim.pictures import photograph
from sim.pictures.photograph import ANIMALS, read_depth, read_photograph, see_photograph
from sim.pictures.receptor_mosaic import ReceptorMosaic

WHITE = np.ones((12, 16, 3))


@pytest.fixture
def one_band(monkeypatch):
    """Compute ommatidia in one band only, because their acceptance functions take most of the time."""
    monkeypatch.setattr(photograph, "BANDS", 1)


def test_the_primaries_add_up_to_white_and_have_the_colours_of_srgb():
    """White is D65. Each primary's XYZ in daylight is the column of the matrix of IEC 61966-2-1."""
    nm = np.arange(380, 781, 5)
    inks = np.stack([ink.at(nm * 1e-9) for ink in srgb_basis()])
    np.testing.assert_allclose(inks.sum(axis=0), 1, atol=2e-3)
    matching = optics.spectra.spectrum.cie_1931(nm * 1e-9) * daylight(nm * 1e-9)[:, None]
    found = (inks @ matching / matching[:, 1].sum()).T
    expected = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
    np.testing.assert_allclose(found, expected, atol=2e-3)


@pytest.mark.parametrize("animal", ["honeybee", "goldfish", "mouse"])
def test_a_white_photograph_gives_signals_of_one(animal, one_band):
    seen = see_photograph(WHITE, animal, 20.0)
    np.testing.assert_allclose(seen.signals, 1, atol=0.02)


def test_ommatidia_look_at_their_places(one_band):
    """A white square in the right upper corner excites ommatidia there, and rows are √3/2 Δφ apart."""
    corner = np.zeros((48, 64, 3))
    corner[:24, 32:] = 1
    seen = see_photograph(corner, "honeybee", 40.0)
    rows, columns = seen.signals.shape[1:]
    assert columns == int(40 / 2.1)
    assert rows == int(math.degrees(2 * math.atan(0.75 * math.tan(math.radians(20)))) / (2.1 * math.sqrt(3) / 2))
    assert seen.hexagons
    green = seen.signals[0]
    assert green[: rows // 2 - 3, columns // 2 + 3 :].min() > 0.9
    assert green[rows // 2 + 3 :].max() < 0.1
    assert green[:, : columns // 2 - 3].max() < 0.1


def test_a_camera_eye_keeps_the_orientation_of_the_photograph():
    corner = np.zeros((12, 16, 3))
    corner[:6, 8:] = 1
    seen = see_photograph(corner, "mouse", 30.0).signals[0]
    rows, columns = seen.shape
    assert seen[: rows // 2 - 1, columns // 2 + 1 :].min() > 0.8
    assert seen[rows // 2 + 1 :].max() < 0.2
    assert seen[:, : columns // 2 - 1].max() < 0.2


def test_without_ultraviolet_light_the_receptor_for_it_is_dark():
    bright, dark = (see_photograph(WHITE, "mouse", 20.0, uv) for uv in (1.0, 0.0))
    assert dark.signals[1].max() < 0.5 * bright.signals[1].min()
    np.testing.assert_allclose(dark.signals[0], bright.signals[0], atol=0.1)


def test_red_excites_the_long_receptors_of_a_human():
    red = np.zeros_like(WHITE)
    red[..., 0] = 1
    long, middle, short = see_photograph(red, "human", 5.0).signals.mean(axis=(1, 2))
    assert long > 1.5 * middle > 3 * short > 0


def test_files_contain_the_photograph_and_the_signals(tmp_path):
    signals = np.arange(24.0).reshape(2, 3, 4) / 24
    mosaic = ReceptorMosaic("bee", signals, (540.0, 344.0), 60.0, True)
    mosaic.write_exr(tmp_path / "bee.exr")
    (view,) = read_exr(tmp_path / "bee.exr")
    np.testing.assert_allclose(view.receptors, signals, atol=1e-7)
    assert view.attributes == {"animal": "bee", "width_deg": 60.0, "odd_rows_shifted": True}
    mosaic.write_png(tmp_path / "bee.png", WHITE, 90)
    with Image.open(tmp_path / "bee.png") as image:
        pixels = np.asarray(image)
    assert pixels.shape[0] == 90
    assert (pixels[:, :120] == 255).all()
    assert pixels[45, 140:].std() > 10


def test_hexagons_and_squares_have_the_colours_of_their_signals():
    """The last of 2 x 2 receptors is bright in its long channel only."""
    signals = np.zeros((3, 2, 2))
    signals[0, 1, 1] = 1
    for hexagons in (True, False):
        image = ReceptorMosaic("bee", signals, (600.0, 500.0, 400.0), 60.0, hexagons).image(height=80)
        red = np.argwhere(image[..., 0] > 200)
        assert image[..., 1:].max() == 0
        assert red.mean(axis=0)[0] > 40
        assert red.mean(axis=0)[1] > image.shape[1] / 2


def test_progress_reaches_one(one_band):
    shares = []
    see_photograph(WHITE, "honeybee", 10.0, progress=shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


@pytest.mark.parametrize(
    ("mode", "words"), [("L", "three channels"), ("RGBA", "transparency"), ("CMYK", "three channels")]
)
def test_images_of_other_kinds_are_refused(tmp_path, mode, words):
    Image.new(mode, (16, 12)).save(tmp_path / "photo.tiff")
    with pytest.raises(ValueError, match=words):
        read_photograph(tmp_path / "photo.tiff")


@pytest.mark.parametrize("mode", ["RGB", "P"])
def test_a_transparent_colour_is_refused(tmp_path, mode):
    Image.new(mode, (16, 12)).save(tmp_path / "photo.png", transparency=0 if mode == "P" else (0, 0, 0))
    with pytest.raises(ValueError, match="has transparency"):
        read_photograph(tmp_path / "photo.png")


def test_a_photograph_is_turned_upright(tmp_path):
    """Cameras store the orientation beside the pixels. 6: the stored left edge is the top edge."""
    stored = np.zeros((12, 16, 3), np.uint8)
    stored[:, :8] = 255
    orientation = Image.Exif()
    orientation[0x0112] = 6
    Image.fromarray(stored).save(tmp_path / "photo.png", exif=orientation)
    upright = read_photograph(tmp_path / "photo.png")
    assert upright.shape == (16, 12, 3)
    assert upright[:8].min() == 1
    assert upright[8:].max() == 0


@pytest.mark.parametrize("damage", ["half", "name of a chunk"])
def test_damaged_files_are_refused_by_name(tmp_path, damage):
    noise = np.random.default_rng(0).integers(256, size=(200, 300, 3), dtype=np.uint8)
    Image.fromarray(noise).save(tmp_path / "photo.png")
    content = (tmp_path / "photo.png").read_bytes()
    at = content.index(b"IDAT", content.index(b"IDAT") + 4)
    cut = content[: len(content) // 2] if damage == "half" else content[:at] + b"\xff" + content[at + 1 :]
    (tmp_path / "photo.png").write_bytes(cut)
    with pytest.raises(ValueError, match=r"photo.png: .*: must be an undamaged image") as raised:
        read_photograph(tmp_path / "photo.png")
    assert "\n" not in str(raised.value)


def test_too_many_pixels_are_refused(tmp_path, monkeypatch):
    Image.new("RGB", (16, 13)).save(tmp_path / "photo.png")
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 100)
    with pytest.raises(ValueError, match=r"photo.png: has more than 200 pixels: must have fewer"):
        read_photograph(tmp_path / "photo.png")


def test_a_palette_is_read_and_a_text_is_refused(tmp_path):
    Image.new("RGB", (16, 12), (255, 0, 0)).quantize(4).save(tmp_path / "photo.png")
    np.testing.assert_allclose(read_photograph(tmp_path / "photo.png")[0, 0], (1, 0, 0), atol=0.02)
    (tmp_path / "text.png").write_text("no image")
    with pytest.raises(ValueError, match="must be an image"):
        read_photograph(tmp_path / "text.png")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"photograph": np.ones((12, 16))}, "photograph has shape"),
        ({"photograph": np.ones((12, 16, 4))}, "photograph has shape"),
        ({"photograph": np.full((12, 16, 3), 255.0)}, "divide bytes by 255"),
        ({"animal": "honeybe"}, "honeybee"),
        ({"width_deg": 0.0}, "width_deg"),
        ({"width_deg": 170.0}, "width_deg"),
        ({"uv": 2.0}, "uv"),
        ({"animal": "dragonfly", "width_deg": 120.0}, "smaller part of the field"),
    ],
)
def test_invalid_arguments_raise_one_line(change, words):
    with pytest.raises(ValueError, match=words) as error:
        see_photograph(**{"photograph": WHITE, "animal": "honeybee", "width_deg": 60.0, **change})
    assert "\n" not in str(error.value)


def test_all_animals_are_those_of_optics():
    assert set(ANIMALS) | {"cirolana", "goldfish_lens", "COMPOUND"} == set(optics.animals.__all__)


def test_near_edges_are_blurred_by_a_disk():
    """A point at the distance z is blurred to a disk with the angular diameter D/z. At an edge, the blurred light is
    1/2 + (t√(1 - t²) + asin t)/π.
    """
    edge = np.zeros((40, 60, 3))
    edge[:, 30:] = 1
    z, across = 8e-3, 1e-3
    seen = see_photograph(edge, "mouse", 60.0, depth=z).signals[0]
    middle, columns = seen[seen.shape[0] // 2], seen.shape[1]
    tangent = (np.arange(columns) + 0.5 - columns / 2) / columns * 2 * math.tan(math.radians(30))
    t = np.clip(2 * tangent / (across / z), -1, 1)
    expected = 0.5 + (t * np.sqrt(1 - t * t) + np.arcsin(t)) / math.pi
    np.testing.assert_allclose(middle / middle[-8:].mean(), expected, atol=0.03)
    sharp = see_photograph(edge, "mouse", 60.0).signals[0][seen.shape[0] // 2]
    assert np.abs(sharp - expected).max() > 0.1


def test_a_map_of_distances_blurs_its_near_part_only():
    stripes = np.zeros((40, 60, 3))
    stripes[::8] = stripes[1::8] = stripes[2::8] = stripes[3::8] = 1
    depth = np.full((40, 60), math.inf)
    depth[:, :30] = 8e-3
    seen = see_photograph(stripes, "mouse", 60.0, depth=depth).signals[0][8:-8]
    plain = see_photograph(stripes, "mouse", 60.0).signals[0][8:-8]
    near, far = (slice(3, seen.shape[1] // 2 - 6), slice(seen.shape[1] // 2 + 6, -3))
    assert seen[:, near].std() < 0.5 * plain[:, near].std()
    np.testing.assert_allclose(seen[:, far], plain[:, far], atol=0.02)


@pytest.mark.parametrize(
    ("animal", "depth", "words"),
    [
        ("mouse", np.ones((3, 4)), "shape"),
        ("mouse", 0.0, "positive"),
        ("mouse", -1.0, "positive"),
        ("mouse", math.nan, "positive"),
        ("honeybee", 1.0, "all distances"),
    ],
)
def test_invalid_distances_are_refused(animal, depth, words):
    with pytest.raises(ValueError, match=words):
        see_photograph(WHITE, animal, 20.0, depth=depth)


def test_distances_are_read_from_numbers_and_files(tmp_path):
    np.save(tmp_path / "z.npy", np.full((12, 16), 2.5))
    (tmp_path / "bad.npy").write_bytes(b"no array")
    assert read_depth("0.25") == 0.25
    assert read_depth(str(tmp_path / "z.npy")).max() == 2.5
    for text, words in (("near", "distance"), (str(tmp_path / "bad.npy"), "undamaged")):
        with pytest.raises(ValueError, match=words):
            read_depth(text)
