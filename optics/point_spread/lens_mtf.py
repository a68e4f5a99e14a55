"""Contrast of a lens through focus, in light of several wavelengths, from exit pupils that another program computed."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from optics.elements.exit_pupil import ExitPupil
from optics.elements.exit_pupils import ExitPupils
from optics.numerics.arguments import in_range, of_kind, reals, shown
from optics.numerics.read_only import ReadOnlyArrays
from optics.point_spread.contrast import mtf
from optics.point_spread.psf import psf

__all__ = ["LensMTF", "lens_mtf"]

# Choice: samples along a side of the first window for a pupil without aberrations, and the half side of the window in
# units of the spot's radius. The MTF enlarges the window if it loses too much light.
SAMPLES, AROUND = 65, 1.2
PITCH = 0.5  # samples per cycle of the highest frequency, which the MTF needs
OF_PSF = 0.1  # choice: part of the tolerance that a PSF may use
MM = 1e-3


@dataclass(frozen=True, eq=False)
class LensMTF(ReadOnlyArrays):
    """Contrasts of a lens in light of several wavelengths together, for each field and position of the image plane.

    fields: points of the field, as in `ExitPupils`.
    shifts: distances [m] by which the image plane is moved along the light, (shift,).
    frequencies: spatial frequencies [1/m] on the image plane, (frequency,).
    tangential: contrast of patterns that vary along the direction from the axis to the image, (field, shift,
        frequency). On the axis, this is the direction y.
    sagittal: contrast of patterns that vary perpendicular to this direction.
    predicted_error: largest predicted error of a contrast, (field, shift).
    """

    fields: tuple[Any, ...]
    shifts: np.ndarray
    frequencies: np.ndarray
    tangential: np.ndarray
    sagittal: np.ndarray
    predicted_error: np.ndarray

    def __repr__(self) -> str:
        size = f"{len(self.fields)} fields, {len(self.shifts)} shifts and {len(self.frequencies)} frequencies"
        return f"<LensMTF of {size}, predicted error {self.predicted_error.max():.1e}>"

    def plot(self, axes: Any, frequency: float | None = None) -> None:
        """Draw the contrasts on Matplotlib axes, with solid tangential and dashed sagittal lines.

        With several positions of the image plane (`shifts`), the lines show contrast as a function of position, at one
        frequency. With one position, they show contrast as a function of frequency.

        frequency: frequency [1/m] of the lines if there are several positions. The nearest one of `frequencies` is
            drawn. None: the middle one.
        """
        through = len(self.shifts) > 1
        middle = self.frequencies[len(self.frequencies) // 2]
        nearest = int(np.abs(self.frequencies - (middle if frequency is None else frequency)).argmin())
        for index, name in enumerate(self.fields):
            for contrasts, style in ((self.tangential[index], "-"), (self.sagittal[index], "--")):
                x, y = (self.shifts / MM, contrasts[:, nearest]) if through else (self.frequencies * MM, contrasts[0])
                label = f"field {name}" if style == "-" else None
                axes.plot(x, y, style, color=f"C{index % 10}", label=label)
        axes.set_xlabel("shift of the image plane [mm]" if through else "frequency [cycles/mm]")
        at = f" at {self.frequencies[nearest] * MM:g} cycles/mm" if through else ""
        axes.set_ylabel(f"contrast{at}")
        axes.set_ylim(0, 1)
        axes.legend(title="solid tangential, dashed sagittal")


def lens_mtf(
    lens: ExitPupils, frequencies: Any, shifts: Any = 0.0, weights: Any = None, tolerance: float = 0.02
) -> LensMTF:
    """Return the contrasts of a lens in light of all its wavelengths together, for positions of the image plane.

    The optical transfer function is the mean Σ w(λ) OTF(λ) over the wavelengths λ, with `weights` w. All PSFs are
    relative to one point of the image plane, so the result includes lateral colour. At frequency 0, the result is the
    fraction of the light within the windows of the PSFs, slightly below 1.

    lens: from `read_exit_pupils`.
    frequencies: spatial frequencies [1/m] on the image plane, a number or (frequency,).
    shifts: distances [m] by which the image plane is moved in the direction of the light, a number or (shift,).
    weights: relative weight of each wavelength, (wavelength,). They are divided by their sum. None: equal weights.
    tolerance: largest error of any contrast, see `optics.mtf`.

    Raises:
        ValueError: an argument is invalid, or a frequency is beyond the cutoff of the lens.
        AccuracyError: see `optics.mtf` and `optics.psf`.
        BackendError: see `optics.mtf` and `optics.psf`.
    """
    of_kind("lens", lens, ExitPupils, "read_exit_pupils(wavefront)")
    in_range("tolerance", tolerance, 1e-4, 0.5)
    f, moves = (np.atleast_1d(reals(name, v)) for name, v in (("frequencies", frequencies), ("shifts", shifts)))
    for name, values in (("frequencies", f), ("shifts", moves)):
        if values.ndim != 1 or not values.size or not np.isfinite(values).all():
            raise ValueError(f"{name} = {shown(values)}: must be a row of finite numbers, at least one")
    parts = np.ones(len(lens.wavelengths)) if weights is None else reals("weights", weights)
    if parts.shape != lens.wavelengths.shape or not (
        (parts >= 0).all() and np.isfinite(parts).all() and parts.sum() > 0
    ):
        raise ValueError(f"weights = {shown(weights)}: must be {lens.wavelengths.size} shares of 0 or more, not all 0")
    parts = parts / parts.sum()
    contrasts = np.empty((2, len(lens.fields), moves.size, f.size))
    errors = np.empty((len(lens.fields), moves.size))
    for field in range(len(lens.fields)):
        x, y = lens.positions[field, len(lens.wavelengths) // 2]
        direction = np.array([x, y]) / np.hypot(x, y) if np.hypot(x, y) > 0 else np.array([0.0, 1.0])
        across = np.array([direction[1], -direction[0]])
        along = np.concatenate([np.outer(direction, f), np.outer(across, f)], axis=1)
        for index, shift in enumerate(moves):
            found, errors[field, index] = _otf(lens.at(field, float(shift)), lens.wavelengths, parts, along, tolerance)
            contrasts[:, field, index] = np.abs(found).reshape(2, -1)
    return LensMTF(lens.fields, moves, f, contrasts[0], contrasts[1], errors)


def _otf(
    pupils: tuple[ExitPupil, ...], wavelengths: np.ndarray, parts: np.ndarray, f: np.ndarray, tolerance: float
) -> tuple[np.ndarray, float]:
    """Return Σ parts · OTF at frequencies f (2, n) [1/m], complex (n,), and the predicted error of the sum.

    pupils, parts: exit pupil and weight for each wavelength.

    Raises:
        ValueError: a frequency is beyond the cutoff of the lens.
        AccuracyError: see `lens_mtf`.
    """
    total, error, highest = np.zeros(f.shape[1], complex), 0.0, float(np.hypot(*f).max())
    for pupil, wavelength, part in zip(pupils, wavelengths, parts, strict=True):
        if part == 0:
            continue
        sine = pupil.pupil.radius / np.hypot(pupil.pupil.radius, pupil.distance)
        cutoff = 2 * sine * pupil.pupil.index_behind(float(wavelength)) / wavelength
        if highest > cutoff:
            raise ValueError(
                f"frequencies: {highest:.4g} per metre is beyond the cutoff of the lens at {wavelength:g} m, "
                f"{cutoff:.4g} per metre"
            )
        side = SAMPLES + 2 * math.ceil(AROUND * pupil.spot_radius * cutoff / PITCH)
        window = {"dx": PITCH / cutoff, "shape": (side, side)}
        seen = psf(pupil.pupil, [float(wavelength)], pupil.distance, tolerance=OF_PSF * tolerance, **window)
        transfer = mtf(seen, tolerance=tolerance)
        total += part * transfer.otf(*f)[0]
        error += part * float(transfer.predicted_error[0])
    return total, error
