"""Previews of EXR files in plain viewers: daylight is white, and long wavelengths are red."""

import numpy as np
import OpenEXR
import pytest

from optics.spectra.bands import daylight
from sim.exr.files import read_exr, write_exr
from sim.exr.view import View
from sim.scene.color import preview


def test_preview_of_daylight_is_white():
    nm = np.linspace(400, 700, 8)
    radiance = 0.5 * daylight(nm * 1e-9)[:, None, None] * np.ones((8, 2, 3))
    np.testing.assert_allclose(preview(radiance, nm), 0.5, atol=1e-6)
    red = np.where(nm > 600, 1.0, 0.0)[:, None, None] * np.ones((8, 1, 1))
    r, g, b = preview(red, nm)[0, 0]
    assert r > 5 * max(g, b)
    # The order of bands does not matter.
    np.testing.assert_allclose(preview(red[::-1], nm[::-1]), preview(red, nm))


def written_preview(path, view):
    """Return R, G and B of a file with one view of receptors' signals, as a viewer reads them."""
    import OpenEXR

    write_exr(path, [view])
    (part,) = OpenEXR.File(str(path), separate_channels=True).parts
    return [part.channels[name].pixels for name in "RGB"]


def test_the_longest_waves_are_red_whatever_the_channels_order(tmp_path):
    signals, peaks = np.random.default_rng(3).random((3, 4, 6), dtype=np.float32), (350, 440, 530)
    shown = written_preview(tmp_path / "a.exr", View("eye", receptors=signals, peaks_nm=peaks))
    turned = written_preview(tmp_path / "b.exr", View("eye", receptors=signals[::-1], peaks_nm=peaks[::-1]))
    np.testing.assert_array_equal(shown, signals[::-1])
    np.testing.assert_array_equal(turned, shown)
    np.testing.assert_array_equal(written_preview(tmp_path / "c.exr", View("eye", receptors=signals)), signals)
    (back,), (other,) = read_exr(tmp_path / "a.exr"), read_exr(tmp_path / "b.exr")
    np.testing.assert_array_equal(back.receptors, signals)
    np.testing.assert_array_equal(other.receptors, signals[::-1])
    assert list(back.peaks_nm) == list(peaks) == list(other.peaks_nm)[::-1]
    assert read_exr(tmp_path / "c.exr")[0].peaks_nm is None


@pytest.mark.parametrize(("count", "order"), [(1, [0, 0, 0]), (2, [1, 0, 0]), (4, [3, 2, 1])])
def test_more_and_fewer_receptors_are_shown_from_long_to_short(tmp_path, count, order):
    signals = np.random.default_rng(4).random((count, 2, 2), dtype=np.float32)
    view = View("eye", receptors=signals, peaks_nm=np.arange(count) * 50 + 350.0)
    np.testing.assert_array_equal(written_preview(tmp_path / "a.exr", view), signals[order])


@pytest.mark.parametrize(
    ("count", "peaks", "words"),
    [
        (3, (400, 500), r"peaks_nm = \(400, 500\): must be a finite number for each channel"),
        (1, 400, "peaks_nm = 400: must be finite numbers in nanometres"),
        (1, [np.nan], r"peaks_nm = \[nan\]: must be finite numbers in nanometres"),
        (1, "long", "peaks_nm: must be real numbers, not 'long'"),
    ],
)
def test_peaks_that_are_not_the_receptors_are_refused(count, peaks, words):
    with pytest.raises(ValueError, match=f"View 'eye': {words}"):
        View("eye", receptors=np.ones((count, 2, 2)), peaks_nm=peaks)


@pytest.mark.parametrize("wrong", [-1.0, 0.0, np.inf, 550e-9, *(-(10 ** np.random.default_rng(6).uniform(-9, 3, 3)))])
def test_wavelengths_are_nanometres(wrong):
    """Wavelengths in metres round to the same name of a channel. An earlier version therefore stated that wavelengths
    must differ, and it accepted -1.
    """
    says = r"must be finite numbers in nanometres \(550, not 550e-9\)"
    with pytest.raises(ValueError, match=f"View 'eye': wavelengths_nm = .*{says}"):
        View("eye", np.array([wrong, 650e-9]), np.ones((2, 2, 2)))
    with pytest.raises(ValueError, match=f"View 'eye': peaks_nm = .*{says}"):
        View("eye", receptors=np.ones((2, 2, 2)), peaks_nm=(450.0, wrong))


def test_radiance_alone_has_no_peaks():
    with pytest.raises(ValueError, match=r"peaks_nm = \(500,\): must be a finite number for each channel of receptors"):
        View("eye", np.array([500.0]), np.ones((1, 2, 2)), peaks_nm=(500,))


def test_viewers_show_high_pixels_as_high(tmp_path):
    view = View("left", receptors=np.ones((3, 2, 4), np.float32))
    for aspect in (1.0, 0.25):
        write_exr(tmp_path / "eye.exr", [view], pixel_aspect=aspect)
        header = OpenEXR.File(str(tmp_path / "eye.exr")).parts[0].header
        assert header["pixelAspectRatio"] == aspect
        np.testing.assert_array_equal(read_exr(tmp_path / "eye.exr")[0].receptors, view.receptors)
    with pytest.raises(ValueError, match="pixel_aspect = 0: must be greater than 0"):
        write_exr(tmp_path / "eye.exr", [view], pixel_aspect=0)
