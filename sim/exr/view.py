"""Image that one eye sees: spectral radiance or reflectance, and signals of receptors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from optics.numerics.arguments import of_kind, shown
from optics.numerics.number_types import full_precision
from sim.exr.spectral_layout import channel, require_nanometres
from sim.eyes.compound_eye import CompoundEye


@dataclass(frozen=True)
class View:
    """Image that one eye sees.

    name: name of the eye, such as "left"
    wavelengths_nm: wavelengths of the bands of radiance and reflectance [nm], (band,)
    radiance: spectral radiance, (band, y, x) float32, or None. A white Lambertian surface that faces daylight has the
        radiance of CIE D65, which is 1 at 560 nm.
    receptors: signals of receptors, (channel, y, x) float32, or None; y and x may differ from those of the radiance
    rgb: linear sRGB preview of the radiance, or of the reflectance in daylight, (y, x, 3) float32; None: `write_exr`
        computes it. This preview is ignored if there is neither radiance nor reflectance.
    attributes: further values, such as seed, time step or position, by name; JSON must be able to represent the values
    peaks_nm: peak wavelength of each receptor channel [nm], (channel,); the preview shows the channel with the longest
        peak as red. None: channels are in descending order of their peaks.
    reflectance: reflectance or transmittance, (band, y, x) float32, or None
    directions: viewing directions of the receptors, unit vectors (ahead, left, up) in the frame of the mount, (3, y, x)
        float32, or None

    Raises:
        ValueError: the name is empty or not printable; there is no radiance, reflectance or receptors; an array has the
            wrong shape or half precision; or wavelengths or peaks are not finite, not in nanometres, or not one for
            each band or channel. The wavelengths must also be distinct.
    """

    name: str
    wavelengths_nm: np.ndarray = field(default_factory=lambda: np.empty(0))
    radiance: np.ndarray | None = None
    receptors: np.ndarray | None = None
    rgb: np.ndarray | None = None
    attributes: Mapping[str, Any] = field(default_factory=dict)
    peaks_nm: Sequence[float] | np.ndarray | None = None
    reflectance: np.ndarray | None = None
    directions: np.ndarray | None = None

    @classmethod
    def from_ommatidia(cls, name: str, eye: CompoundEye, frame: np.ndarray, **others: Any) -> View:
        """Return the view of a compound eye: signals and direction of each ommatidium, as a single row of pixels.

        frame: signals of one mount at one moment, (ommatidium, channel), see `CompoundEye.as_frames`
        others: further fields of the view, except for `receptors`, `peaks_nm` and `directions`

        Raises:
            ValueError: `eye` is not a compound eye, the frame has another shape, or a field of the view is invalid.
        """
        of_kind("eye", eye, CompoundEye, "sim.CompoundEye([[0, 0]], ommatidium)")
        if _shape(frame) != (len(eye), eye.channels):
            raise ValueError(
                f"frame {_kind(frame)}: must be an array (ommatidium, channel), {(len(eye), eye.channels)}"
            )
        peaks = [kind.peak_nm for kind in eye.receptors.types] if eye.types is None else None
        signals, ways = (np.asarray(values, np.float32).T[:, None] for values in (frame, eye.directions))
        return cls(name, receptors=signals, peaks_nm=peaks, directions=ways, **others)

    def __post_init__(self) -> None:
        where = f"View {shown(self.name)}"
        if not isinstance(self.name, str) or not self.name or not self.name.isprintable():
            raise ValueError(f"{where}: its name must be printable text, and not empty")
        if self.spectral is None and self.receptors is None:
            raise ValueError(f"{where}: has neither radiance nor receptors, and no reflectance")
        for label in ("radiance", "reflectance", "receptors", "directions", "rgb"):
            image = full_precision(f"{where}: {label}", getattr(self, label))
            object.__setattr__(self, label, image)
            if label != "rgb" and image is not None and (len(_shape(image)) != 3 or 0 in image.shape):
                raise ValueError(f"{where}: {label} {_kind(image)}: must be an array (band, y, x)")
        require_nanometres(f"{where}: wavelengths_nm", self.wavelengths_nm)
        if (spectral := self.spectral) is not None:
            names = {channel(nm) for nm in self.wavelengths_nm}
            if len(spectral) != len(self.wavelengths_nm) or len(names) != len(spectral):
                raise ValueError(f"{where}: needs one distinct wavelength per band of {spectral.shape}")
            if self.rgb is not None and _shape(self.rgb) != (*spectral.shape[1:], 3):
                raise ValueError(f"{where}: rgb {_kind(self.rgb)}: must be an array (y, x, 3) like the radiance")
            if self.reflectance is not None and self.reflectance.shape != spectral.shape:
                raise ValueError(f"{where}: reflectance {_kind(self.reflectance)}: must have the shape of the radiance")
        if self.directions is not None:
            seen = None if self.receptors is None else (3, *self.receptors.shape[1:])
            if self.directions.shape != seen:
                raise ValueError(
                    f"{where}: directions {_kind(self.directions)}: must be an array {seen}, for receptors"
                )
        if self.peaks_nm is not None:
            peaks = require_nanometres(f"{where}: peaks_nm", self.peaks_nm)
            if self.receptors is None or peaks.shape != (len(self.receptors),):
                what = "must be a finite number for each channel of receptors"
                raise ValueError(f"{where}: peaks_nm = {shown(self.peaks_nm)}: {what}")

    @property
    def spectral(self) -> np.ndarray | None:
        """The radiance if there is any, otherwise the reflectance; None if both are missing."""
        return self.reflectance if self.radiance is None else self.radiance


def _shape(image: Any) -> tuple[int, ...]:
    """Return the shape of an array of any library; () for other objects."""
    return tuple(getattr(image, "shape", ()))


def _kind(image: Any) -> str:
    """Return words for an error message: the shape of an array, or the value of an object that is no array."""
    return f"has shape {_shape(image)}" if hasattr(image, "shape") else f"is {shown(image)}"
