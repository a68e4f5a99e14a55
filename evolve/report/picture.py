"""Conversion of signals to images: sRGB encoding, PNG files, and sheets that contain many frames."""

from __future__ import annotations

import base64
import struct
import zlib

import numpy as np
from numpy.typing import NDArray

__all__ = ["data_uri", "display", "film_sheet", "png"]

SHEET_WIDTH = 4096  # maximum width of a sheet in pixels, which every browser can decode


def display(signals: NDArray[np.floating], gain: float = 1.0) -> NDArray[np.uint8]:
    """Return signals (..., channel, y, x) as sRGB pixels (..., y, x, 3).

    The first three channels are used as linear red, green and blue. If there are fewer, their mean is shown as grey.
    After multiplication by `gain`, the signal 1 is white, and values outside [0, 1] are clipped. The encoding follows
    IEC 61966-2-1:1999.

    gain: factor by which signals are multiplied
    """
    linear = np.moveaxis(np.asarray(signals, dtype=np.float64), -3, -1)
    linear = linear[..., :3] if linear.shape[-1] >= 3 else linear.mean(axis=-1, keepdims=True).repeat(3, axis=-1)
    linear = np.clip(gain * linear, 0.0, 1.0)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return np.rint(255 * encoded).astype(np.uint8)


def png(pixels: NDArray[np.uint8]) -> bytes:
    """Return the contents of an 8-bit RGB PNG file with the pixels (y, x, 3).

    With the same version of zlib, the same pixels give the same bytes. Source: PNG specification, 3rd ed., sections 5
    and 11.
    """
    height, width, _ = pixels.shape
    rows = np.concatenate([np.zeros((height, 1), np.uint8), pixels.reshape(height, 3 * width)], axis=1)
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(rows.tobytes(), 9)), (b"IEND", b""))
    body = b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data)) for kind, data in chunks
    )
    return b"\x89PNG\r\n\x1a\n" + body


def data_uri(pixels: NDArray[np.uint8]) -> str:
    """Return pixels (y, x, 3) as a data URI that contains a PNG, for an attribute `src`."""
    return "data:image/png;base64," + base64.b64encode(png(pixels)).decode("ascii")


def film_sheet(frames: NDArray[np.uint8]) -> tuple[NDArray[np.uint8], int]:
    """Return two values: a sheet that contains all frames, and the number of frames in each row of the sheet.

    A frame contains all eyes side by side. The frames fill the sheet row by row. The sheet is an array (y, x, 3).

    frames: pixels of the frames, (time, eye, y, x, 3)
    """
    time, eyes, height, width, _ = frames.shape
    columns = max(1, min(time, SHEET_WIDTH // (eyes * width)))
    rows = -(-time // columns)
    padded = np.zeros((rows * columns, eyes, height, width, 3), np.uint8)
    padded[:time] = frames
    grid = padded.reshape(rows, columns, eyes, height, width, 3).transpose(0, 3, 1, 2, 4, 5)
    return grid.reshape(rows * height, columns * eyes * width, 3), columns
