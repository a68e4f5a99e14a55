"""Polarised light behind a pupil, and the electric field of this light on samples around its image (a window).

The field can be recomputed over other windows.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import cast

import numpy as np

from optics.elements.beam import Beam
from optics.elements.ray_field import SCALAR, RayField, Weights
from optics.methods.method_sampling import WithField
from optics.methods.problem import Problem
from optics.methods.smythe import ALONG_X, smythe
from optics.methods.vector_sum import VectorSum
from optics.numerics.accuracy import AccuracyError, Plan, above
from optics.numerics.autodiff import number
from optics.numerics.field import Field
from optics.numerics.grid import Grid
from optics.numerics.read_only import ReadOnlyArrays, read_only
from optics.point_spread.pictures import PSFPicture, pictures
from optics.point_spread.request import Request
from optics.point_spread.spot_check import spot_check
from optics.point_spread.window_cost import check_window

__all__ = ["Converging", "VectorFocus"]

PLANE_WAVES = "plane_waves"
MOST_NODES = 400_000  # choice, limited by memory: number of plane waves in a sum; each is spread over 81 cells
SUM_ERROR = 1e-8  # error of a sum of plane waves
CHECK_SECONDS = 0.5  # choice: assumed time of a field [s]; a check may take a third of it
MOST_SECONDS, FIELDS = 60.0, 7  # choice: time limit [s], and the number of fields that share it
FIELD_ARRAYS = 4 * FIELDS  # arrays of real numbers: real and imaginary part of each field, and as many temporary arrays
FINER = 4.0  # choice: factor between the first and the second tolerance
SINGLE = 1e-4  # choice: smallest tolerance for which float32 is sufficient


@dataclass(frozen=True, eq=False)
class Converging(ReadOnlyArrays):
    """Light behind a pupil.

    beam: source and wavelength of the light, the pupil, and the distance to the plane of the image.
    aplanatic: True for a corrected objective, see `vector_focus`.
    jones: Jones vectors of the parts of the light that do not interfere with each other, (part, 2).
    stokes: Stokes parameters (S0, S1, S2, S3) of all light, divided by S0.
    tolerance: relative L2 error of the intensity over a window.
    """

    beam: Beam
    aplanatic: bool
    jones: np.ndarray
    stokes: tuple[float, float, float, float]
    tolerance: float

    @property
    def image(self) -> tuple[float, float]:
        """Point (x, y) [m] where the ray through the pupil's centre lands (Snell's law)."""
        beam = self.beam
        x, y = (math.tan(angle) for angle in beam.source.angle)
        bent = beam.pupil.index_before(beam.wavelength) / beam.index / math.hypot(1, x, y)
        axial = math.sqrt(max(1 - bent**2 * (x * x + y * y), 1e-6))
        return number(beam.distance) * bent * x / axial, number(beam.distance) * bent * y / axial

    @property
    def cutoff(self) -> float:
        """Highest frequency [1/m] of the intensity.

        It results from interference between two rays from opposite sides of the pupil's rim. The directions of these
        rays differ most if they meet on the axis.
        """
        radius, z = self.beam.pupil.radius, number(self.beam.distance)
        sine = radius / z if self.aplanatic else radius / math.hypot(radius, z)
        return 2 * sine * self.beam.index / self.beam.wavelength

    def onto(self, window: Grid) -> VectorFocus:
        """Return the field over a window around the image.

        Raises:
            AccuracyError: no method meets the tolerance within the limits on memory and time.
        """
        check_window(window, "float64", arrays=FIELD_ARRAYS)
        found, plan = self._aplanatic(window) if self.aplanatic else self._plane_waves(window) or self._exact(window)
        parts = np.tensordot(self.jones, found[:6].reshape(2, 3, *window.shape), axes=1)
        intensity, pure = (np.abs(parts) ** 2).sum(axis=0), parts[0] if len(parts) == 1 else None
        scalar = np.abs(found[6]) ** 2
        return VectorFocus(intensity, scalar, window.dx, pure, parts, window.centre, self.stokes, plan, self)

    def _aplanatic(self, window: Grid) -> tuple[np.ndarray, Plan]:
        """Return the field behind an aplanatic lens. This field is defined as a sum of plane waves.

        Raises:
            AccuracyError: the window is too wide, or the tolerance too small.
        """
        rule = VectorSum(self.beam, window, True)
        if (nodes := rule.nodes) > MOST_NODES:
            far = f"{window.own_half_diagonal:.3g} m from the image"
            raise AccuracyError(f"the window reaches {far}: must be smaller for an aplanatic lens")
        if self.tolerance < SUM_ERROR:
            raise AccuracyError(f"tolerance = {self.tolerance:g}: must be at least {SUM_ERROR:g} for an aplanatic lens")
        why = "an aplanatic lens is defined by this sum"
        return rule.components(), Plan(PLANE_WAVES, (nodes, 1), "float64", SUM_ERROR, why)

    def _plane_waves(self, window: Grid) -> tuple[np.ndarray, Plan] | None:
        """Return the field as a sum of plane waves, or None if the sum is unsuitable.

        The result is None if the error of the sum exceeds the tolerance or is unknown, or if the window is too large.
        """
        rule = VectorSum(self.beam, window)
        if window.own_half_diagonal > number(self.beam.distance) or (nodes := rule.nodes) > MOST_NODES:
            return None
        found = rule.components()
        problem = Problem.from_beam(self._behind(SCALAR), window, self.tolerance, "float64")
        error = self._errors(problem, {SCALAR: found[6], ALONG_X: found[0]})
        if error is None or (error := error + self._crossed(found[6], window)) > self.tolerance:
            return None
        return found, Plan(PLANE_WAVES, (nodes, 1), "float64", error, "confirmed by a check against the direct sum")

    def _crossed(self, scalar: np.ndarray, window: Grid) -> float:
        """Return the error of two contributions: from light polarised along y to Ex, and from light along x to Ey.

        A check with light of a single plane of polarisation does not detect this error. It results from an
        approximation: the second derivatives of the path from a point of the pupil to a point of the window are taken
        to be the same for all points of the pupil. A bent ray's electric field is rotated with the ray. Only light
        whose field is thereby rotated from x to y, or from y to x, contributes. The fraction of this light is estimated
        as sin²θ / 2, with the angle θ between the axis and the steepest ray.

        scalar: scalar field over the window, (y, x).
        """
        z, bright = number(self.beam.distance), np.abs(scalar) ** 2
        off = np.add.outer((window.y - self.image[1]) ** 2, (window.x - self.image[0]) ** 2)
        reach = self.beam.pupil.radius + math.hypot(*self.image)
        squared = reach**2 / (reach**2 + z**2)
        bend = math.pi * self.beam.index / self.beam.wavelength * squared / z
        return bend * math.sqrt(float((bright * off**2).sum() / bright.sum())) * squared / 2

    def _exact(self, window: Grid) -> tuple[np.ndarray, Plan]:
        """Return the field from Smythe's integral. All components use the samples that suit the scalar field.

        If a check shows that other components need more samples, all are computed again with a smaller tolerance.

        Raises:
            AccuracyError: the check also fails for the smaller tolerance, or no method meets this tolerance.
        """
        for tolerance in (self.tolerance, self.tolerance / FINER):
            found, plan = self._smythe(window, tolerance)
            if plan.predicted_error <= self.tolerance:
                return found, plan
        error = above(plan.predicted_error, self.tolerance)
        raise AccuracyError(f"tolerance = {self.tolerance:g}: a check finds an error of {error} in Ex")

    def _smythe(self, window: Grid, tolerance: float) -> tuple[np.ndarray, Plan]:
        """Return the field from Smythe's integral, on samples of the pupil that meet the tolerance for scalar light."""
        made = self._scalar(window, "float32" if tolerance >= SINGLE else "float64", tolerance)
        sampling, root = cast(WithField, made.sampling), math.sqrt(self.beam.pupil.area)

        def propagated(beam: Beam) -> np.ndarray:
            return sampling.field(beam, made.problem).numpy() / root

        scalar = cast(Field, made.field).numpy()
        found = np.concatenate([smythe(self.beam, window, propagated), scalar[None]])
        checked = self._errors(made.problem, {ALONG_X: found[0]})
        error = max(made.plan.predicted_error, checked or 0.0)
        why, seconds = f"Smythe's integral; {made.plan.why}", FIELDS * made.plan.seconds
        return found, replace(made.plan, predicted_error=error, why=why, seconds=seconds, scalar_error=0.0)

    def _scalar(self, window: Grid, dtype: str, tolerance: float) -> PSFPicture:
        """Return the scalar field over the window, the plan of its computation, and the samples of the pupil used.

        The field is checked at some points against a more accurate sum over the pupil. It is computed in float64 if
        float32 is not sufficient.
        """
        beam = self._behind(SCALAR)
        problem = Problem.from_beam(beam, window, tolerance, dtype)
        try:
            return pictures([Request(beam, problem, most_seconds=MOST_SECONDS / FIELDS, keeps_field=True)])[0]
        except AccuracyError:
            if dtype == "float64":
                raise
            return self._scalar(window, "float64", tolerance)

    def _behind(self, weights: Weights) -> Beam:
        return replace(self.beam, pupil=RayField(self.beam, 0, weights).pupil)

    def _errors(self, problem: Problem, fields: dict[Weights, np.ndarray]) -> float | None:
        """Return the largest relative error of several fields.

        The fields are compared at some points with the direct sum over the pupil. The result is None if the comparison
        would take too long.

        fields: the fields to be checked, (y, x). The key of a field contains weights that define a mask of the pupil,
            see `RayField`. The field is compared with the direct sum for light through the pupil with this mask.
        """
        errors = [
            spot_check(self._behind(weights), problem, np.abs(field.ravel()) ** 2, CHECK_SECONDS)
            for weights, field in fields.items()
        ]
        return None if None in errors else max(error for error in errors if error is not None)


