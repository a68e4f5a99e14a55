"""Integrals of light over a round receptor, computed as weighted sums over samples, and their errors.

The weights are chosen so that a sum over samples equals the integral over a disk with a sharp edge.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from optics.apertures.circular import disk_table
from optics.apertures.soft_edge import SoftEdge
from optics.numerics.accuracy import AccuracyError
from optics.numerics.arguments import point_2d, positive, shown, without_derivative
from optics.numerics.grid import Grid
from optics.numerics.precision import padded_for_packets, precision
from optics.point_spread.converging import Converging, VectorFocus

__all__ = ["DiskSum"]

RIPPLE = 1e-5  # choice: ripple of a disk's spectrum
SUM_ERROR = 0.1  # choice: largest error of a sum in units of the ripple; see test_microvilli.py
FINE = 1 / 3  # choice: coarsest pitch in units of 1/cutoff; with a finer pitch, sums need less area beyond a disk
MOST_AGAIN = 1025  # choice: most samples along a side of a recomputed window


@dataclass(frozen=True, eq=False)
class DiskSum:
    """Light on a disk, as a weighted sum over samples.

    light: the field on samples that are fine enough for a weighted sum to equal the integral over the disk.
    share: weight of each sample, (y, x).
    radius: radius [m] of the disk.
    """

    light: VectorFocus
    share: np.ndarray
    radius: float

    @classmethod
    def over(cls, light: VectorFocus, radius: float, centre: tuple[float, float] | None = None) -> DiskSum:
        """Return the light and the weights of its samples whose weighted sum is the integral over a disk.

        The weights are the disk, convolved with a kernel. The kernel's spectrum is 1 at all frequencies that the
        intensity contains, and 0 at the frequencies that samples cannot distinguish from these (aliases), see
        `optics.encircled_energy`. If samples are too coarse, or too few around the disk, the light is recomputed on
        other samples.

        centre: centre (x, y) [m] of the disk, within the window of the light. None: `light.centre`.

        Raises:
            ValueError: the disk extends beyond the window.
            AccuracyError: suitable samples cannot be computed, or `light` is not from `vector_focus`. If too many
                samples are needed, the message states the pitch and the number of samples that would suffice.
        """
        positive("radius", without_derivative("radius", radius))
        middle = light.centre if centre is None else point_2d("centre", centre)
        room = _room(light, middle)
        if room < 0:
            raise ValueError(f"centre = {shown(centre)}: must lie within the window, around {shown(light.centre)} m")
        if radius > room * (1 + 1e-9):
            raise ValueError(f"radius = {radius:.3g} m: must end within the window, {room:.3g} m from its centre")
        towards = light.towards
        if towards is None:
            raise AccuracyError("light is not from vector_focus: the required distance of its samples is unknown")
        seen = _around(light, towards, middle, radius)
        x, y = seen.grid.x - middle[0], seen.grid.y - middle[1]
        distance, kernel, unit = np.hypot(x[None, :], y[:, None]), _kernel(seen.dx, towards.cutoff), towards.cutoff
        types = precision("float64")
        at = types.Float64(padded_for_packets(distance * unit))
        share = disk_table(kernel, radius * unit).at(at, types).numpy().reshape(distance.shape)
        return cls(seen, share, radius)

    def integrate(self, picture: np.ndarray) -> tuple[float, float]:
        """Return the integral over the disk of an intensity (y, x) [1/m²], and its error.

        picture: intensity of the light or of a part of it.
        """
        found = float((picture * self.share).sum()) * self.light.dx**2
        bright = min(math.pi * self.radius**2 * float(self.light.psf.max()), 1.0)
        return found, self.light_error + SUM_ERROR * RIPPLE * bright

    @property
    def light_error(self) -> float:
        """Upper bound on the error of an integral over the disk that results from the light's predicted error.

        The bound follows from the Cauchy-Schwarz inequality.
        """
        norms = float(np.linalg.norm(self.light.psf) * np.linalg.norm(self.share))
        return self.light.plan.predicted_error * norms * self.light.dx**2


def _room(light: VectorFocus, middle: tuple[float, float]) -> float:
    """Return the distance [m] from a point to the nearest edge of the samples, negative if the point lies outside."""
    x, y = light.grid.x - middle[0], light.grid.y - middle[1]
    return float(min(-x[0], x[-1], -y[0], y[-1]))


def _kernel(dx: float, cutoff: float) -> SoftEdge:
    """Return a kernel in units of 1/cutoff that passes the intensity's frequencies and blocks their aliases."""
    return SoftEdge(1.0, 1 / (dx * cutoff) - 1, RIPPLE)


def _around(light: VectorFocus, towards: Converging, middle: tuple[float, float], radius: float) -> VectorFocus:
    """Return light on samples that are suitable for a weighted sum that equals the integral over a disk.

    The pitch of these samples is at most FINE/cutoff, where the cutoff is the highest frequency of the intensity. The
    samples extend beyond the disk by the radius of the kernel that softens the disk's edge, because the weights are
    nonzero up to there. If the given light has other samples, it is computed again.

    light: the light on its present samples.
    towards: the light behind the pupil, from which `light` can be computed again.
    middle: centre (x, y) [m] of the disk.

    Raises:
        AccuracyError: too many samples are needed, or they cannot be computed.
    """
    pitch, cutoff = FINE / towards.cutoff, towards.cutoff
    if light.dx <= pitch and radius + _kernel(light.dx, cutoff).reach / cutoff <= _room(light, middle):
        return light
    wide = radius + _kernel(pitch, cutoff).reach / cutoff
    (cx, cy), (x, y) = towards.image, middle
    height, width = (2 * math.ceil((abs(off) + wide) / pitch) + 1 for off in (y - cy, x - cx))
    if max(height, width) > MOST_AGAIN:
        raise AccuracyError(
            f"radius = {radius:.3g} m: needs more than {MOST_AGAIN} samples along a side: use a smaller receptor, or "
            f"vector_focus with dx={pitch:.3g}, shape=({height}, {width})"
        )
    return towards.onto(Grid((height, width), pitch, towards.image))
