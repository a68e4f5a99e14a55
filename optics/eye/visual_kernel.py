"""Receptive fields behind a pupil: integrals of a source's PSF over each cell of the retina that the PSF reaches."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TypeVar

import numpy as np

from optics.elements.beam import Beam
from optics.elements.pupil import Pupil
from optics.elements.source import PointSource
from optics.elements.wavefront_slopes import Slopes
from optics.eye.cell_integrals import Tiles, cell_integrals, samples_per_cycle
from optics.eye.retina import CellsError, Retina, more_time
from optics.methods.problem import Problem
from optics.methods.smooth_spectrum import may_be_steep
from optics.numerics.accuracy import AccuracyError, Plan
from optics.numerics.autodiff import Array, Scalar, is_differentiable, number
from optics.numerics.grid import Grid
from optics.numerics.matrices import matmul
from optics.numerics.precision import padded_for_packets, precision
from optics.point_spread.pictures import PSFPicture, pictures
from optics.point_spread.psf_result import PSFResult, spread
from optics.point_spread.request import Request

__all__ = ["perfect_psf", "retinal_psf", "visual_kernel"]

Result = TypeVar("Result")
# Choice: light at more than 50° from a receptor's direction counts as blocked by the rim of the eye.
WIDEST_TANGENT = math.tan(math.radians(50))
BESIDE = 4  # choice: samples beyond either end of the light, because a spline is least accurate at its ends
MOST_CELLS = 2049  # choice: largest number of cells of a kernel along an axis


@dataclass(frozen=True)
class _WindowNeeds:
    """Window and samples that the light of one wavelength requires.

    half_window: half side [m] of the window around the geometric image.
    pitch: pitch [m] that resolves the PSF.
    band: highest frequency [1/m] of light behind the pupil that must be included to meet the tolerance.
    half_of_rays: half side [m] of a window that is sufficient without diffraction, see `_half_side`.
    """

    half_window: float
    pitch: float
    band: float
    half_of_rays: float


@dataclass(frozen=True)
class Spot:
    """Area on the sensor that the light of a source reaches.

    centre: geometric image (x, y) [m].
    half: half the side [m] of the square around it that contains the light.
    pitch: sampling pitch [m] that resolves the PSF.
    needs: window and sampling that each wavelength requires.
    on_retina: True if `half` was limited to a side of the retina. Light outside the square then counts as blocked.
    """

    centre: tuple[float, float]
    half: float
    pitch: float
    needs: tuple[_WindowNeeds, ...]
    on_retina: bool = False

    @property
    def half_of_rays(self) -> float:
        """Half the side [m] of a square around `centre` that nearly all undiffracted rays hit; at most `half`."""
        return min(self.half, max(need.half_of_rays for need in self.needs))

    def window(self, pitch: float, beside: int = 0) -> Grid:
        """Return a grid that covers the square around the geometric image and a margin of `beside` samples."""
        side = 2 * (math.ceil(self.half / pitch) + beside) + 1
        return Grid((side, side), pitch, self.centre)

    def cells(self, cell: float) -> int:
        return _cells_within((math.ceil(self.half / self.pitch) + 0.5) * self.pitch, cell)


def visual_kernel(pupil: Pupil, retina: Retina, z: Scalar, direction: tuple[float, float], from_cell: bool) -> Array:
    """Return the PSF of a point at distance z [m], integrated over cells of the retina around the geometric image.

    Cells are equal parts of receptors. The result is a Dr.Jit tensor (band, row, column) with odd numbers of rows and
    columns. It starts at the top left of the visual field, where y and x on the retina are smallest.

    direction: tangents (right, down) of the source's direction in the visual field.
    from_cell: True if the source is an area whose geometric image is as large as a cell, False if it is a point.

    Raises:
        ValueError: the retina's distance carries derivatives, and the source is off the axis.
        AccuracyError: the tolerance needs more memory or time than allowed, or the light covers too many cells.
    """
    import drjit as dr

    if is_differentiable(retina.distance) and direction != (0.0, 0.0):
        raise ValueError("fov_deg is a Dr.Jit array: must be a number off the axis, as it also turns the light")
    beams = beams_to(pupil, retina, z, retina.across_pupil(direction))

    def computed(spot: Spot) -> tuple[Spot, list[Request], list[PSFPicture]]:
        # Each wavelength has its own samples, since longer wavelengths need fewer.
        requests = [
            _request(beam, spot, need, spot.window(_pitch_for_cells(need.pitch, retina), BESIDE), retina)
            for beam, need in zip(beams, spot.needs, strict=True)
        ]
        return spot, requests, pictures(requests, alike=True)

    spot, requests, found = _on_spot(computed, beams, retina)
    rows, columns = (Tiles(spot.cells(side) + 2 * from_cell, side, from_cell) for side in retina.cell)
    types, kernels = precision(retina.dtype), []
    for request, picture in zip(requests, found, strict=True):
        window = request.problem.window
        # Samples and cells run backwards, so a symmetric pupil has the same sums in the same order as a turned one.
        down, across = (
            types.Tensor(padded_for_packets(sums), sums.shape)
            for samples, tiles in zip(window.shape, (rows, columns), strict=True)
            for sums in [cell_integrals(samples, window.dx, tiles)[::-1]]
        )
        image = types.Tensor(picture.image if retina.pupil_turned else dr.reverse(picture.image), window.shape)
        kernels.append(matmul(down, matmul(image, across, transposed=True)).array)
    flat = kernels[0] if len(kernels) == 1 else dr.concat(kernels)
    return dr.maximum(types.Tensor(flat, (len(kernels), rows.count, columns.count)), 0)


def retinal_psf(pupil: Pupil, retina: Retina, z: Scalar, direction: tuple[float, float]) -> PSFResult:
    """Return the PSF of a point at distance z [m], with at least 1 - `retina.tolerance` of each wavelength's light.

    Light from a steep relief may count as blocked if it is farther than `min(retina.size)` from the geometric image.

    direction: tangents (right, down) of the point's direction in the visual field.

    Raises:
        AccuracyError: the tolerance needs more memory or time than allowed, or the light covers too many cells.
    """
    beams = beams_to(pupil, retina, z, retina.across_pupil(direction))
    return _on_spot(lambda spot: _spread(beams, spot, retina), beams, retina)


def _on_spot(compute: Callable[[Spot], Result], beams: list[Beam], retina: Retina) -> Result:
    """Return the result of `compute` for the square that the light reaches or, if `compute` fails, a smaller square.

    For steep reliefs, half the side is first limited to the retina's longer side, and then to its shorter side.

    Raises:
        AccuracyError: `compute` fails for every square. The error is the one for the first square.
    """
    errors: list[AccuracyError] = []
    for most in (math.inf, max(retina.size), min(retina.size)):
        try:
            with more_time():
                return compute(spot_of(beams, retina, most))
        except AccuracyError as error:
            errors.append(error)
            if (isinstance(error, CellsError) and retina.samples > 1) or not all(map(may_be_steep, beams)):
                break
    raise errors[0]


def beams_to(pupil: Pupil, retina: Retina, z: Scalar, tangents: tuple[float, float]) -> list[Beam]:
    source = PointSource(z, (math.atan(tangents[0]), math.atan(tangents[1])))
    return [Beam(pupil, source, float(wavelength), retina.distance) for wavelength in retina.wavelengths]


def spot_of(beams: list[Beam], retina: Retina, most: float = math.inf) -> Spot:
    """Return the square, centred on the geometric image, that contains the light.

    most: upper bound on half the square's side [m]. Light outside the square counts as blocked by the rim of the eye.
        If the bound is the retina's longer side, blocked light from the visual field would miss all receptors anyway.

    Raises:
        CellsError: too many cells, the rectangles into which receptors are divided, lie along a side of the square.
    """
    distance = number(retina.distance)
    centre_x, centre_y = _image(beams[len(beams) // 2], distance)
    needs = tuple(_needs(beam, retina, (centre_x, centre_y)) for beam in beams)
    half, pitch = max(need.half_window for need in needs), min(need.pitch for need in needs)
    half = min(half, most)
    narrow = min(retina.cell)
    if _cells_within(half, narrow) > MOST_CELLS:
        raise CellsError(
            f"the light spreads over {2 * half:.3g} m, {2 * half / narrow:.0f} cells of {narrow:.3g} m: "
            f"at most {MOST_CELLS}; increase the field of view or the cells"
            + (", or flatten the relief" if beams[0].pupil.height is not None else "")
        )
    half = max(side * (_cells_within(half, side) + 1) / 2 for side in retina.cell)
    return Spot((centre_x, centre_y), half, pitch, needs, math.isfinite(most))


def _image(beam: Beam, distance: float) -> tuple[float, float]:
    """Return the point (x, y) [m] where the ray through the pupil's centre, refracted there, hits the retina."""
    x, y = (math.tan(angle) for angle in beam.source.angle)
    if beam.pupil.object_n is None:
        return distance * x, distance * y
    bent = beam.pupil.index_before(beam.wavelength) / beam.index / math.hypot(1, x, y)
    axial = math.sqrt(max(1 - bent**2 * (x * x + y * y), 1e-6))
    return distance * bent * x / axial, distance * bent * y / axial


