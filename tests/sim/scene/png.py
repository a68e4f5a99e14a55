"""Small PNG files with and without a colour chunk, as bytes."""

import struct
import zlib

import numpy as np

KINDS = {1: 0, 2: 4, 3: 2, 4: 6}  # colour type by number of channels: grey, grey and alpha, RGB, RGBA


def png(pixels, bits=8, is_tagged=False):
    """Return a PNG (PNG specification, third edition, sections 5 and 11).

    pixels: (height, width, channel) uint8
    bits: 8 or 16 per channel
    is_tagged: True for a file with an sRGB chunk
    """
    height, width, channels = pixels.shape
    values = (pixels.astype(">u2") * 257).astype(">u2") if bits == 16 else pixels
    rows = b"".join(b"\0" + np.ascontiguousarray(row).tobytes() for row in values)
    header = struct.pack(">IIBBBBB", width, height, bits, KINDS[channels], 0, 0, 0)
    chunks = [(b"IHDR", header), *([(b"sRGB", b"\0")] if is_tagged else []), (b"IDAT", zlib.compress(rows))]
    packed = b"".join(_chunk(*chunk) for chunk in [*chunks, (b"IEND", b"")])
    return b"\x89PNG\r\n\x1a\n" + packed


def flat(color, side=8, **kind):
    """Return a PNG of a single colour, (channel,)."""
    return png(np.full((side, side, len(color)), color, np.uint8), **kind)


def _chunk(name, content):
    return struct.pack(">I", len(content)) + name + content + struct.pack(">I", zlib.crc32(name + content))
