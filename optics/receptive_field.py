"""The directions that a receptor sees through a pupil: how wide a window holds them, and the PSF summed over cells."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from optics.beam import Beam
from optics.grid import Grid
from optics.planner import AccuracyError, Plan
from optics.point_spread import PSFResult, problem, spread
from optics.precision import precision
from optics.pupil import Pupil
from optics.source import PointSource

__all__ = ["Retina", "perfect_psf", "retinal_psf", "visual_kernel"]

# Light from further off a receptor's direction counts as screened by the eye's rim: half the widest field of view.
WIDEST_TANGENT = math.tan(math.radians(50))
MOST_CELLS = 2049
MOST_SECONDS = 3.0  # per band


@dataclass(frozen=True)
class Retina:
    """Where the PSF is wanted: distance behind the pupil [m], wavelengths [m], cell size [m], tolerance."""

    distance: float
    wavelengths: np.ndarray
    cell: float
    tolerance: float


@dataclass(frozen=True)
class _View:
    """What one wavelength asks of the grid: half the window [m], the pitch that resolves the PSF [m], the band [1/m]
    beyond which the hard edge's light is less than the tolerance."""

    half_window: float
    pitch: float
    band: float


def visual_kernel(pupil: Pupil, retina: Retina, z: float) -> np.ndarray:
    """PSF integrated over the retina's cells and turned by 180°: (band, k, k) float32, k odd."""
    result = retinal_psf(pupil, retina, z)
    samples = result.psf.shape[-1]
    cells = _cells_within(result.dx * samples / 2, retina.cell)
    sums = _cell_integrals(samples, result.dx, cells, retina.cell)
    kernel = np.einsum("ci,bij,dj->bcd", sums, result.psf, sums, optimize=True)
    return np.ascontiguousarray(np.maximum(kernel, 0)[:, ::-1, ::-1], dtype=np.float32)


def retinal_psf(pupil: Pupil, retina: Retina, z: float) -> PSFResult:
    """PSF of an axial point at distance z on the window that loses less than the tolerance at every wavelength.

    Raises:
        AccuracyError: no method meets the tolerance within the limits on memory and time.
    """
    beams = [Beam(pupil, PointSource(z), float(wavelength), retina.distance) for wavelength in retina.wavelengths]
    views = [_view(beam, retina) for beam in beams]
    half, pitch = max(view.half_window for view in views), min(view.pitch for view in views)
    if _cells_within(half, retina.cell) > MOST_CELLS:
        raise AccuracyError(
            f"the light spreads over {2 * half:.3g} m, {2 * half / retina.cell:.0f} cells of {retina.cell:.3g} m: "
            f"at most {MOST_CELLS}; widen the field of view or the cells, or flatten the relief"
        )
    half = retina.cell * (_cells_within(half, retina.cell) + 1) / 2
    window = Grid.square(2 * math.ceil(half / pitch) + 1, pitch)
    tasks = [
        replace(problem(beam, window, retina.tolerance), widest_band=view.band, reach=half)
        for beam, view in zip(beams, views, strict=True)
    ]
    return spread(beams, tasks, most_seconds=MOST_SECONDS)


def perfect_psf(retina: Retina, radius: float) -> PSFResult:
    """All power in one cell: a perfect lens of the given aperture radius [m], diffraction left out."""
    image = np.full((len(retina.wavelengths), 1, 1), 1 / retina.cell**2, dtype=np.float32)
    pupil = Pupil(radius, thin_lens_focal_length=retina.distance)
    plan = Plan("perfect_lens", (1, 1), "float32", 0.0, "no pupil: geometric image, no blur")
    return PSFResult(precision().Tensor(image), retina.cell, retina.wavelengths, retina.distance, pupil, (plan,))


def _view(beam: Beam, retina: Retina) -> _View:
    """Half the loss goes to rays outside the window, half to what the hard edge sends further than δ [1/m] off its
    geometric direction: 1/(π²Rδ) of the light, as in the Airy pattern (1 - 2/(πv), v = 2πRδ; Born & Wolf §8.5.2)."""
    pupil, wavelength = beam.pupil, beam.wavelength
    slopes = pupil.slopes(wavelength, beam.source)
    x, y = slopes.rays(retina.distance, pupil.medium_n)
    lam, z, radius = wavelength / pupil.medium_n, retina.distance, pupil.radius
    shadow = float(np.quantile(np.fmax(np.abs(x), np.abs(y)), 1 - retina.tolerance / 2, method="higher"))
    tail = 2 / (math.pi**2 * radius * retina.tolerance)
    half = WIDEST_TANGENT * z + radius
    if math.isfinite(shadow):
        sine = shadow / math.hypot(shadow, z) + tail * lam
        half = min(half, z * sine / math.sqrt(1 - sine * sine) if sine < 1 else math.inf)
    steepest = slopes.steepest_inside / wavelength
    # The field's local bandwidth on the sensor is 2R/(λz); the intensity has twice that. Cubic splines want a margin.
    detail = min(2 * radius / (lam * z), 2 * (steepest + tail))
    return _View(half, 1 / (3 * detail), steepest + tail)


def _cells_within(half: float, cell: float) -> int:
    """Odd number of cells, one centred on the axis, that covers ± half."""
    return 2 * math.ceil(max(half / cell - 0.5, 0) - 1e-6) + 1


def _cell_integrals(samples: int, pitch: float, cells: int, cell: float) -> np.ndarray:
    """(cell, sample): integrals over the cells of the cubic spline through the samples, one axis."""
    from scipy.interpolate import make_interp_spline

    grid = Grid((1, samples), pitch)
    primitive = make_interp_spline(grid.x, np.eye(samples), k=3).antiderivative()
    edges = (np.arange(cells + 1) - cells / 2) * cell
    return np.diff(primitive(np.clip(edges, grid.x[0], grid.x[-1])), axis=0)
