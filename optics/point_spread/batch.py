"""PSFs of many eyes at many wavelengths and source depths, at once."""

from __future__ import annotations

import math
from collections.abc import Sequence, Sized
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from optics.elements.pupil import Pupil
from optics.elements.source import PointSource
from optics.numerics.accuracy import Plan
from optics.numerics.arguments import shown, vacuum_wavelength
from optics.numerics.autodiff import Array, Scalar, number
from optics.numerics.grid import Grid
from optics.numerics.precision import precision
from optics.point_spread.pictures import pictures
from optics.point_spread.request import Setup

__all__ = ["PSFBatch", "psf_batch"]


@dataclass(frozen=True, eq=False)
class PSFBatch:
    """tensor: PSFs [1/m²] in Dr.Jit, (eye, depth, wavelength, y, x), with derivatives; psf: the same in NumPy.

    plans: of the same order, flat. See PSFResult.
    """

    tensor: Array
    dx: float
    plans: tuple[Plan, ...]

    @cached_property
    def psf(self) -> np.ndarray:
        return np.asarray(self.tensor.numpy())

    @property
    def plan(self) -> Plan:
        """The least accurate."""
        return max(self.plans, key=lambda plan: plan.predicted_error)


def psf_batch(
    pupils: Sequence[Pupil],
    wavelengths: Sequence[float] = (550e-9,),
    sensor_distance: Scalar | None = None,
    source_distances: Sequence[Scalar] = (math.inf,),
    *,
    dx: float = 0.25e-6,
    shape: tuple[int, int] = (129, 129),
    tolerance: float = 1e-3,
    method: str = "auto",
    dtype: str = "float32",
) -> PSFBatch:
    """`optics.psf` of every pupil, source on the axis at every distance [m] and vacuum wavelength [m], over one window.

    sensor_distance: None: where each pupil's ideal lens images the first source; see `optics.psf`.

    Nothing is computed before everything is planned, and each picture is being computed while the next is prepared.

    Raises:
        ValueError: a bad argument, or an empty sequence.
        AccuracyError: see `optics.psf`.
    """
    import drjit as dr

    for name, values in (("pupils", pupils), ("wavelengths", wavelengths), ("source_distances", source_distances)):
        if not isinstance(values, Sized) or len(values) == 0:
            raise ValueError(f"{name} = {shown(values)}: must be a sequence of at least one")
    window = Grid(shape, dx)
    sources = [PointSource(depth) for depth in source_distances]
    requests = []
    for pupil in pupils:
        first = number(sources[0].distance)
        at = pupil.image_distance(first) if sensor_distance is None else sensor_distance
        setups = [Setup(at, source, window, tolerance, method, dtype) for source in sources]
        requests += [setup.request(pupil, vacuum_wavelength(each)) for setup in setups for each in wavelengths]
    flat, plans = zip(*pictures(requests), strict=True)
    whole = flat[0] if len(flat) == 1 else dr.concat(flat)
    sizes = len(pupils), len(source_distances), len(wavelengths), *window.shape
    return PSFBatch(precision(dtype).Tensor(whole, sizes), window.dx, tuple(plans))
