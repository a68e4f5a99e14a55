"""Elements of a system, and the light in front of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from optics.elements.pupil import Pupil
from optics.elements.refractive_index import Dispersion
from optics.elements.torch_numbers import torch_numbers
from optics.numerics.arguments import complexes, in_range, positive, shape_2d
from optics.numerics.autodiff import Scalar, number, of_torch
from optics.numerics.grid import Grid
from optics.propagation.misalignment import Misaligned
from optics.propagation.plane_step import PlaneField, Stop

__all__ = ["Element", "FreeSpace", "light_in_front", "medium_index", "stops_of"]


@dataclass(frozen=True)
class FreeSpace:
    """Free space: a `distance` [m] in a medium with the refractive index medium_n.

    The distance may be a Dr.Jit array that carries a derivative.

    Raises:
        ValueError: an argument is outside its valid range, which the message states.
    """

    distance: Scalar
    medium_n: float = 1.0

    def __post_init__(self) -> None:
        if of_torch(self.distance):
            raise ValueError("distance requires a derivative of PyTorch: must be a number or a Dr.Jit array")
        positive("distance", self.distance, carried=True)
        in_range("medium_n", self.medium_n, 1.0, 10.0)


Element = Pupil | Misaligned | FreeSpace


def light_in_front(
    u: np.ndarray | None, dx: float | None, out_dx: float | None, out_shape: tuple[int, int] | None
) -> tuple[PlaneField | None, Grid, float]:
    """Return a tuple: the field in front of the first stop, the output window, and the largest modulus of the field.

    The field is None if a source illuminates the first pupil. Otherwise it is divided by its largest modulus, because
    float32 cannot represent the power of every field. A ValueError names an invalid argument.
    """
    if u is None:
        if out_dx is None or out_shape is None:
            raise ValueError("out_dx, out_shape: must be given if u is not")
        return None, Grid(shape_2d("out_shape", out_shape), positive("out_dx", out_dx)), 1.0
    samples = complexes("u", u)
    if samples.ndim != 2 or samples.size == 0 or not np.isfinite(samples).all():
        raise ValueError(f"u has shape {samples.shape}: must be (y, x), not empty, and finite everywhere")
    if dx is None:
        raise ValueError("dx: must be given with u")
    brightest = float(np.abs(samples).max()) or 1.0
    field = PlaneField(samples / brightest, positive("dx", dx), math.sqrt(0.5) / dx, math.sqrt(0.5) / dx)
    shape = (samples.shape[0], samples.shape[1]) if out_shape is None else shape_2d("out_shape", out_shape)
    window = Grid(shape, field.dx if out_dx is None else positive("out_dx", out_dx))
    return field, window, brightest


def stops_of(elements: Sequence[Element], backward: bool, window: Grid) -> list[Stop]:
    """Return the stops: the pupils, each with the distance in front of it, and the output window as the last stop.

    The lengths of adjacent elements of free space are added, which is exact. Pupils that touch raise a ValueError.
    """
    if not elements:
        raise ValueError("elements is empty: must hold at least one Pupil or FreeSpace")
    stops: list[Stop] = []
    sign, touching = -1 if backward else 1, False
    distance: Scalar = 0.0
    for element in reversed(elements) if backward else elements:
        if isinstance(element, FreeSpace):
            distance, touching = distance + sign * element.distance, False
        elif not isinstance(element, (Pupil, Misaligned)):
            raise ValueError(f"elements holds {element!r}: must be Pupil, Misaligned or FreeSpace")
        elif torch_numbers(element):
            raise ValueError("elements: a pupil requires a derivative of PyTorch, but only those of Dr.Jit are carried")
        elif touching:
            raise ValueError("elements: two pupils touch; put FreeSpace between them, or make them one Pupil")
        else:
            stops.append(Stop.at(element, distance))
            distance, touching = 0.0, True
    return [*stops, Stop(number(distance), None, window.half_width, window, along=distance)]


def medium_index(elements: Sequence[Element]) -> float:
    """Return the refractive index of the medium; ValueError unless it is the same for all elements."""
    found = set()
    for element in (one.pupil if isinstance(one, Misaligned) else one for one in elements):
        index = element.medium_n
        if isinstance(index, Dispersion) or (isinstance(element, Pupil) and element.object_n is not None):
            raise ValueError(
                "elements: only psf supports dispersive media, and media that differ before and behind a pupil"
            )
        found.add(float(index))
    media = sorted(found)
    if len(media) > 1:
        raise ValueError(f"medium_n = {', '.join(f'{n:g}' for n in media)}: must be the same throughout the elements")
    return media[0]