@dataclass(frozen=True, eq=False)
class VectorFocus(ReadOnlyArrays):
    """The electric field around an image.

    intensity: |Ex|², |Ey|², |Ez|² divided by the pupil's area [1/m²], (3, y, x). These are the excitations of molecules
        with a dipole along x, y or z.
    scalar: the PSF of scalar theory [1/m²], (y, x).
    dx: pitch [m] of the samples.
    field: Ex, Ey, Ez [1/m] without the carrier e^{ikz}, (3, y, x). Their squared moduli are `intensity`. None unless
        the light is fully polarised.
    parts: one or two fields Ex, Ey, Ez [1/m] that do not interfere with each other, (part, 3, y, x). Their squared
        moduli add up to `intensity`.
    centre: (x, y) [m] of sample n//2.
    polarization: Stokes parameters (S0, S1, S2, S3) of the light in front of the pupil, divided by S0.
    plan: method and predicted error, the relative L2 error of the intensity over the window.
    towards: the light that converges towards the image. From this light, the field can be computed again over other
        windows. None if `vector_focus` did not compute the field.
    """

    intensity: np.ndarray
    scalar: np.ndarray
    dx: float
    field: np.ndarray | None
    parts: np.ndarray
    centre: tuple[float, float]
    polarization: tuple[float, float, float, float]
    plan: Plan
    towards: Converging | None = None

    def __repr__(self) -> str:
        height, width = self.scalar.shape
        return (
            f"<VectorFocus {height} x {width} samples {self.dx:.3g} m apart, "
            f"predicted error {self.plan.predicted_error:.1e}, scalar error {self.scalar_error:.1e}>"
        )

    @cached_property
    def psf(self) -> np.ndarray:
        """Sum of the intensities of the three components, (y, x) [1/m²]."""
        return read_only(self.intensity.sum(axis=0))

    @property
    def grid(self) -> Grid:
        """Positions of the samples [m]."""
        height, width = self.scalar.shape
        return Grid((height, width), self.dx, self.centre)

    @property
    def scalar_error(self) -> float:
        """Relative L2 error of scalar theory over the window."""
        return float(np.linalg.norm(self.scalar - self.psf) / np.linalg.norm(self.psf))