def _pitch_for_cells(pitch: float, retina: Retina) -> float:
    """Return the pitch [m] that is fine enough to integrate the PSF over cells. `pitch` resolves the PSF itself."""
    each = samples_per_cycle(retina.tolerance)
    return pitch * each / samples_per_cycle(retina.tolerance, min(retina.cell) / (pitch * each))


def _spread(beams: list[Beam], spot: Spot, retina: Retina) -> PSFResult:
    window = spot.window(spot.pitch)
    return spread([_request(beam, spot, need, window, retina) for beam, need in zip(beams, spot.needs, strict=True)])


def _request(beam: Beam, spot: Spot, need: _WindowNeeds, window: Grid, retina: Retina) -> Request:
    reach = spot.half + math.hypot(*spot.centre)
    problem = Problem.from_beam(beam, window, retina.tolerance, retina.dtype)
    band = math.inf if spot.on_retina else need.band
    problem = replace(problem, widest_band=band, reach=reach, steep=spot.on_retina)
    return Request(beam, problem, most_seconds=retina.most_seconds)


def perfect_psf(retina: Retina, radius: float) -> PSFResult:
    """Return the PSF of a perfect lens of this radius [m] without diffraction: all light is in one cell."""
    types = precision(retina.dtype)
    _, width = retina.cell
    image = types.Tensor(np.full((len(retina.wavelengths), 1, 1), 1 / width**2))
    pupil = Pupil(radius, thin_lens_focal_length=retina.distance)
    plan = Plan("perfect_lens", (1, 1), retina.dtype, 0.0, "no pupil: geometric image, no blur")
    return PSFResult(image, width, retina.wavelengths, retina.distance, pupil, (plan,))


