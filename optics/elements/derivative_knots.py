"""Cells of the pupil in which derivatives of a PSF are smooth, and the inputs with respect to which they are requested.

A map is a relief, wavefront or mask that is given by samples. The derivative of the light behind the pupil with respect
to one sample is proportional to a cardinal spline times that light. If the map is a mask, the spline is multiplied
instead by the light that would pass the pupil without the mask. The spline is a different cubic polynomial in every
cell between two knots, whatever the values of the map are. Even if a map is flat, derivatives with respect to its
samples therefore contain the fine detail of these splines. Samples of the pupil that resolve only the light give wrong
derivatives. Quadrature nodes in each cell are used instead.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from optics.elements.beam import Beam
from optics.elements.pupil import Pupil
from optics.elements.refractive_index import RefractiveIndex
from optics.elements.relief import BSplineRelief, HeightMap, Relief
from optics.elements.transmittance import GaussianMask, MaskMap
from optics.elements.wavefront import WavefrontMap, Zernike
from optics.numerics.autodiff import carries_derivative
from optics.numerics.precision import precision

__all__ = ["DerivativeKnots", "carries_derivatives", "derivative_knots"]

APART = 1e-9  # rounding: borders that are closer, in pupil radii, are the same


@dataclass(frozen=True)
class DerivativeKnots:
    """Cells of the square around the pupil, in which derivatives with respect to samples of maps are smooth.

    A map is a relief, wavefront or mask that is given by samples and interpolated by cubic splines. Each row and each
    column of samples is a knot, at which a spline changes from one polynomial to another. The knots of all maps that
    carry derivatives divide the square into the cells.

    borders: ascending borders of the cells, the same along x and along y, in units of the pupil's radius, from -1 to 1.
        If the relief consists of pixels, the borders between them are included.
    splines: largest number of cubic splines, 1 or 2, in the derivative of the light with respect to a sample. Besides
        the spline of this sample, the mask may be a spline. The number is 2 if the mask carries derivatives and the
        relief, the wavefront or both do as well.
    maps: text with the name, rows and columns of each map that carries derivatives, such as "height: 32 x 32".
    names: names of these maps, which are names of arguments of `Pupil`.
    """

    borders: tuple[float, ...]
    splines: int
    maps: str
    names: tuple[str, ...]

    def without_maps(self, pupil: Pupil) -> Pupil:
        """Return the pupil without the maps (relief, wavefront or mask) that carry derivatives.

        The rows and columns of these maps' samples divide the pupil into rectangular cells. In each cell, the maps are
        polynomials of low degree. The number of quadrature nodes in a cell therefore depends on the bandwidth of the
        pupil that is returned, and not on these maps.
        """
        without: dict[str, Any] = dict.fromkeys(self.names)
        return replace(pupil, **without)


def derivative_knots(pupil: Pupil, wavelength: float) -> DerivativeKnots | None:
    """Return cells in which derivatives with respect to samples of maps are smooth; None if no map carries any.

    A map is a relief, wavefront or mask that is given by samples. Its knots are the rows and columns of samples. The
    derivative of the light with respect to a sample is proportional to a cubic spline, which is a single polynomial
    only in each cell between two knots. Only knots of maps that carry derivatives are used. A relief counts as such a
    map also if only its refractive index carries a derivative, because the derivative of the light with respect to the
    index is proportional to the height.

    wavelength: vacuum wavelength [m]. A relief is ignored if its index at this wavelength equals that of the medium
        around it and carries no derivative.
    """
    maps = dict(_maps(pupil, wavelength))
    if not maps:
        return None
    inner = np.concatenate([*(knots for _, knots in maps.values()), _borders_of_pixels(pupil)])
    inner = np.unique(inner[np.abs(inner) < 1 - APART])
    kept = inner[np.diff(inner, prepend=-1.0) > APART]
    paths = len(maps.keys() - {"mask"})
    # A derivative with respect to a sample of the relief or wavefront is a spline, times the mask, which may be a
    # spline as well.
    splines = 2 if paths and "mask" in maps else 1
    sizes = ", ".join(f"{name}: {rows} x {columns}" for name, ((rows, columns), _) in maps.items())
    return DerivativeKnots((-1.0, *kept.tolist(), 1.0), splines, sizes, tuple(maps))


def carries_derivatives(beam: Beam) -> bool:
    """Return True if a derivative is requested with respect to any input of the beam.

    Such inputs are the distance of the sensor plane, the distance and angle of the source, and the radius, focal
    length, relief, refractive index, wavefront and mask of the pupil.
    """
    pupil = beam.pupil
    numbers: list[Any] = [pupil.aperture_radius, pupil.thin_lens_focal_length, beam.distance, beam.source.distance]
    numbers += beam.source.angle
    numbers += [pupil.mask.waist] if isinstance(pupil.mask, GaussianMask) else []
    numbers += [pupil.mask.samples] if isinstance(pupil.mask, MaskMap) else []
    numbers += [pupil.wavefront.samples] if isinstance(pupil.wavefront, WavefrontMap) else []
    if isinstance(pupil.wavefront, Zernike):
        given = pupil.wavefront.coefficients_um
        numbers += list(given.values()) if isinstance(given, dict) else [given]
    return any(map(carries_derivative, numbers)) or _index_carries(pupil) or _relief_carries(pupil.height)


def _maps(pupil: Pupil, wavelength: float) -> Iterator[tuple[str, tuple[tuple[int, int], np.ndarray]]]:
    """Yield the name, shape (rows, columns) and knots of each map whose derivatives are requested.

    The knots are positions in units of the pupil's radius.
    """
    relief, wavefront, mask = pupil.height, pupil.wavefront, pupil.mask
    bent = isinstance(relief, HeightMap) and pupil.bends(wavelength)
    if bent and (carries_derivative(relief.samples) or _index_carries(pupil)):
        yield "height", _knots(relief.samples, 1.0)
    if isinstance(wavefront, WavefrontMap) and carries_derivative(wavefront.samples):
        yield "wavefront", _knots(wavefront.samples, _ratio(wavefront.radius, pupil))
    if isinstance(mask, MaskMap) and carries_derivative(mask.samples):
        yield "mask", _knots(mask.samples, _ratio(mask.reach, pupil))


def _knots(samples: Any, side: float) -> tuple[tuple[int, int], np.ndarray]:
    """Return the shape of a map, and the positions of its rows and columns, which are the knots of the spline.

    side: half the side of the map, in the unit of the positions.
    """
    rows, columns = samples.shape
    return (rows, columns), side * np.union1d(*((np.arange(n) + 0.5) * 2 / n - 1 for n in (rows, columns)))


def _ratio(half_side: float | None, pupil: Pupil) -> float:
    return 1.0 if half_side is None else half_side / pupil.radius


def _borders_of_pixels(pupil: Pupil) -> np.ndarray:
    return np.arange(1, pupil.pixels) * 2 / max(pupil.pixels, 1) - 1


def _index_carries(pupil: Pupil) -> bool:
    curve = pupil.n
    if isinstance(curve, RefractiveIndex):
        return carries_derivative(curve.a) or carries_derivative(curve.b)
    return curve.is_differentiable


def _relief_carries(relief: Relief | None) -> bool:
    if relief is None:
        return False
    if isinstance(relief, BSplineRelief):
        return carries_derivative(relief.control_points)
    if hasattr(relief, "samples"):
        return carries_derivative(relief.samples)
    types = precision("float64")
    return carries_derivative(relief.height(types.Float64(0), types.Float64(0)))
