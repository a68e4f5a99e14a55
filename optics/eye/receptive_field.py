"""The directions that a receptor sees through a pupil: how wide a window holds them, and the PSF summed over cells."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from optics.elements.beam import Beam
from optics.elements.pupil import Pupil
from optics.elements.source import PointSource
from optics.methods.problem import Problem
from optics.numerics.accuracy import AccuracyError, Plan
from optics.numerics.autodiff import Array, Scalar, is_differentiable, number
from optics.numerics.grid import Grid
from optics.numerics.matrices import matmul
from optics.numerics.precision import precision
from optics.point_spread.psf import PSFResult, spread

__all__ = ["Retina", "perfect_psf", "retinal_psf", "visual_kernel"]

# Light from further off a receptor's direction counts as screened by the eye's rim: half the widest field of view.
WIDEST_TANGENT = math.tan(math.radians(50))
MOST_CELLS = 2049
MOST_SECONDS = 3.0  # per band


@dataclass(frozen=True)
class Retina:
    """Where the PSF is wanted: distance behind the pupil [m], wavelengths [m], cell size [m], tolerance, dtype."""

    distance: Scalar
    wavelengths: np.ndarray
    cell: float
    tolerance: float
    dtype: str = "float32"


@dataclass(frozen=True)
class _View:
    """What one wavelength asks of the grid: half the window [m] around the geometric image, the pitch that resolves
    the PSF [m], the band [1/m] beyond which the hard edge's light is less than the tolerance."""

    half_window: float
    pitch: float
    band: float


@dataclass(frozen=True)
class _Spot:
    """Where the light of a source lands: its geometric image (x, y) [m] on the sensor, half the side [m] of the square
    around it that holds the light, the pitch that resolves it, one view per wavelength."""

    centre: tuple[float, float]
    half: float
    pitch: float
    views: tuple[_View, ...]

    @property
    def window(self) -> Grid:
        """Samples around the axis that hold the square."""
        nx, ny = (2 * math.ceil((self.half + abs(at)) / self.pitch) + 1 for at in self.centre)
        return Grid((ny, nx), self.pitch)

    def cells(self, cell: float) -> int:
        return _cells_within((math.ceil(self.half / self.pitch) + 0.5) * self.pitch, cell)


def visual_kernel(
    pupil: Pupil, retina: Retina, z: Scalar, direction: tuple[float, float] = (0.0, 0.0), from_cell: bool = False
) -> Array:
    """PSF integrated over the retina's cells around the geometric image and turned by 180°: Dr.Jit (band, k, k), k odd.

    direction: (right, down) from the axis in the visual field, tangents; the image lies on the other side.
    from_cell: of light that comes from all over a cell of the scene, instead of from its centre.
    """
    import drjit as dr

    if is_differentiable(retina.distance) and direction != (0.0, 0.0):
        raise ValueError("fov_deg is a Dr.Jit array: must be a number off the axis, where it turns the light as well")
    beams = _beams(pupil, retina, z, (-direction[0], -direction[1]))
    spot = _spot(beams, retina)
    result = _spread(beams, spot, retina)
    tiles, types = _Tiles(spot.cells(retina.cell) + 2 * from_cell, retina.cell, from_cell), precision(retina.dtype)
    across, along = (
        types.Tensor(_cell_integrals(n, result.dx, tiles, at)[::-1].copy())
        for n, at in zip(result.tensor.shape[:0:-1], spot.centre, strict=True)
    )
    return dr.maximum(matmul(along, matmul(result.tensor, across, transposed=True)), 0)


def retinal_psf(pupil: Pupil, retina: Retina, z: Scalar) -> PSFResult:
    """PSF of an axial point at distance z on the window that loses less than the tolerance at every wavelength.

    Raises:
        AccuracyError: no method meets the tolerance within the limits on memory and time.
    """
    beams = _beams(pupil, retina, z, (0.0, 0.0))
    return _spread(beams, _spot(beams, retina), retina)


def _beams(pupil: Pupil, retina: Retina, z: Scalar, tangents: tuple[float, float]) -> list[Beam]:
    source = PointSource(z, (math.atan(tangents[0]), math.atan(tangents[1])))
    return [Beam(pupil, source, float(wavelength), retina.distance) for wavelength in retina.wavelengths]


def _spot(beams: list[Beam], retina: Retina) -> _Spot:
    distance = number(retina.distance)
    centre_x, centre_y = (distance * math.tan(angle) for angle in beams[0].source.angle)
    views = tuple(_view(beam, retina, (centre_x, centre_y)) for beam in beams)
    half, pitch = max(view.half_window for view in views), min(view.pitch for view in views)
    if _cells_within(half, retina.cell) > MOST_CELLS:
        raise AccuracyError(
            f"the light spreads over {2 * half:.3g} m, {2 * half / retina.cell:.0f} cells of {retina.cell:.3g} m: "
            f"at most {MOST_CELLS}; widen the field of view or the cells, or flatten the relief"
        )
    half = retina.cell * (_cells_within(half, retina.cell) + 1) / 2
    return _Spot((centre_x, centre_y), half, pitch, views)


