"""Preview of a `View`, the image of one eye: linear sRGB (y, x, 3), for EXR viewers that show only R, G and B."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from optics.spectra.spectrum import LIMITS_NM, daylight
from sim.scene.color import preview


def preview_of_spectra(radiance: np.ndarray | None, reflectance: np.ndarray | None, nm: np.ndarray) -> np.ndarray:
    """Return an image (y, x, 3) of the radiance or, without radiance, of the reflectance in daylight.

    radiance, reflectance: (band, y, x); at least one of them is not None
    nm: wavelengths of the bands [nm], (band,)
    """
    if radiance is not None:
        return preview(radiance, nm)
    assert reflectance is not None
    return preview(reflectance * daylight(np.clip(nm, *LIMITS_NM) * 1e-9)[:, None, None], nm)


def preview_of_receptors(receptors: np.ndarray, peaks_nm: Sequence[float] | np.ndarray | None) -> np.ndarray:
    """Return an image (y, x, 3) with the three channels of longest wavelength as its red, green and blue.

    Red is the channel of longest wavelength. A single channel is shown as grey. Of two channels, the second is shown as
    green and blue.

    receptors: signals, (channel, y, x)
    peaks_nm: wavelength of each channel's maximum [nm]; None: the channels are used in the given order
    """
    count = len(receptors)
    order = np.arange(count) if peaks_nm is None else np.argsort(-np.asarray(peaks_nm, float), kind="stable")
    return np.moveaxis(np.asarray(receptors)[order[np.minimum(range(3), count - 1)]], 0, -1)
