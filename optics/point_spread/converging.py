"""Polarised light on its way to a focus, and its field over a window: it can be looked at again."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import cast

import numpy as np

from optics.elements.beam import Beam
from optics.elements.ray_field import RayField
from optics.methods.problem import Problem
from optics.methods.sampling import WithField
from optics.methods.smythe import SCALAR, smythe
from optics.methods.vector_sum import VectorSum
from optics.numerics.accuracy import AccuracyError, Plan
from optics.numerics.autodiff import number
from optics.numerics.grid import Grid
from optics.point_spread.pictures import pictures
from optics.point_spread.request import Request
from optics.point_spread.spot_check import spot_check

__all__ = ["Converging", "VectorFocus"]

PLANE_WAVES = "plane_waves"
MOST_NODES = 300_000  # choice, by memory: of a sum of plane waves, each of which is spread over 81 cells
CHECK_SECONDS = 0.02  # choice: what a sum of plane waves counts for; a check takes a share of it
SINGLE = 1e-4  # choice: tolerance from which on float32 will do


@dataclass(frozen=True, eq=False)
class Converging:
    """Light behind a pupil. jones: of its parts that do not interfere, (part, 2). stokes: of it all, over the first.
    tolerance: relative L2 error of the intensity over a window."""

    beam: Beam
    aplanatic: bool
    jones: np.ndarray
    stokes: tuple[float, float, float, float]
    tolerance: float

    @property
    def image(self) -> tuple[float, float]:
        """Where (x, y) [m] the ray through the pupil's centre lands (Snell's law)."""
        beam = self.beam
        x, y = (math.tan(angle) for angle in beam.source.angle)
        bent = beam.pupil.index_before(beam.wavelength) / beam.index / math.hypot(1, x, y)
        axial = math.sqrt(max(1 - bent**2 * (x * x + y * y), 1e-6))
        return number(beam.distance) * bent * x / axial, number(beam.distance) * bent * y / axial

    @property
    def cutoff(self) -> float:
        """Frequency [1/m] beyond which the intensity has none: light from opposite rims interferes, whose directions
        differ most on the axis."""
        radius, z = self.beam.pupil.radius, number(self.beam.distance)
        sine = radius / z if self.aplanatic else radius / math.hypot(radius, z)
        return 2 * sine * self.beam.index / self.beam.wavelength

    def onto(self, window: Grid) -> VectorFocus:
        """Its field there; the window lies about the image.

        Raises:
            AccuracyError: no method meets the tolerance within the limits on memory and time.
        """
        found, plan = self._aplanatic(window) if self.aplanatic else self._flat(window)
        parts = np.tensordot(self.jones, found[:6].reshape(2, 3, *window.shape), axes=1)
        intensity, pure = (np.abs(parts) ** 2).sum(axis=0), parts[0] if len(parts) == 1 else None
        scalar = np.abs(found[6]) ** 2
        return VectorFocus(intensity, scalar, window.dx, pure, parts, window.centre, self.stokes, plan, self)

    def _aplanatic(self, window: Grid) -> tuple[np.ndarray, Plan]:
        """A sum of plane waves is what such a lens is defined by."""
        rule = VectorSum(self.beam, window, True)
        if (nodes := rule.nodes) > MOST_NODES:
            raise AccuracyError(
                f"the window reaches {window.own_half_diagonal:.3g} m from the image: needs a smaller one"
            )
        z, wavelength = number(self.beam.distance), self.beam.wavelength / self.beam.index
        error = (wavelength * z / (2 * self.beam.pupil.radius**2)) ** 2
        why = "an aplanatic lens is one; (1/2N)² for a Fresnel number N"
        return rule.components(), Plan(PLANE_WAVES, (nodes, 1), "float64", error, why)

    def _flat(self, window: Grid) -> tuple[np.ndarray, Plan]:
        return self._plane_waves(window) or self._exact(window)

    def _plane_waves(self, window: Grid) -> tuple[np.ndarray, Plan] | None:
        """None where they err by more than the tolerance, or nothing tells by how much."""
        rule = VectorSum(self.beam, window)
        if window.own_half_diagonal > number(self.beam.distance) or (nodes := rule.nodes) > MOST_NODES:
            return None
        found = rule.components()
        problem = Problem.of(self.beam, window, self.tolerance, "float64")
        error = spot_check(self.beam, problem, np.abs(found[6].ravel()) ** 2, CHECK_SECONDS)
        if error is None or error > self.tolerance:
            return None
        return found, Plan(PLANE_WAVES, (nodes, 1), "float64", error, "a check against the direct sum finds them right")

    def _exact(self, window: Grid) -> tuple[np.ndarray, Plan]:
        """By Smythe's integral, all fields by the method that does for the scalar one."""
        mask = RayField(self.beam, 0, SCALAR)
        dtype = "float32" if self.tolerance >= SINGLE else "float64"
        beam = replace(self.beam, pupil=mask.pupil)
        made = pictures([Request(beam, Problem.of(beam, window, self.tolerance, dtype), keeps_field=True)])[0]
        sampling, root = cast(WithField, made.sampling), math.sqrt(self.beam.pupil.area)

        def propagated(beam: Beam) -> np.ndarray:
            return sampling.field(beam, made.problem).numpy() / root

        found = np.concatenate([smythe(self.beam, window, propagated), propagated(beam)[None]])
        return found, replace(made.plan, why=f"Smythe's integral; {made.plan.why}")


@dataclass(frozen=True, eq=False)
class VectorFocus:
    """intensity: |Ex|², |Ey|², |Ez|² over the pupil's area, (3, y, x) [1/m²]; what a molecule sees whose dipole lies
    along x, y or z. scalar: what scalar theory says, (y, x). field: Ex, Ey, Ez, (3, y, x), less the carrier e^{ikz};
    None unless the light is fully polarised. parts: fields that do not interfere and together are the light,
    (part, 3, y, x): one, or two. centre: (x, y) [m] of the middle sample. polarization: of the light before the pupil,
    Stokes' parameters over the first. plan: how it was computed, and its predicted error, relative L2 of the intensity
    over the window. towards: by which it can be looked at again; None for a field from elsewhere.
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
        """Of all components, (y, x) [1/m²]."""
        total: np.ndarray = self.intensity.sum(axis=0)
        return total

    @property
    def grid(self) -> Grid:
        """Where the samples lie [m]."""
        height, width = self.scalar.shape
        return Grid((height, width), self.dx, self.centre)

    @property
    def scalar_error(self) -> float:
        """Relative L2 error that scalar theory makes over the window."""
        return float(np.linalg.norm(self.scalar - self.psf) / np.linalg.norm(self.psf))
