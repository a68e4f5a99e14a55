"""`evolve see` writes an image and an EXR, and refuses invalid input with one line."""

import numpy as np
import pytest
from PIL import Image

from sim import read_exr


@pytest.fixture
def photo(tmp_path):
    Image.new("RGB", (16, 12), (200, 120, 40)).save(tmp_path / "photo.png")
    return tmp_path / "photo.png"


def test_it_writes_an_image_and_the_signals(call, photo, tmp_path):
    out = tmp_path / "there"
    code, said, _ = call("see", photo, "--animal", "mouse", "--width-deg", 20, "--uv", 0, "--out", out)
    assert code == 0
    assert said.splitlines() == [str(out / "photo.mouse.png"), str(out / "photo.mouse.exr")]
    (view,) = read_exr(out / "photo.mouse.exr")
    assert view.receptors.shape[0] == 2
    assert np.asarray(Image.open(out / "photo.mouse.png")).shape[0] == 600


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (["--animal", "mouse"], "--width-deg"),
        (["--width-deg", "20"], "--animal"),
        (["--animal", "mouze", "--width-deg", "20"], "mouse"),
        (["--animal", "mouse", "--width-deg", "200"], "width_deg"),
        (["--animal", "mouse", "--width-deg", "wide"], "width-deg"),
        (["--animal", "mouse", "--width-deg", "20", "--depth", "near"], "depth"),
        (["--animal", "mouse", "--width-deg", "20", "--depth", "missing.npy"], "missing.npy"),
        (["--animal", "honeybee", "--width-deg", "20", "--depth", "1"], "all distances"),
    ],
)
def test_it_refuses_invalid_arguments(call, photo, given, words):
    code, _, error = call("see", photo, *given)
    assert code == 2
    assert words in error
    assert len(error.strip().splitlines()) == 1


def test_it_refuses_files_that_are_no_photographs(call, tmp_path):
    Image.new("L", (16, 12)).save(tmp_path / "grey.png")
    for name, words in (("grey.png", "three channels"), ("missing.png", "No such file")):
        code, _, error = call("see", tmp_path / name, "--animal", "mouse", "--width-deg", 20)
        assert code == 2
        assert words in error
        assert len(error.strip().splitlines()) == 1
