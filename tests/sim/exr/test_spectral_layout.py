"""EXR files of other programs in the spectral layout of Fichet, Pacanowski and Wilkie (2021), as radiance or
reflectance.

Files are written with OpenEXR alone. The names of their channels follow the paper's pattern: the quantity, a number
with a comma, a prefix, and a unit of length or frequency.
"""

import warnings
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

import optics
import sim
from optics.spectra.spectrum import daylight
from sim.exr.files import ExrError, read_exr, write_exr
from sim.exr.spectral_layout import ExrWarning
from sim.exr.view import View

C = 299_792_458.0
SPELLINGS = (
    lambda nm: f"{nm:.6f}nm",
    lambda nm: f"{nm:g}nm",
    lambda nm: f"{nm / 1e3:.9f}um",
    lambda nm: f"{nm / 1e3:.9e}um",
    lambda nm: f"{nm * 1e3:.3f}pm",
    lambda nm: f"{nm * 1e-9:.12e}m",
    lambda nm: f"{C / nm * 1e-3:.9f}THz",
    lambda nm: f"{C / nm * 1e9:.12E}Hz",
)


def write(path, *parts, **attributes):
    """Write parts (name, channels by name) with OpenEXR."""
    header = {"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION, **attributes}
    OpenEXR.File([OpenEXR.Part(dict(header), dict(channels), name) for name, channels in parts]).write(str(path))


def planes(names, image):
    return {name: np.ascontiguousarray(plane) for name, plane in zip(names, image, strict=True)}


def test_files_of_the_layouts_authors_are_read():
    """colour-science contains files of the layout's authors: daylight, and Ohta's (1997) chart of 24 colours, both in
    16-bit floats (2⁻¹¹).
    """
    import colour

    files = Path(colour.__file__).parent / "io" / "tests" / "resources"
    (light,), (chart,) = read_exr(files / "D65.exr"), read_exr(files / "Ohta1997.exr")
    nm = light.wavelengths_nm
    assert (nm[0], nm[-1], len(nm)) == (300, 780, 97)
    np.testing.assert_allclose(light.radiance[:, 0, 0], 100 * daylight(nm * 1e-9), rtol=6e-4)
    assert chart.reflectance.shape == (16, 4, 6)
    for patch, table in enumerate(colour.SDS_COLOURCHECKERS["ColorChecker N Ohta"].values()):
        found = chart.reflectance[:, patch // 6, patch % 6]
        np.testing.assert_allclose(found, np.interp(chart.wavelengths_nm, table.wavelengths, table.values), rtol=6e-4)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("quantity", "label"), [("S0", "radiance"), ("T", "reflectance"), ("M00", "reflectance")])
def test_spectra_of_other_programs_are_read(tmp_path, quantity, label, seed):
    """Wavelengths ascend, whatever the order and spelling of the channels; numbers have nine digits or more."""
    rng = np.random.default_rng(seed)
    nm = np.sort(rng.choice(np.arange(300, 1100), 7, replace=False)) + 0.25
    image = rng.random((7, 4, 5)).astype(rng.choice([np.float32, np.float16]))
    names = [f"{quantity}.{rng.choice(SPELLINGS)(x).replace('.', rng.choice([',', '.']))}" for x in nm]
    order = rng.permutation(7)
    write(tmp_path / "chart.exr", ("", planes(np.array(names)[order], image[order])), spectralLayoutVersion="1.0")
    (view,) = read_exr(tmp_path / "chart.exr")
    assert view.name == "chart"
    np.testing.assert_allclose(view.wavelengths_nm, nm, rtol=1e-8)
    found, other = getattr(view, label), {"radiance", "reflectance"} - {label}
    assert found.dtype == np.float32
    np.testing.assert_array_equal(found, image.astype(np.float32))
    assert getattr(view, *other) is None
    assert view.receptors is None


def test_light_and_surfaces_of_one_file(tmp_path):
    """A file may contain both radiance and reflectance, in the same part or in separate parts."""
    rng = np.random.default_rng(5)
    light, surface = rng.random((2, 3, 2, 4), dtype=np.float32)
    glow, matt = ([f"{quantity}.{nm},0nm" for nm in (450, 550, 650)] for quantity in ("S0", "T"))
    preview = planes("RGB", rng.random((3, 2, 4), dtype=np.float32))
    both = planes(glow, light) | planes(matt, surface) | preview
    write(tmp_path / "a.exr", ("", both), emissiveUnits="W.m^-2.sr^-1", EV="0.5", gain=2.0)
    (view,) = read_exr(tmp_path / "a.exr")
    np.testing.assert_array_equal(view.radiance, light)
    np.testing.assert_array_equal(view.reflectance, surface)
    np.testing.assert_array_equal(view.rgb, np.moveaxis(np.array(list(preview.values())), 0, -1))
    assert view.attributes == {"emissiveUnits": "W.m^-2.sr^-1", "EV": "0.5", "gain": 2.0}

    write(tmp_path / "b.exr", ("lamp", planes(glow, light)), ("wall", planes(matt, surface)))
    lamp, wall = read_exr(tmp_path / "b.exr")
    assert (lamp.name, wall.name) == ("lamp", "wall")
    np.testing.assert_array_equal(lamp.radiance, light)
    np.testing.assert_array_equal(wall.reflectance, surface)


def test_what_is_not_read_is_named(tmp_path):
    plane = np.ones((2, 3), np.float32)
    names = [f"S{k}.500nm" for k in range(4)] + ["T.500nm", "M01.500nm", "T.400,0nm.500,0nm"]
    write(tmp_path / "a.exr", ("scene", dict.fromkeys(names, plane)), ("depth", {"Z": plane}))
    with pytest.warns(ExrWarning) as caught:
        (view,) = read_exr(tmp_path / "a.exr")
    assert [str(warning.message) for warning in caught] == [
        "not read: channels M01, S1, S2, S3, reradiation T of part 'scene'",
        "not read: part 'depth', without spectral channels",
    ]
    assert view.radiance.shape == view.reflectance.shape == (1, 2, 3)


PLANE = np.ones((2, 3), np.float32)
REFUSED = {
    "RGB": ({"R": PLANE, "G": PLANE, "B": PLANE}, "part 'RGB' was not written by rhabdom and has no spectral channels"),
    "twice": ({"S0.500nm": PLANE, "S0.0,5um": PLANE}, "two channels of radiance at 500 nm"),
    "unequal": ({"S0.500nm": PLANE, "T.510nm": PLANE}, "radiance and reflectance at different wavelengths"),
    "no number": ({"S0.nm": PLANE, "T.,m": PLANE}, "no spectral channels"),
    "a layer": ({"left.S0.500nm": PLANE}, "no spectral channels"),
    "no frequency": ({"S0.0Hz": PLANE}, "ZeroDivisionError"),
    "infinite": ({"S0.1E999nm": PLANE}, "finite"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_files_without_a_spectrum_are_refused_in_one_line(tmp_path, case):
    channels, words = REFUSED[case]
    write(tmp_path / "a.exr", (case, channels))
    with pytest.raises(ExrError, match=words) as caught:
        read_exr(tmp_path / "a.exr")
    assert str(caught.value).startswith(f"{tmp_path / 'a.exr'}: ")
    assert "\n" not in str(caught.value)


def test_truncated_files_of_others_are_refused(tmp_path):
    """Their pixels do not compress, so that each cut removes some."""
    image = np.random.default_rng(6).random((3, 40, 50), dtype=np.float32)
    write(tmp_path / "a.exr", ("", planes([f"S0.{nm}nm" for nm in (400, 500, 600)], image)))
    whole = (tmp_path / "a.exr").read_bytes()
    for length in (0, 4, 200, len(whole) // 3, len(whole) // 2, len(whole) - 1):
        (tmp_path / "cut.exr").write_bytes(whole[:length])
        with pytest.raises(ExrError, match=r"cut\.exr: "):
            read_exr(tmp_path / "cut.exr")


def test_reflectance_round_trip(tmp_path):
    """A view of reflectance is written in the same layout, and its preview shows it in daylight."""
    rng, nm = np.random.default_rng(7), np.array([650.0, 450.0, 550.0])
    radiance, reflectance = rng.random((2, 3, 4, 2), dtype=np.float32)
    views = [View("wall", nm, reflectance=reflectance), View("lit", nm, radiance, reflectance=reflectance)]
    write_exr(tmp_path / "a.exr", views)
    wall, lit = read_exr(tmp_path / "a.exr")
    for back, view in ((wall, views[0]), (lit, views[1])):
        np.testing.assert_array_equal(back.reflectance, view.reflectance)
        np.testing.assert_array_equal(back.wavelengths_nm, nm)
    assert wall.radiance is None
    np.testing.assert_array_equal(lit.radiance, radiance)
    sunlit = View("sunlit", nm, reflectance * daylight(nm * 1e-9)[:, None, None].astype(np.float32))
    write_exr(tmp_path / "b.exr", [sunlit])
    np.testing.assert_allclose(wall.rgb, read_exr(tmp_path / "b.exr")[0].rgb, atol=1e-6)
    parts = OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True).parts
    assert {name for name in parts[0].channels if name.startswith("T.")} == {f"T.{x:.0f},000000nm" for x in nm}
    assert "emissiveUnits" not in parts[0].header


def test_reflectance_must_match():
    with pytest.raises(ValueError, match=r"reflectance has shape .*: must have the shape of the radiance"):
        View("a", [500.0], np.ones((1, 2, 2)), reflectance=np.ones((1, 2, 3)))
    with pytest.raises(ValueError, match="one distinct wavelength per band"):
        View("a", [500.0, 600.0], reflectance=np.ones((1, 2, 2)))


def test_an_eye_sees_a_chart_of_others(tmp_path):
    """A chart with the reflectance 0.5 in daylight gives half the signals of white."""
    eye = optics.Eye(resolution=(2, 3), fov_deg=20)
    nm = np.arange(380, 781, 20)
    chart = np.full((len(nm), 2, 3), 0.5, np.float32)
    write(tmp_path / "chart.exr", ("", planes([f"T.{x},000000nm" for x in nm], chart)))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        (view,) = sim.read_exr(tmp_path / "chart.exr")
    at, light = eye.spectral_bands.wavelengths * 1e9, eye.in_bands(optics.illuminant("D65"))
    scene = np.apply_along_axis(lambda row: np.interp(at, view.wavelengths_nm, row), 0, view.reflectance)
    seen, white = (eye.see(scale * light[:, None, None], 1) for scale in (scene, np.ones_like(scene)))
    np.testing.assert_allclose(seen, 0.5 * white, rtol=1e-6)
