"""A PSF over a window. It can be recomputed over other windows if a result needs finer or wider samples.

A pupil of radius R illuminates a point of the sensor, at the distance z, with rays whose sines differ by at most
2R/√(R² + z²). The highest frequency of the intensity is therefore f_c = 2R/(λ√(R² + z²)), with the wavelength λ behind
the pupil. A relief in the pupil does not change f_c. The spectrum of samples at the pitch dx repeats every 1/dx. Sums
over samples are therefore correct if dx < 1/f_c (about λz/2R), and all contrasts are correct if dx <= 1/(2 f_c).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from optics.elements.pupil import Pupil
from optics.methods.problem import Problem
from optics.methods.window_sampling import WindowSampling
from optics.numerics.accuracy import AccuracyError, Plan
from optics.numerics.arguments import reals, shown, whole
from optics.numerics.autodiff import Array, Scalar, number, to_user
from optics.numerics.grid import Grid, OnWindow
from optics.numerics.precision import precision
from optics.numerics.read_only import ReadOnlyArrays, read_only
from optics.numerics.renamed import renamed
from optics.point_spread.mixture import mixed
from optics.point_spread.pictures import pictures
from optics.point_spread.planner import APPROXIMATE
from optics.point_spread.request import Request

__all__ = ["PSFResult", "spread"]

MOST_AGAIN = 2049  # choice: largest number of samples along a side of a recomputed window
MANY = 8  # choice: smallest number of wavelengths for which planning each separately would take longer than computing
MOST_SECONDS = 20.0  # choice: time limit for a recomputed window [s]
# Choice: relative error of sums over a PSF, of values at points or of means over cells, divided by that of the PSF. See
# test_measure_bounds.py.
SUM_ERROR, CELL_SUM_ERROR = 1.0, 3.0
OF_CELLS = ("pinhole", "geometric", "perfect_lens")  # methods whose samples are means over cells


@dataclass(frozen=True, eq=False)
class PSFResult(ReadOnlyArrays, OnWindow):
    """A PSF on samples dx [m] apart. Sample [rows//2, columns//2] is at `centre` (x, y) [m]; y increases with the row.

    tensor: the PSF as a Dr.Jit tensor (wavelength, y, x) that carries the derivatives of the parameters.
    psf: the same as a NumPy array [1/m²]. Its integral over an unbounded plane is the fraction of the pupil's power
        that arrives there; evanescent light, for example, does not. The PSF is never renormalised.
    plans: one plan per wavelength; `plan` is the least accurate one.
    requests: parameters with which functions such as `optics.strehl_ratio` recompute the PSF on other samples, one
        entry per wavelength, also in a mean over wavelengths (see `mean`). Empty if these parameters are unknown.
    shares: weight of each request in a mean over wavelengths, (request,). None if the PSF is no such mean.
    field_parts: real and imaginary part of the complex amplitude, as Dr.Jit tensors (wavelength, y, x) with
        derivatives; None for means, and unless `psf` was called with field=True. The amplitude [1/m] has the carrier
        exp(ikz), and its squared modulus is the PSF. `field` is the same as one complex NumPy array.
    for_window: True if the samples of the pupil suffice only for the light in the window. Sums over dark parts of the
        PSF may then be less accurate than predicted, so functions that sum it use finer samples if possible.
    """

    tensor: Array
    dx: float
    wavelengths: np.ndarray
    sensor_distance: Scalar
    pupil: Pupil
    plans: tuple[Plan, ...]
    centre: tuple[float, float] = (0.0, 0.0)
    requests: tuple[Request, ...] = ()
    shares: np.ndarray | None = None
    field_parts: tuple[Array, Array] | None = None
    for_window: bool = False

    @cached_property
    def field(self) -> np.ndarray | None:
        if self.field_parts is None:
            return None
        re, im = (np.asarray(part.numpy()) for part in self.field_parts)
        return read_only(re + 1j * im)

    def __repr__(self) -> str:
        """Return a short description. It omits `requests`, which contain large arrays."""
        count, height, width = self.tensor.shape
        planes = f"{count} wavelength{'s' * (count > 1)}, {height} x {width} samples {self.dx:.3g} m apart"
        return f"<PSFResult {planes}, predicted error {self.plan.predicted_error:.1e}>"

    @cached_property
    def psf(self) -> np.ndarray:
        return read_only(self.tensor if isinstance(self.tensor, np.ndarray) else np.asarray(self.tensor.numpy()))

    @property
    def plan(self) -> Plan:
        return max(self.plans, key=lambda plan: plan.predicted_error)

    @property
    def window(self) -> Grid:
        return Grid(self.tensor.shape[1:], self.dx, self.centre)

    @property
    def power(self) -> np.ndarray | Array:
        """Fraction of the pupil's power inside the window, which ends dx/2 beyond its outermost samples, (wavelength,).

        It is a sum over samples. If these are too far apart for the sum, the PSF is recomputed at a smaller pitch.

        Raises:
            AccuracyError: samples are too coarse and cannot be recomputed. The message states sufficient samples.
        """
        return self._resolved.window_sums

    @property
    def power_error(self) -> np.ndarray:
        """Predicted error of `power`, (wavelength,). Exceptions are those of `power`.

        It includes the error of the PSF. If samples are values at points, it also includes half of the power of the
        outermost samples, because the sum of such samples does not define exactly where the window ends.
        """
        seen = self._resolved
        image = seen.psf.astype(np.float64)
        total, inner = (part.sum(axis=(1, 2)) * seen.dx**2 for part in (image, image[:, 1:-1, 1:-1]))
        found: np.ndarray = seen.sum_error + (0.0 if seen.holds_cells else (total - inner) / 2)
        return found

    @property
    def cutoff(self) -> np.ndarray:
        """Highest frequency [1/m] of the intensity, 2 NA/λ with the pupil's numerical aperture NA, (wavelength,)."""
        radius, distance = self.pupil.radius, number(self.sensor_distance)
        index = np.array([self.pupil.index_behind(float(wavelength)) for wavelength in self.wavelengths])
        found: np.ndarray = 2 * radius / math.hypot(radius, distance) * index / self.wavelengths
        return found

    @property
    def holds_cells(self) -> bool:
        """True if each sample is the mean over a square (cell) of side dx; False if it is the value at a point."""
        return all(plan.method in OF_CELLS for plan in self.plans)

    @property
    def window_sums(self) -> np.ndarray | Array:
        """Sum of the PSF's samples times dx², (wavelength,). It differs from `power` if dx is too coarse."""
        import drjit as dr

        waves, flat = self.tensor.shape[0], self.psf.reshape(len(self.psf), -1)
        if isinstance(self.tensor, np.ndarray) or not dr.grad_enabled(self.tensor):
            return flat.sum(axis=1, dtype=np.float64) * self.dx**2
        types = precision("float64")
        sums = dr.block_reduce(dr.ReduceOp.Add, types.Float(dr.ravel(self.tensor)), flat.shape[1]) * self.dx**2
        return to_user(types.Tensor(sums, (waves,)))

    @property
    def sum_error(self) -> np.ndarray:
        """Error of `window_sums` (fraction of the pupil's power) due to the PSF's predicted error, (wavelength,)."""
        errors = [plan.predicted_error for plan in self.plans]
        own = np.array(errors if len(errors) == len(self.psf) else [max(errors)] * len(self.psf))
        factor = CELL_SUM_ERROR if self.holds_cells else SUM_ERROR
        found: np.ndarray = factor * own * self.psf.sum(axis=(1, 2), dtype=np.float64) * self.dx**2
        return found

    can_be_seen_anew, through, held = renamed("can_recompute"), renamed("recompute_on"), renamed("window_sums")

    @property
    def can_recompute(self) -> bool:
        """True if the PSF can be recomputed on other samples; False if `optics.psf` did not compute it."""
        asked = [request.beam.wavelength for request in self.requests]
        if self.shares is None:
            return asked == list(self.wavelengths)
        return len(asked) == len(self.shares) and bool(np.allclose(self.shares @ asked, self.wavelengths, rtol=1e-9))

    @property
    def highest_cutoff(self) -> float:
        """Highest frequency [1/m] of the intensity at the shortest wavelength; at the mean if others are unknown."""
        if self.shares is None or not self.can_recompute:
            return float(self.cutoff.max())
        shortest = min(request.beam.wavelength for request in self.requests)
        return float(self.cutoff.max() * self.wavelengths.max() / shortest)

    def mean(self, shares: np.ndarray) -> PSFResult:
        """Return the PSF of all wavelengths together, (1, y, x), with derivatives, at their weighted mean wavelength.

        shares: fraction of each wavelength, with the sum 1, (wavelength,). A PSF that is already a mean is unchanged.

        Raises:
            ValueError: shares are not real numbers, or have the wrong shape or sum.
        """
        parts = reals("shares", shares)
        if parts.shape != self.wavelengths.shape or not math.isclose(float(parts.sum()), 1, rel_tol=1e-6):
            raise ValueError(f"shares = {shown(shares)}: must be {self.wavelengths.size} numbers that sum to 1")
        if self.shares is not None:
            return self  # this PSF is already a mean
        image = mixed(self.tensor, parts[None])
        wavelength, asked = np.array([parts @ self.wavelengths]), self.requests if self.can_recompute else ()
        return replace(
            self,
            tensor=image,
            wavelengths=wavelength,
            plans=(self.plan,),
            requests=asked,
            shares=parts,
            field_parts=None,
        )

    def of_wavelength(self, index: int) -> PSFResult:
        """Return the PSF of one wavelength, (1, y, x), with derivatives. A PSF from `mean` has only one wavelength.

        Raises:
            ValueError: there is no such wavelength.
        """
        count = self.tensor.shape[0]
        one = slice(whole("index", index, 0, count - 1), index + 1)
        if count == 1:
            return self
        return replace(
            self,
            tensor=self.tensor[one],
            wavelengths=self.wavelengths[one],
            plans=self.plans[one] if len(self.plans) == count else self.plans,
            requests=self.requests[one] if self.can_recompute else (),
            field_parts=None if self.field_parts is None else tuple(part[one] for part in self.field_parts),
        )

    def recompute_on(self, window: Grid, what: str) -> PSFResult:
        """Return the PSF of the same light over another window, with the same tolerance, but no `field`.

        what: name of the quantity that needs the other window, such as "power", for the error message.

        Raises:
            AccuracyError: `can_recompute` is False, or this window cannot be computed within the limits.
        """
        height, width = window.shape
        here = f"{self.tensor.shape[1]} x {self.tensor.shape[2]} samples {self.dx:.3g} m apart"
        needs = f"{what} needs {height} x {width} samples {window.dx:.3g} m apart, and this PSF has {here}"
        if not self.can_recompute or (max(window.shape) > MOST_AGAIN and window != self.window):
            raise AccuracyError(needs, f"set dx={window.dx:.3g}, shape=({height}, {width})")
        try:
            found = spread([_through(request, window) for request in self.requests])
            return found if self.shares is None else found.mean(self.shares)
        except AccuracyError as error:
            raise AccuracyError(f"{needs}, which fails: {error}") from None

    @cached_property
    def of_all_light(self) -> PSFResult:
        """This PSF. If its samples of the pupil are too coarse for light outside the window, it is recomputed.

        Raises:
            AccuracyError: see `recompute_on`.
        """
        return self.recompute_on(self.window, "a sum") if self.for_window and self.can_recompute else self

    def with_pitch(self, coarsest: float, what: str) -> PSFResult:
        """Return a PSF whose samples are at most `coarsest` [m] apart, for sums over these samples.

        If samples are close enough, or are means over squares, the result is `of_all_light`. Otherwise the square
        around each sample is divided into smaller squares, and the PSF is recomputed at their centres.

        Raises:
            AccuracyError: see `recompute_on`.
        """
        if self.dx <= coarsest or self.holds_cells:
            return self.of_all_light
        parts = math.ceil(self.dx / coarsest * (1 - 1e-9))
        pitch, (height, width) = self.dx / parts, self.tensor.shape[1:]
        # Sample n//2 of a grid lies in the middle of its cell, and both grids begin with the same rim of a cell.
        shifts = ((parts * n // 2 + 0.5) * pitch - (n // 2 + 0.5) * self.dx for n in (width, height))
        x, y = (at + shift for at, shift in zip(self.centre, shifts, strict=True))
        return self.recompute_on(Grid((parts * height, parts * width), pitch, (x, y)), what)

    @cached_property
    def _resolved(self) -> PSFResult:
        """Return the PSF on samples that are fine enough for their sum to be the power in the window."""
        return self.with_pitch(0.5 / self.highest_cutoff, "power")


def _through(request: Request, window: Grid) -> Request:
    asked = request.problem
    problem = replace(Problem.from_beam(request.beam, window, asked.tolerance, asked.dtype), all_light=True)
    if asked.steep:
        problem = replace(problem, steep=True, reach=asked.reach)
    method = request.method if request.method in APPROXIMATE else "auto"
    return replace(request, problem=problem, method=method, most_seconds=MOST_SECONDS, keeps_field=False)


def spread(requests: Sequence[Request]) -> PSFResult:
    """Return PSFs of one pupil at several wavelengths over one window.

    With 8 or more wavelengths, the method chosen for one is tried first for the next, see `Request.after`.

    Raises:
        AccuracyError: no method meets the tolerance, or the window is so dark that rounding errors exceed it.
    """
    import drjit as dr

    flat, plans, fields, samplings, _ = zip(*pictures(requests, alike=len(requests) >= MANY), strict=True)
    beam, window, types = requests[0].beam, requests[0].problem.window, precision(requests[0].problem.dtype)
    tensor = types.Tensor(flat[0] if len(flat) == 1 else dr.concat(flat), (len(flat), *window.shape))
    wavelengths = np.array([request.beam.wavelength for request in requests])
    where = (window.dx, wavelengths, beam.distance, beam.pupil)
    parts = None
    if requests[0].keeps_field:
        re, im = ([getattr(field, part) for field in fields] for part in ("re", "im"))
        parts = tuple(types.Tensor(row[0] if len(row) == 1 else dr.concat(row), tensor.shape) for row in (re, im))
    few, known = any(isinstance(each, WindowSampling) for each in samplings), (window.centre, tuple(requests))
    return PSFResult(tensor, *where, tuple(plans), *known, field_parts=parts, for_window=few)
