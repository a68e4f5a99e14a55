"""Signals of eyes as images for human viewers: receptors as squares, receptor types as colours."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from optics import Eye
from optics.spectra.receptors import Receptors
from sim.scene.color import encode_srgb

# Largest size (height, width) of the image of all eyes [pixels]. Only an image with one pixel per receptor may be
# larger.
SIZE = (240, 960)
GAP = 4  # pixels between eyes
BETWEEN = 200  # grey level of the gaps


def side_by_side(signals: np.ndarray, eye: Eye) -> np.ndarray:
    """Return an sRGB image (y, x, 3) uint8 of all eyes' signals (eye, channel, h, w), from left to right.

    White in full daylight is shown as white, for any size of the pupil. Receptor types are shown as colours in the
    order of their peak wavelengths: the type with the longest wavelength as red, the type with the shortest as blue,
    and other types as colours in between. A single type is shown as grey. In a mosaic, every receptor has the colour of
    its type. Receptors of different sizes (`optics.Eye(density=...)`) are drawn with their places and sizes on the
    retina.
    """
    linear = np.einsum("ecyx,cyxk->eyxk", signals / eye.white_signal, _palette(eye))
    pixels = np.rint(255 * encode_srgb(np.clip(linear, 0, 1))).astype(np.uint8)
    n, height, width = pixels.shape[:3]
    scale = max(1, min(SIZE[0] // height, (SIZE[1] - GAP * (n - 1)) // (n * width)))
    if eye.lattice is None:
        large = pixels.repeat(scale, axis=1).repeat(scale, axis=2)
    else:
        seen = eye.lattice.receptors_at((height * scale, width * scale))
        large = pixels.reshape(n, height * width, 3)[:, seen]
    gap = np.full((height * scale, GAP, 3), BETWEEN, np.uint8)
    return np.concatenate([part for image in large for part in (gap, image)][1:], axis=1)


def one_above_another(pictures: Sequence[np.ndarray]) -> np.ndarray:
    """Return images (y, x, 3) stacked vertically with grey gaps; grey also fills the space beside narrower images."""
    width = max(picture.shape[1] for picture in pictures)
    rows = [np.pad(p, ((GAP, 0), (0, width - p.shape[1]), (0, 0)), constant_values=BETWEEN) for p in pictures]
    return np.concatenate(rows)[GAP:]


def _palette(eye: Eye) -> np.ndarray:
    """Return the linear sRGB colour in which each signal of an eye is shown if its receptor sees white.

    If the receptor receives less light than from white, the colour is darker in proportion to the signal. The result is
    an array (channel, row, column, 3).
    """
    height, width = eye.resolution
    if eye.mosaic is not None:
        return hues_of(eye.receptors)[eye.mosaic][None]
    shares = shares_of(hues_of(eye.receptors))
    return np.broadcast_to(shares[:, None, None], (len(shares), height, width, 3))


def hues_of(receptors: Receptors) -> np.ndarray:
    """Return the colour of each type (type, 3), from red through green to blue by decreasing peak wavelength.

    A single type is white.
    """
    types = receptors.types
    if len(types) == 1:
        return np.ones((1, 3))
    rank = np.argsort(np.argsort([-kind.peak_nm for kind in types], kind="stable"))
    at = rank / (len(types) - 1)
    return np.stack([np.maximum(1 - 2 * at, 0), 1 - np.abs(2 * at - 1), np.maximum(2 * at - 1, 0)], axis=1)


def shares_of(hues: np.ndarray) -> np.ndarray:
    """Return the share of each receptor type in the red, green and blue of a pixel, (type, 3).

    The shares in each primary add up to 1, so equal signals of all types give white. If no type's colour contains a
    primary, all types contribute equally to this primary.

    hues: linear colour in which each receptor type is shown, (type, 3)
    """
    sums = hues.sum(axis=0)
    return np.divide(hues, sums, out=np.full(hues.shape, 1 / len(hues)), where=sums > 0)
