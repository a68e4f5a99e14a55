"""EXR files: values survive writing and reading, other programs can read the files, and damage is always reported."""

import json
import os
import shutil
import subprocess
import sys
import tracemalloc
from importlib.metadata import PackageNotFoundError, version

import numpy as np
import pytest

from sim.exr.files import ExrError, _digest, read_exr, write_exr
from sim.exr.view import View

NM = np.array([410.0, 450.125, 1640 / 3, 690.0])


def views(seed=0):
    rng = np.random.default_rng(seed)
    left = rng.random((4, 7, 5), dtype=np.float32)
    left[0, 0, 0], left[1, 2, 3], left[2, 0, 1] = np.inf, -0.0, 1e-40
    return [
        View(
            "left", NM, left, rng.random((3, 4, 6), dtype=np.float32), attributes={"seed": 2**63, "t": 0.1, "a": [1, 2]}
        ),
        View("right", NM, rng.random((4, 7, 5), dtype=np.float32), rgb=rng.random((7, 5, 3), dtype=np.float32)),
        View("signals", receptors=rng.random((1, 2, 9), dtype=np.float32)),
    ]


def same_bits(a, b):
    return (a is None) == (b is None) and (a is None or (a.dtype == b.dtype and a.tobytes() == b.tobytes()))


def test_round_trip_is_bit_exact(tmp_path):
    written = views()
    write_exr(tmp_path / "a.exr", written)
    got = {view.name: view for view in read_exr(tmp_path / "a.exr")}
    assert list(got) == ["left", "right", "signals"]
    for view in written:
        back = got[view.name]
        assert same_bits(view.radiance, back.radiance)
        assert same_bits(view.receptors, back.receptors)
        assert np.array_equal(view.wavelengths_nm, back.wavelengths_nm)
        assert back.attributes == view.attributes
    assert same_bits(got["right"].rgb, written[1].rgb)
    assert [p.name for p in tmp_path.iterdir()] == ["a.exr"]


@pytest.mark.parametrize("turn", [lambda a: np.asfortranarray(a), lambda a: a[:, ::-1, ::2]])
def test_non_contiguous_arrays_are_written_right(tmp_path, turn):
    """OpenEXR itself writes such arrays incorrectly without an error."""
    image = turn(np.random.default_rng(1).random((4, 8, 6), dtype=np.float32))
    assert not image[0].flags.c_contiguous
    write_exr(tmp_path / "a.exr", [View("left", NM, image, image)])
    (back,) = read_exr(tmp_path / "a.exr")
    assert np.array_equal(back.radiance, image)
    assert np.array_equal(back.receptors, image)


def test_parts_and_channels_have_the_names_of_the_layout(tmp_path):
    import OpenEXR

    write_exr(tmp_path / "a.exr", views())
    parts = OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True).parts
    assert [p.name() for p in parts] == ["left.spectral", "right.spectral", "left.receptors", "signals.receptors"]
    header = parts[0].header
    assert header["spectralLayoutVersion"] == "1.0"
    assert header["radianceScale"].startswith("relative: a white Lambertian")
    assert "emissiveUnits" not in header  # a relative radiance has no unit
    assert header["compression"] == OpenEXR.ZIP_COMPRESSION
    assert set(parts[0].channels) == {
        "S0.410,000000nm", "S0.450,125000nm", "S0.546,666667nm", "S0.690,000000nm", "R", "G", "B"
    }  # fmt: skip
    assert all(c.pixels.dtype == np.float32 for p in parts for c in p.channels.values())


READ_BY_COLOUR = """
import numpy as np
from colour import read_spectral_image_Fichet2021
components, about = read_spectral_image_Fichet2021("a.exr", additional_data=True)
wavelengths, values = components["S0"]
np.savez("read.npz", wavelengths=wavelengths, values=values, is_emissive=about.is_emissive)
"""


