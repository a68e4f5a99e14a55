"""Images of a star by different pupils: white light, in colour

python -m experiments.stars [--out FILE]
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import optics
from experiments.page import new_figure, save
from optics.spectra.bands import daylight
from sim.scene.color import encode_srgb, preview

__all__ = ["picture", "pupils"]

RADIUS, DISTANCE = 30e-6, 241.4e-6
WAVELENGTHS = np.linspace(420e-9, 670e-9, 11)
SIDE, DX, NEAR_DX = 161, 0.5e-6, 0.2e-6  # NEAR_DX: sample distance for focused light
DECADES = 3.0


def pupils() -> dict[str, optics.Pupil]:
    """Return pupils by name; the first four spread the light, the others focus it."""
    lens = {"thin_lens_focal_length": DISTANCE}
    curvature = 1 / (0.5 * DISTANCE)
    glass = optics.RefractiveIndex.from_abbe(1.5, 20)
    bent = optics.BSplineRelief.paraboloid(0.0, curvature, RADIUS).control_points
    rough = np.random.default_rng(3).standard_normal((4, 4))
    return {
        "round aperture": optics.Pupil(RADIUS),
        "hexagonal aperture": optics.Pupil(RADIUS, aperture=optics.Polygon.regular(6)),
        "slit": optics.Pupil(RADIUS, aperture=optics.Slit(0.5, 1.9)),
        "rough glass": optics.Pupil(RADIUS, optics.BSplineRelief(4e-6 * rough), n=1.5),
        "lens": optics.Pupil(RADIUS, **lens),
        "lens behind a triangle": optics.Pupil(RADIUS, aperture=optics.Polygon.regular(3, 90.0), **lens),
        "lens behind a ring": optics.Pupil(RADIUS, aperture=optics.Annulus(0.8), **lens),
        "lens with coma": optics.Pupil(RADIUS, optics.BSplineRelief(bent + coma()), n=glass),
    }


def coma() -> NDArray[np.float64]:
    """Return control points [m] of a relief proportional to y (x² + y²), minus the tilt that shifts the image."""
    place = np.arange(4) - 1.5
    square = place[:, None] ** 2 + place[None, :] ** 2
    return 4e-6 * place[:, None] * (square - 2.0)


def picture(pupil: optics.Pupil, dx: float = DX) -> NDArray[np.float64]:
    """Return the image of a white star on the sensor as sRGB in [0, 1], (y, x, 3), with logarithmic brightness."""
    psf = optics.psf(pupil, WAVELENGTHS.tolist(), DISTANCE, dx=dx, shape=(SIDE, SIDE), tolerance=1e-2).psf
    linear = np.maximum(preview(psf * daylight(WAVELENGTHS)[:, None, None], WAVELENGTHS * 1e9), 0.0)
    brightness = linear.max(axis=-1, keepdims=True)
    level = 1 + np.log10(np.maximum(brightness / brightness.max(), 10.0**-DECADES)) / DECADES
    return np.asarray(encode_srgb(linear / np.maximum(brightness, 1e-300) * level**1.5))


def main(arguments: Sequence[str] | None = None) -> int:
    """Draw the images of all pupils."""
    options = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    options.add_argument("--out", type=Path, default=Path("docs/images/stars.png"), help="file to draw into")
    out = options.parse_args(arguments).out
    figure, axes = new_figure(10, 5.4, columns=4, rows=2)
    for number, (place, (name, pupil)) in enumerate(zip(axes.flat, pupils().items(), strict=True)):
        place.imshow(picture(pupil, DX if number < 4 else NEAR_DX), interpolation="bilinear", origin="lower")
        place.set_axis_off()
        place.set_title(name, fontsize=10)
    save(figure, out)
    print(f"picture: {out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
