"""Signals of receptors that see a photograph.

The receptors are drawn as hexagons or squares, and their signals can be written to an EXR file.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from optics.numerics.arguments import flag, of_kind, positive, reals, shown, whole
from optics.numerics.read_only import read_only
from sim.exr.files import file_path, write_exr
from sim.exr.previews import preview_of_receptors
from sim.exr.spectral_layout import require_nanometres
from sim.exr.view import View
from sim.scene.color import encode_srgb, srgb_image

__all__ = ["ReceptorMosaic"]

GAP = 12  # choice: pixels between the photograph and the receptors


@dataclass(frozen=True, eq=False)
class ReceptorMosaic:
    """Signals of an animal's receptors for a photograph.

    animal: name of the animal.
    signals: signals (channel, row, column), from the top left of the visual field. A surface that reflects
        all light gives 1.
    peaks_nm: peak wavelength of each channel [nm], (channel,).
    width_deg: angular width of the photograph [degrees].
    hexagons: True for ommatidia. Every second row, beginning with the second, is then shifted to the right by half an
        ommatidium.

    Raises:
        ValueError: an argument has the wrong type or shape, or a number is not finite.
    """

    animal: str
    signals: np.ndarray
    peaks_nm: tuple[float, ...]
    width_deg: float
    hexagons: bool

    def __post_init__(self) -> None:
        of_kind("ReceptorMosaic: animal", self.animal, str, "'mouse'")
        signals = reals("ReceptorMosaic: signals", self.signals)
        if signals.ndim != 3 or not signals.size or not np.isfinite(signals).all():
            raise ValueError(
                f"ReceptorMosaic: signals has shape {signals.shape}: must be finite numbers (channel, row, column)"
            )
        peaks = require_nanometres("ReceptorMosaic: peaks_nm", self.peaks_nm)
        if peaks.shape != signals.shape[:1]:
            raise ValueError(f"ReceptorMosaic: peaks_nm = {shown(self.peaks_nm)}: must be one for each channel")
        positive("ReceptorMosaic: width_deg", self.width_deg, "degrees")
        flag("ReceptorMosaic: hexagons", self.hexagons)
        object.__setattr__(self, "signals", read_only(np.asarray(self.signals)))

    def image(self, photograph: np.ndarray | None = None, height: int = 600) -> np.ndarray:
        """Return an sRGB image (height, x, 3) uint8 of the receptors, to the right of the photograph if it is given.

        Red, green and blue show the receptors with the longest, the middle and the shortest peak wavelengths. A
        single type is shown as grey. Of two types, the one with the shorter peak wavelength is shown as green and blue.

        photograph: sRGB values in [0, 1], (y, x, 3).
        height: height of the image in pixels, 16 to 8192.

        Raises:
            ValueError: the height is not a whole number from 16 to 8192, or the photograph does not have the shape
                (y, x, 3) or contains values outside [0, 1].
        """
        from PIL import Image

        tall = whole("height", height, 16, 8192)
        channels = self.signals[self._shown()]
        linear = preview_of_receptors(channels, [self.peaks_nm[channel] for channel in self._shown()])
        colors = np.rint(255 * encode_srgb(np.clip(linear, 0, 1))).astype(np.uint8)
        drawn = self._hexagons(colors, tall) if self.hexagons else self._squares(colors, tall)
        if photograph is None:
            return drawn
        left = Image.fromarray(np.rint(255 * srgb_image("photograph", photograph)).astype(np.uint8))
        left = left.resize((max(1, round(tall * left.width / left.height)), tall), Image.Resampling.LANCZOS)
        between = np.full((tall, GAP, 3), 255, np.uint8)
        return np.concatenate([np.asarray(left), between, drawn], axis=1)

    def write_png(self, path: str | Path, photograph: np.ndarray | None = None, height: int = 600) -> None:
        """Write the return value of `image` to a PNG file; an existing file is replaced.

        Raises:
            ValueError: see `image`; or `path` is not a path.
            OSError: the file cannot be written.
        """
        from PIL import Image

        Image.fromarray(self.image(photograph, height)).save(file_path("path", path), format="PNG")

    def write_exr(self, path: str | Path) -> None:
        """Write the signals to an OpenEXR file, with one pixel for each receptor; `sim.read_exr` reads it.

        Raises:
            ValueError: `path` is not a path.
            OSError: the file cannot be written.
        """
        notes = {"animal": self.animal, "width_deg": self.width_deg, "odd_rows_shifted": self.hexagons}
        signals = self.signals.astype(np.float32)
        write_exr(path, [View(self.animal, receptors=signals, peaks_nm=self.peaks_nm, attributes=notes)])

    def _shown(self) -> list[int]:
        """Return the channels with the longest, the middle and the shortest peaks; all channels if there are fewer."""
        order = np.argsort(-np.asarray(self.peaks_nm), kind="stable").tolist()
        return order if len(order) < 3 else [order[0], order[len(order) // 2], order[-1]]

    def _squares(self, colors: np.ndarray, height: int) -> np.ndarray:
        width = max(1, round(height * colors.shape[1] / colors.shape[0]))
        row, column = (np.arange(n) * m // n for n, m in zip((height, width), colors.shape[:2], strict=True))
        return colors[np.ix_(row, column)]

    def _hexagons(self, colors: np.ndarray, height: int) -> np.ndarray:
        from PIL import Image, ImageDraw

        rows, columns = colors.shape[:2]
        side = height / (1.5 * rows + 0.5)  # corner to centre; rows are 1.5 sides apart
        apart = math.sqrt(3) * side
        image = Image.new("RGB", (max(1, round((columns + 0.5) * apart)), height))
        draw, turns = ImageDraw.Draw(image), np.radians(30 + 60 * np.arange(6))
        corners = side * np.column_stack([np.cos(turns), np.sin(turns)])
        for row in range(rows):
            for column in range(columns):
                centre = (column + (1.0 if row % 2 else 0.5)) * apart, (1.5 * row + 1) * side
                draw.polygon([tuple(corner + centre) for corner in corners], fill=tuple(colors[row, column].tolist()))
        return np.asarray(image)