def test_colour_reads_the_spectral_layout(tmp_path):
    """colour-science reads the first part of a file: the first eye's radiance."""
    try:
        version("openimageio")
    except PackageNotFoundError:
        pytest.skip("openimageio is not installed")
    written = views()
    write_exr(tmp_path / "a.exr", written)
    child = subprocess.run(
        [sys.executable, "-c", READ_BY_COLOUR], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert child.returncode == 0, child.stderr
    read = np.load(tmp_path / "read.npz")
    wavelengths, values = read["wavelengths"], read["values"]
    assert read["is_emissive"]
    np.testing.assert_allclose(wavelengths, NM, atol=1e-6)
    assert np.array_equal(values, np.moveaxis(written[0].radiance, 0, -1))


def test_exrheader_lists_the_parts(tmp_path):
    if shutil.which("exrheader") is None:
        pytest.skip("exrheader (Debian: openexr) is not installed")
    write_exr(tmp_path / "a.exr", views())
    text = subprocess.run(["exrheader", tmp_path / "a.exr"], capture_output=True, text=True, check=True).stdout
    assert "left.receptors" in text
    assert "S0.450,125000nm, 32-bit floating-point" in text


def test_a_truncated_file_raises_one_clear_error(tmp_path):
    write_exr(tmp_path / "a.exr", views())
    whole = (tmp_path / "a.exr").read_bytes()
    cut = tmp_path / "cut.exr"
    for length in [0, 3, 100, *range(200, len(whole), 97), len(whole) - 1]:
        cut.write_bytes(whole[:length])
        with pytest.raises(ExrError, match=r"cut\.exr: ") as caught:
            read_exr(cut)
        assert "\n" not in str(caught.value)


def test_flipped_bits_never_pass_for_data(tmp_path):
    """Each flip is either reported or harmless (in a byte without data of ours)."""
    write_exr(tmp_path / "a.exr", views())
    whole = (tmp_path / "a.exr").read_bytes()
    rng, flipped, reported = np.random.default_rng(2), tmp_path / "flipped.exr", 0
    for position in rng.integers(8, len(whole), 150):
        damaged = bytearray(whole)
        damaged[position] ^= 1 << rng.integers(8)
        flipped.write_bytes(damaged)
        try:
            got = {view.name: view for view in read_exr(flipped)}
        except ExrError:
            reported += 1
            continue
        for view in views():
            assert same_bits(view.radiance, got[view.name].radiance)
            assert same_bits(view.receptors, got[view.name].receptors)
            assert view.attributes == got[view.name].attributes
    assert reported > 100  # nearly all bytes of the file are protected data


def test_foreign_and_missing_files(tmp_path):
    (tmp_path / "text.exr").write_text("no image")
    with pytest.raises(ExrError, match="no readable OpenEXR"):
        read_exr(tmp_path / "text.exr")
    with pytest.raises(FileNotFoundError, match="no such file"):
        read_exr(tmp_path / "none.exr")


FORGED = {
    "no attributes": ("left.spectral", {"wavelengths_nm": [500.0]}),
    "attributes of a list": ("left.spectral", {"attributes": [], "wavelengths_nm": [500.0]}),
    "a list": ("left.spectral", []),
    "null": ("left.spectral", None),
    "no wavelengths": ("left.spectral", {"attributes": {}}),
    "wavelengths of text": ("left.spectral", {"attributes": {}, "wavelengths_nm": "500"}),
    "other wavelengths": ("left.spectral", {"attributes": {}, "wavelengths_nm": [510.0]}),
    "wavelengths of null": ("left.spectral", {"attributes": {}, "wavelengths_nm": [None]}),
    "infinite wavelengths": ("left.spectral", {"attributes": {}, "wavelengths_nm": [float("inf")]}),
    "nested wavelengths": ("left.spectral", {"attributes": {}, "wavelengths_nm": [[500.0]]}),
    "no wavelength": ("left.spectral", {"attributes": {}, "wavelengths_nm": []}),
    "no receptors": ("left.receptors", {"attributes": {}}),
    "no name": (".spectral", {"attributes": {}, "wavelengths_nm": [500.0]}),
    "another kind": ("left.thermal", {"attributes": {}, "wavelengths_nm": [500.0]}),
    "10**400": ("left.spectral", {"attributes": {}, "wavelengths_nm": [10**400]}),
}


@pytest.mark.parametrize("forgery", FORGED)
def test_forged_metadata_with_the_right_hash_raises_the_same_error(tmp_path, forgery):
    import OpenEXR

    name, held = FORGED[forgery]
    plane = np.ones((2, 3), np.float32)
    channels = {key: plane.copy() for key in ("R", "G", "B", "S0.500,000000nm")}
    attributes = {"rhabdom": json.dumps(held), "parts": "1"}
    attributes["sha256"] = _digest(name, channels, attributes)
    header = {"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION, **attributes}
    OpenEXR.File([OpenEXR.Part(header, channels, name)]).write(str(tmp_path / "a.exr"))
    with pytest.raises(ExrError, match=r"a\.exr: ") as error:
        read_exr(tmp_path / "a.exr")
    assert "\n" not in str(error.value)


def test_a_bomb_is_refused_before_it_is_unpacked(tmp_path):
    import OpenEXR

    channels = {key: np.zeros((2000, 4000), np.float32) for key in ("R", "G", "B", "receptor_0")}
    header = {"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION}
    OpenEXR.File([OpenEXR.Part(header, channels, "left.receptors")]).write(str(tmp_path / "bomb.exr"))
    assert (tmp_path / "bomb.exr").stat().st_size < 10**6
    tracemalloc.start()
    with pytest.raises(ExrError, match=r"unpacks to 128,000,000 bytes: must be at most most_bytes = 10,000,000"):
        read_exr(tmp_path / "bomb.exr", most_bytes=10**7)
    assert tracemalloc.get_traced_memory()[1] < 10**7
    tracemalloc.stop()
    with pytest.raises(ExrError, match="was not written by rhabdom"):
        read_exr(tmp_path / "bomb.exr")


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ({"name": ""}, "name"),
        ({}, "neither"),
        ({"radiance": np.ones((2, 3, 3))}, "wavelength"),
        ({"radiance": np.ones((2, 3, 3)), "wavelengths_nm": np.array([500.0, 500.0])}, "distinct"),
        ({"receptors": np.ones((3, 3))}, "receptors has shape"),
    ],
)
def test_bad_views_are_refused(arguments, named):
    with pytest.raises(ValueError, match=named):
        View(**{"name": "left", **arguments})


def test_a_name_twice_is_refused(tmp_path):
    view = views()[1]
    with pytest.raises(ValueError, match="no name twice"):
        write_exr(tmp_path / "a.exr", [view, view])


def test_a_file_whose_last_parts_were_taken_away_is_not_whole(tmp_path):
    """The remaining parts are intact; only their number shows that parts are missing."""
    import OpenEXR

    write_exr(tmp_path / "a.exr", views())
    parts = OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True).parts
    kept = [
        OpenEXR.Part(dict(part.header), {name: channel.pixels for name, channel in part.channels.items()}, part.name())
        for part in parts[:-1]
    ]
    OpenEXR.File(kept).write(str(tmp_path / "fewer.exr"))
    with pytest.raises(ExrError, match=r"fewer\.exr: parts are missing \(3 of 4\)"):
        read_exr(tmp_path / "fewer.exr")


def test_names_need_not_be_text(tmp_path):
    """A file's name consists of bytes on Linux, and OpenEXR accepts only UTF-8."""
    path = tmp_path / os.fsdecode(b"bad\xffname.exr")
    write_exr(path, views())
    assert [view.name for view in read_exr(path)] == ["left", "right", "signals"]
    path.write_bytes(path.read_bytes()[:-50])
    with pytest.raises(ExrError, match=r"truncated|no readable|damaged"):
        read_exr(path)