def _spread(beams: list[Beam], spot: _Spot, retina: Retina) -> PSFResult:
    reach = spot.half + math.hypot(*spot.centre)
    tasks = [
        replace(Problem.of(beam, spot.window, retina.tolerance, retina.dtype), widest_band=view.band, reach=reach)
        for beam, view in zip(beams, spot.views, strict=True)
    ]
    return spread(beams, tasks, most_seconds=MOST_SECONDS)


def perfect_psf(retina: Retina, radius: float) -> PSFResult:
    """All power in one cell: a perfect lens of the given aperture radius [m], diffraction left out."""
    types = precision(retina.dtype)
    image = types.Tensor(np.full((len(retina.wavelengths), 1, 1), 1 / retina.cell**2))
    pupil = Pupil(radius, thin_lens_focal_length=retina.distance)
    plan = Plan("perfect_lens", (1, 1), retina.dtype, 0.0, "no pupil: geometric image, no blur")
    return PSFResult(image, retina.cell, retina.wavelengths, retina.distance, pupil, (plan,))


def _view(beam: Beam, retina: Retina, centre: tuple[float, float]) -> _View:
    """Half the loss goes to rays outside the window, half to what the hard edge sends further than δ [1/m] off its
    geometric direction: 1/(π²Rδ) of the light, as in the Airy pattern (1 - 2/(πv), v = 2πRδ; Born & Wolf §8.5.2).
    Pixels send light off it, too, and lose as much beyond what is counted."""
    pupil, wavelength = beam.pupil, beam.wavelength
    lam, z, radius = wavelength / pupil.medium_n, number(retina.distance), pupil.radius
    slopes = pupil.slopes(wavelength, beam.source)
    x, y = slopes.rays(z, pupil.medium_n)
    shadow = float(
        np.quantile(np.fmax(np.abs(x - centre[0]), np.abs(y - centre[1])), 1 - retina.tolerance / 2, method="higher")
    )
    tail = 2 / (math.pi**2 * radius * retina.tolerance) + pupil.scatter(wavelength, retina.tolerance / 4)
    half = WIDEST_TANGENT * z + radius
    if math.isfinite(shadow):
        off = max(abs(at) for at in centre)
        sine = (off + shadow) / math.hypot(off + shadow, z) + tail * lam
        half = min(half, z * sine / math.sqrt(1 - sine * sine) - off if sine < 1 else math.inf)
    steepest = slopes.steepest_inside / wavelength
    # The field's local bandwidth on the sensor is 2R/(λz); the intensity has twice that. Splines want a margin.
    detail = min(2 * radius / (lam * z), 2 * (steepest + tail))
    per_cycle = 3 * max(1.0, (1e-4 / retina.tolerance) ** (1 / 8))  # see _cell_integrals
    return _View(half, 1 / (per_cycle * detail), steepest + tail)


def _cells_within(half: float, cell: float) -> int:
    """Odd number of cells, one centred on the axis, that covers ± half."""
    return 2 * math.ceil(max(half / cell - 0.5, 0) - 1e-6) + 1


@dataclass(frozen=True)
class _Tiles:
    """Cells in a row, their size [m], and whether light comes from all over a cell of that size or from a point."""

    count: int
    size: float
    from_cell: bool


@lru_cache(maxsize=8)
def _cell_integrals(samples: int, pitch: float, tiles: _Tiles, centre: float) -> np.ndarray:
    """(cell, sample): integrals over tiles around `centre` of the spline through the samples, one axis. From a cell:
    means over sources all over it, PSF ⊗ cell ⊗ cell. At three samples per cycle a cubic errs by 4e-4, degree seven by
    4e-6."""
    from scipy.interpolate import make_interp_spline

    grid = Grid((1, samples), pitch)
    degree = min(7, (samples - 2) // 2 * 2 + 1)
    primitive = make_interp_spline(grid.x, np.eye(samples), k=degree).antiderivative()
    count = tiles.count + tiles.from_cell
    edges = centre + (np.arange(count + 1) - count / 2) * tiles.size
    inside = np.clip(edges, grid.x[0], grid.x[-1])
    if not tiles.from_cell:
        return np.diff(primitive(inside), axis=0)
    # Beyond the samples is no light: there the primitive stays what it is, and its own rises in a straight line.
    second = primitive.antiderivative()(inside) + primitive(inside) * (edges - inside)[:, None]
    return np.diff(second, 2, axis=0) / tiles.size
