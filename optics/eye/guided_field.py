"""Receptive fields of receptors that are waveguides: the fraction of the light on the pupil that their modes accept.

A point source is imaged at the position v [m] relative to a waveguide. Of the source's light on the pupil, the
waveguide accepts and absorbs the fraction E(v). If a receptor occupies the area A of the retina, its kernel is E(v)/A,
integrated over each of the cells, the equal rectangles into which every receptor's area is divided. For comparison, the
signal of a receptor that absorbs all light is the mean of the image over the area A. The waveguide stands where the ray
through the pupil's centre hits the retina, and points at that centre. For a source imaged at u and a receptor at r, the
kernel is a function of r - u = -v. It is therefore E rotated by 180°.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from optics.elements.beam import Beam
from optics.elements.pupil import Pupil
from optics.eye.cell_integrals import samples_per_cycle
from optics.eye.retina import Retina
from optics.eye.visual_kernel import Spot, beams_to, spot_of
from optics.numerics.accuracy import AccuracyError
from optics.numerics.arguments import of_kind
from optics.numerics.autodiff import Array, Scalar
from optics.numerics.grid import Grid
from optics.numerics.precision import precision
from optics.numerics.quadrature import gauss_legendre, gauss_legendre_count
from optics.ommatidia.coupling import modes_at_pupil
from optics.ommatidia.waveguide import Waveguide

__all__ = ["Guide", "check_guide", "guided_kernel"]

FINER = 10.0  # choice: E is sampled for a tenth of the tolerance, since splines interpolate it twice
DEGREE, MARGIN = 5, 8  # degree of the spline, and number of samples beyond the window
MOST_SAMPLES = 4096  # choice: samples of E along an axis
DEPTHS = 3.0  # choice: decay lengths of the first mode's evanescent field that the window includes
MORE_DIGITS = 1.5  # choice: extra digits of amplitudes, relative to the tolerance
WIDER = 1.5  # choice: ratio of the widths of successive windows
CELL_DIGITS = 4.0  # choice: digits of integrals over cells


@dataclass(frozen=True)
class Guide:
    """A waveguide on a retina.

    focal: focal length f [m]. A receptor at the distance x from the axis sees an angle with the tangent x/f.
    cells: number of cells along a receptor's side. Cells are the equal rectangles into which a receptor's area on the
        retina is divided. A cell of the scene is a part of the scene whose geometric image is one of these rectangles.
    from_cell: True if light comes from every point of a cell of the scene, False if it comes from the cell's centre.
    """

    waveguide: Waveguide
    focal: float
    cells: int
    from_cell: bool = True


def check_guide(waveguide: Waveguide | None, pupil: Pupil | None, receptor: tuple[float, float]) -> None:
    """Raise a ValueError for a waveguide that overlaps its neighbours or has no pupil in front of it.

    receptor: height and width of a receptor [m].
    """
    if waveguide is None:
        return
    of_kind("waveguide", waveguide, Waveguide, "Waveguide(2e-6), or None for receptors that are squares")
    if pupil is None:
        raise ValueError("waveguide is given and pupil = None: must be a Pupil, which illuminates the waveguide")
    height, width = receptor
    if waveguide.diameter > min(receptor) * (1 + 1e-9):
        side = f"sensor_width / resolution[1] = {width:g}" if width <= height else f"a receptor's height {height:g}"
        raise ValueError(
            f"waveguide.diameter = {waveguide.diameter:g}: must be at most {side} m, so that neighbours do not overlap"
        )


def guided_kernel(pupil: Pupil, retina: Retina, z: Scalar, direction: tuple[float, float], guide: Guide) -> Array:
    """Return the fraction of light that a receptor accepts from each cell of the scene, Dr.Jit (band, ky, kx).

    Cells of the scene are parts of it whose geometric images are equal rectangles. They lie around the receptor's
    direction.

    ky and kx are even if `guide.cells` is even. Rows run from the top of the visual field to the bottom, columns from
    left to right.

    z: distance [m] of the scene along the axis.
    direction: tangents (right, down) of the receptor's direction in the visual field.

    Raises:
        ValueError: the waveguide has no guided mode at one of the wavelengths, or an argument carries a derivative.
        AccuracyError: the receptor's field needs too many samples, or the light covers too many cells.
    """
    beams = beams_to(pupil, retina, z, retina.across_pupil(direction))
    spot = spot_of(beams, retina)
    bands = [_within(beam, spot, need.pitch, retina, guide) for beam, need in zip(beams, spot.needs, strict=True)]
    sides = np.max([band.shape for band in bands], axis=0)
    wide = [np.pad(band, [((side - n) // 2,) * 2 for side, n in zip(sides, band.shape, strict=True)]) for band in bands]
    # On the axis of a symmetric pupil, E is symmetric, too.
    even = direction == (0.0, 0.0) and all(pupil.mirror_symmetric(beam.wavelength) for beam in beams)
    found = np.stack(wide) if retina.pupil_turned or even else np.stack(wide)[:, ::-1, ::-1]
    scale = guide.focal**2 / math.prod(side * guide.cells for side in retina.cell)
    return precision(retina.dtype).Tensor(np.maximum(found * scale, 0))


def _within(beam: Beam, spot: Spot, pitch: float, retina: Retina, guide: Guide) -> np.ndarray:
    """Return the integral of E over each cell of the scene, array (row, column).

    E is the fraction of a source's light on the pupil that a waveguide absorbs. It depends on the source's direction.
    The cells, equal rectangles in the scene, form a window of directions around
    the receptor's direction. The window is widened until the integral of E outside it is at most the fraction
    `retina.tolerance` of the integral over all directions. The half width of the window is at most `spot.half` plus the
    radius of the waveguide's modes. Directions are measured as tangents of angles, so each integral is in units of a
    squared tangent.

    pitch: distance [m] between samples of the PSF on the retina.
    """
    most = spot.half + _radius(guide.waveguide, beam)
    diffracted = guide.focal * beam.wavelength / (beam.pupil.radius * beam.pupil.index_before(beam.wavelength))
    half = spot.half_of_rays + most - spot.half + diffracted
    while True:
        half = min(half, most)
        counts = (2 * math.ceil(half / side - guide.cells % 2 / 2) + guide.cells % 2 for side in retina.cell)
        rows, columns = (
            _Cells(count, side / guide.focal, pitch / guide.focal, retina.tolerance)
            for count, side in zip(counts, retina.cell, strict=True)
        )
        found, contained = _accepted(beam, spot, guide, rows, columns)
        if contained >= 1 - retina.tolerance or half == most:
            return found
        half *= WIDER


@dataclass(frozen=True)
class _Cells:
    """A row of cells, the equal rectangles into which the scene is divided.

    Directions are measured as tangents of angles, so `side` and `pitch` are differences of tangents.

    count: number of cells.
    side: side of a cell along the row.
    pitch: distance between directions at which a receptor's sensitivity is sampled, small enough to resolve it.
    """

    count: int
    side: float
    pitch: float
    tolerance: float

    def places(self, from_cell: bool) -> tuple[np.ndarray, np.ndarray]:
        """Return quadrature nodes (cell, node) in every cell of this row of cells, and the nodes' weights (node,).

        Cells are the equal rectangles into which the scene is divided. A node is a direction at which a receptor's
        sensitivity is evaluated, so that it can be integrated over each cell. The node's value is the tangent of this
        direction's angle from the axis, minus the same tangent for the middle of the row. The weights sum to a cell's
        side.

        from_cell: False for a single point in the centre of each cell.
        """
        middle = (np.arange(self.count) - (self.count - 1) / 2) * self.side
        if not from_cell:
            return middle[:, None], np.array([self.side])
        cycles = self.side / (self.pitch * samples_per_cycle(self.tolerance))
        node, weight = gauss_legendre(gauss_legendre_count(cycles, CELL_DIGITS))
        return middle[:, None] + (node - 0.5) * self.side, weight * self.side

    @property
    def step(self) -> float:
        """Distance between samples of a receptor's field, as a difference of the sines of two directions.

        It is less than `pitch`, to limit the error of the splines that interpolate the samples.
        """
        return self.pitch * samples_per_cycle(self.tolerance) / samples_per_cycle(self.tolerance / FINER)


def _radius(waveguide: Waveguide, beam: Beam) -> float:
    """Return the radius [m] that contains the field of the mode with the strongest confinement.

    Raises:
        ValueError: there is no mode.
    """
    modes = waveguide.modes(beam.wavelength)
    if not modes:
        raise ValueError(f"waveguide: has no guided mode at {beam.wavelength:g} m; must be wider, or of a higher index")
    return modes[0].radius * (1 + min(DEPTHS / modes[0].w, DEPTHS))


def _accepted(beam: Beam, spot: Spot, guide: Guide, rows: _Cells, columns: _Cells) -> tuple[np.ndarray, float]:
    """Return the integral of E over each cell of the scene, (row, column), and the fraction of E within the cells.

    E is the fraction of a source's light on the pupil that the waveguide absorbs, a function of the source's direction.
    The second value is E's integral over the window of all cells, divided by E's integral over all directions.
    Directions are measured as tangents of angles, so the integral over a cell is in units of a squared tangent.
    """
    from scipy.ndimage import map_coordinates

    middle = [math.tan(angle) for angle in beam.source.angle]
    (across, weight_x), (down, weight_y) = columns.places(guide.from_cell), rows.places(guide.from_cell)
    along_x, along_y = middle[0] + across.ravel(), middle[1] + down.ravel()
    own = 1 / math.hypot(1, *middle)
    cosine = 1 / np.sqrt(1 + along_x**2 + along_y[:, None] ** 2)
    # Sines are relative to the sine of the source's direction, which the phase of the modes already contains.
    sine_x, sine_y = along_x * cosine - middle[0] * own, along_y[:, None] * cosine - middle[1] * own
    sines = _grid_around(sine_x, sine_y, rows.step)
    modes = guide.waveguide.modes(beam.wavelength)
    taken = np.array([guide.waveguide.absorbed(mode) for mode in modes])
    steepest = float(np.hypot(np.abs(sine_x).max(), np.abs(sine_y).max()))
    digits = MORE_DIGITS - math.log10(rows.tolerance)
    guided = modes_at_pupil(beam, modes, steepest, spot.centre, digits)
    seen = guided.power_on(sines, taken, digits)
    places = [(sine_y - sines.y[0]) / sines.dx, (sine_x - sines.x[0]) / sines.dx]
    found = map_coordinates(seen, places, order=DEGREE, mode="nearest")
    by_cell = found.reshape(rows.count, len(weight_y), columns.count, len(weight_x))
    inner = seen[MARGIN:-MARGIN, MARGIN:-MARGIN].sum() * sines.dx**2
    return np.einsum("yaxb,a,b->yx", by_cell, weight_y, weight_x), float(inner / guided.total(taken))


def _grid_around(x: np.ndarray, y: np.ndarray, step: float) -> Grid:
    """Return a grid that contains all points x, y, with the margin that a spline needs.

    x, y: sines (x and y components of the unit vectors) of directions, minus the sines of the source's direction.

    Raises:
        AccuracyError: the grid needs more samples than the limit.
    """
    centre = tuple(float(axis.min() + axis.max()) / 2 for axis in (x, y))
    sides = [math.ceil(float(np.ptp(axis)) / (2 * step)) for axis in (y, x)]
    shape = tuple(2 * (side + MARGIN) + 1 for side in sides)
    if max(shape) > MOST_SAMPLES:
        raise AccuracyError(
            f"the light needs {max(shape)} samples of a receptor's field along an axis; the limit is {MOST_SAMPLES}: "
            "reduce the field of view, or widen the pupil"
        )
    return Grid((shape[0], shape[1]), step, (centre[0], centre[1]))