def _needs(beam: Beam, retina: Retina, centre: tuple[float, float]) -> _WindowNeeds:
    """Return the window around the geometric image `centre` (x, y) [m] and the sampling that one wavelength requires.

    The fraction `retina.tolerance` of the light may miss the window. Half of this fraction is for diffraction at the
    pupil's edge, which increases the sine of a ray's angle by λf for a frequency f. The other half is for rays or, if
    the mask, the relief or the wavefront scatters light, one quarter for rays and one quarter for scattered light.
    """
    pupil, z, radius = beam.pupil, number(retina.distance), beam.pupil.radius
    wavelength = beam.wavelength / beam.index
    scattered = pupil.scatter(beam.wavelength, retina.tolerance / 4)
    diffracted = _beyond_edge(pupil, retina.tolerance / 2) + scattered
    half = WIDEST_TANGENT * z + radius
    # In the worst case a mask transmits only the rays that land farthest away.
    lost = retina.tolerance * number(pupil.transmission) / (4 if scattered else 2)
    shadow = _half_side(pupil.slopes(beam.wavelength, beam.source), (z, beam.index), centre, 1 - lost)
    if math.isfinite(shadow):
        off_axis = max(abs(at) for at in centre)
        outermost = off_axis + shadow
        sine = outermost / math.hypot(outermost, z) + diffracted * wavelength
        half = min(half, z * sine / math.sqrt(1 - sine * sine) - off_axis if sine < 1 else math.inf)
    band = pupil.slopes(beam.wavelength, beam.source).steepest_inside / beam.wavelength + diffracted
    # The spectrum of |U|² contains the differences between the field's frequencies. They are at most 2R/(λz) at a point
    # that the whole pupil illuminates, and at most twice the band.
    detail = min(2 * radius / (wavelength * z), 2 * band)
    return _WindowNeeds(half, 1 / (samples_per_cycle(retina.tolerance) * detail), band, shadow)


@lru_cache(maxsize=64)
def _half_side(slopes: Slopes, behind: tuple[float, float], centre: tuple[float, float], fraction: float) -> float:
    """Return the half side [m] of the square about `centre` that contains this fraction of the rays' hit points.

    behind: distance [m] and refractive index behind the pupil.
    """
    x, y = slopes.rays(*behind)
    farthest = np.fmax(np.abs(x - centre[0]), np.abs(y - centre[1]))
    return float(np.quantile(farthest, fraction, method="higher"))


def _beyond_edge(pupil: Pupil, fraction: float) -> float:
    """Return the change δ [1/m] of spatial frequency that this fraction of the light exceeds behind a hard edge.

    Per length of a straight edge, the squared spectrum at changes above δ has the integral 1/(2π²δ). For an aperture of
    perimeter P and area A, the fraction is thus P/(2π²Aδ), and for a disk 1/(π²Rδ) (Airy pattern, Born & Wolf, §8.5.2).
    If the light behind a mask is brighter at the edge than on average, `_rim` multiplies the fraction.
    """
    opening = pupil.aperture
    return _rim(pupil) * opening.outline.length / (2 * math.pi**2 * opening.area * pupil.radius * fraction)


@lru_cache(maxsize=64)
def _rim(pupil: Pupil) -> float:
    """Return the mean intensity behind the mask along the aperture's edge, divided by its mean over the aperture.

    It is 1 without a mask and never less: a mask with a dark edge diffracts light where its transmission increases.
    """
    import drjit as dr

    if pupil.mask is None or number(pupil.transmission) == 0:
        return 1.0
    types, (x, y) = precision("float64"), pupil.aperture.outline.points().T
    with dr.suspend_grad():
        along = pupil.amplitude(types.Float64(padded_for_packets(x)), types.Float64(padded_for_packets(y)))
    return max(1.0, float(np.square(along.numpy()).mean()) / number(pupil.transmission))


def _cells_within(half: float, cell: float) -> int:
    """Return the odd number of cells in the shortest row that extends at least `half` to both sides of its middle."""
    return 2 * math.ceil(max(half / cell - 0.5, 0) - 1e-6) + 1
