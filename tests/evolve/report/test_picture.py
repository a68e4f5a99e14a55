"""Signals as images: sRGB, PNG for other programs, sheets of frames."""

import numpy as np

from evolve.report.picture import data_uri, display, film_sheet, png
from tests.evolve.report.reported import picture


def test_display_is_srgb():
    signals = np.array([-1.0, 0.0, 0.002, 0.2140411, 0.5, 1.0, 2.0]).reshape(1, 1, 7).repeat(3, axis=0)
    assert display(signals)[0, :, 0].tolist() == [0, 0, 7, 127, 188, 255, 255]  # table values of IEC 61966-2-1
    assert display(signals[:1])[0, :, 2].tolist() == display(signals)[0, :, 0].tolist()
    assert display(0.25 * signals, gain=4.0).tolist() == display(signals).tolist()


def test_display_keeps_channels_and_rows_apart():
    signals = np.zeros((3, 2, 2))
    signals[0, 0, 1] = signals[2, 1, 0] = 1.0
    pixels = display(signals)
    assert pixels[0, 1].tolist() == [255, 0, 0]
    assert pixels[1, 0].tolist() == [0, 0, 255]
    assert pixels.sum() == 510


def test_png_reads_back():
    pixels = np.random.default_rng(0).integers(0, 256, (5, 7, 3)).astype(np.uint8)
    np.testing.assert_array_equal(picture(data_uri(pixels)), pixels)
    assert png(pixels) == png(pixels.copy())


def test_sheets_break_into_rows():
    frames = np.random.default_rng(0).integers(0, 256, (5, 3, 2, 600, 3)).astype(np.uint8)
    sheet, columns = film_sheet(frames)
    assert columns == 2
    assert sheet.shape == (6, 3600, 3)
    np.testing.assert_array_equal(sheet[2:4, 1800 + 600 : 1800 + 1200], frames[3, 1])
