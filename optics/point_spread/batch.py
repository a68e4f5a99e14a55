"""PSFs of many eyes at many wavelengths and source depths at once."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from optics.elements.beam import Beam
from optics.elements.pupil import Pupil
from optics.elements.source import PointSource
from optics.numerics.accuracy import Plan
from optics.numerics.arguments import (
    in_range,
    is_sized,
    of_kind,
    positive,
    shown,
    vacuum_wavelength,
    whole,
    without_derivative,
)
from optics.numerics.autodiff import Array, Scalar
from optics.numerics.grid import Grid, OnWindow
from optics.numerics.precision import Precision, padded_for_packets, precision
from optics.numerics.read_only import read_only
from optics.point_spread.coarse_batch import coarse_psfs
from optics.point_spread.pictures import pictures
from optics.point_spread.psf_result import PSFResult
from optics.point_spread.request import Request, Setup, sensor_place
from optics.point_spread.window_cost import check_window

__all__ = ["PSFBatch", "psf_batch"]


@dataclass(frozen=True, eq=False)
class PSFBatch(OnWindow):
    """PSFs of many eyes, at several source distances (depths) and wavelengths.

    tensor: PSFs [1/m²] as a Dr.Jit tensor with derivatives, (eye, depth, wavelength, y, x).
    psf: the same as a NumPy array.
    dx: pitch [m] of the samples.
    plans: one plan per PSF, in the same order, as a flat tuple.
    members: for each PSF, the beam from which it was computed, in the order of `plans`. A beam states the pupil, the
        source, the wavelength and the sensor's distance.
    setup: window, tolerance, method and dtype, which all PSFs share. The source and the sensor's distance in `setup`
        are those of the first PSF only.

    See PSFResult for conventions.
    """

    tensor: Array
    dx: float
    plans: tuple[Plan, ...]
    members: tuple[Beam, ...]
    setup: Setup

    def __repr__(self) -> str:
        size = " x ".join(map(str, self.tensor.shape))
        error = f"predicted error {self.plan.predicted_error:.1e} at most"
        return f"<PSFBatch of {size} samples {self.dx:.3g} m apart, {error}>"

    @property
    def window(self) -> Grid:
        """Positions of the samples on the sensor [m]."""
        return self.setup.window

    def result(self, eye: int, depth: int = 0) -> PSFResult:
        """Return the PSFs of one eye at one depth as a PSFResult, for `optics.strehl_ratio` and other measures.

        Raises:
            ValueError: the eye or depth does not exist.
        """
        eyes, depths, waves = self.tensor.shape[:3]
        eye, depth = whole("eye", eye, 0, eyes - 1), whole("depth", depth, 0, depths - 1)
        place = eye * depths + depth
        mine = slice(place * waves, (place + 1) * waves)
        members = self.members[mine]
        return PSFResult(
            self.tensor[eye, depth],
            self.dx,
            np.array([member.wavelength for member in members]),
            members[0].distance,
            members[0].pupil,
            self.plans[mine],
            self.setup.window.centre,
            tuple(_request(member, self.setup) for member in members),
        )

    @cached_property
    def psf(self) -> np.ndarray:
        """PSFs [1/m²], (eye, depth, wavelength, y, x)."""
        return read_only(np.asarray(self.tensor.numpy()))

    @property
    def plan(self) -> Plan:
        """The least accurate plan."""
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
    """Return `optics.psf` of every pupil over one window, for every source distance and wavelength.

    pupils: one pupil per eye.
    wavelengths: sequence of wavelengths [m] in vacuum.
    sensor_distance: distance [m] of the sensor behind the pupil. None: the distance at which each pupil's ideal lens
        images the first source, see `optics.psf`.
    source_distances: sequence of distances [m] of sources on the axis.
    dx, shape, tolerance, method, dtype: see `optics.psf`.

    At tolerances of 3e-4 or more, with the method "auto", "exact" or "low_rank", the samples for all PSFs are chosen
    together, and PSFs with equal numbers of samples are computed as stacks of matrix products. The error of each PSF is
    checked. The following PSFs are computed one by one: those at smaller tolerances or with other methods, those of
    pupils with derivatives or with a `PixelRelief`, and those that would otherwise be inaccurate or take long. For each
    of these, a method and its samples are chosen. All choices are made before the first of these PSFs is computed.

    Raises:
        ValueError: an argument is invalid, or a sequence is empty.
        AccuracyError: see `optics.psf`.
        BackendError: see `optics.psf`.
    """
    for name, values in (("pupils", pupils), ("wavelengths", wavelengths), ("source_distances", source_distances)):
        if not is_sized(values) or len(values) == 0:
            raise ValueError(f"{name} = {shown(values)}: must be a sequence of at least one")
    without_derivative("wavelengths", wavelengths)
    window = Grid(shape, dx)
    in_range("tolerance", tolerance, 1e-12, 0.5)
    members = list(_members(pupils, wavelengths, sensor_distance, source_distances))
    precision(dtype)
    check_window(window, dtype, len(members))
    plain = isinstance(method, str) and method in ("auto", "exact", "low_rank")
    coarse = coarse_psfs(members, window, tolerance, dtype) if plain else ()
    known = {index: (image, plan) for index, image, plan in coarse}
    rest = [index for index in range(len(members)) if index not in known]
    setup = Setup(members[0].distance, members[0].source, window, tolerance, method, dtype)
    requests = [_request(members[index], setup) for index in rest]
    flat, plans = _joined(
        known, {index: picture[:2] for index, picture in zip(rest, pictures(requests), strict=True)}, precision(dtype)
    )
    sizes = len(pupils), len(source_distances), len(wavelengths), *window.shape
    return PSFBatch(precision(dtype).Tensor(flat, sizes), window.dx, tuple(plans), tuple(members), setup)


def _request(member: Beam, setup: Setup) -> Request:
    own = replace(setup, sensor_distance=member.distance, source=member.source)
    return own.request(member.pupil, member.wavelength)


def _members(
    pupils: Sequence[Pupil],
    wavelengths: Sequence[float],
    sensor_distance: Scalar | None,
    source_distances: Sequence[Scalar],
) -> Iterator[Beam]:
    """Yield all combinations of eyes, depths and wavelengths. The wavelength varies fastest."""
    if sensor_distance is not None:
        positive("sensor_distance", sensor_distance, carried=True)
    lambdas = [vacuum_wavelength(wavelength) for wavelength in wavelengths]
    first = PointSource(next(iter(source_distances))).distance
    sources = [PointSource(depth) for depth in source_distances]
    for pupil in pupils:
        of_kind("pupil", pupil, Pupil, "Pupil(25e-6)")
        at = sensor_place(pupil, sensor_distance, first)
        yield from (Beam(pupil, source, wavelength, at) for source in sources for wavelength in lambdas)


def _joined(
    known: dict[int, tuple[np.ndarray, Plan]], rest: dict[int, tuple[Array, Plan]], types: Precision
) -> tuple[Array, list[Plan]]:
    """Return all PSFs as one flat array in the order of their indices, and their plans in the same order.

    known: PSF and plan, by index, of the PSFs that were computed together as stacks of matrix products.
    rest: PSF and plan, by index, of all other PSFs, which were computed one by one.
    """
    import drjit as dr

    both = {**known, **rest}
    plans = [both[index][1] for index in range(len(both))]
    if not rest:
        return types.Float(padded_for_packets(np.stack([known[index][0] for index in range(len(known))]))), plans
    flat = [
        types.Float(padded_for_packets(each)) if isinstance(each, np.ndarray) else each
        for each in (both[index][0] for index in range(len(both)))
    ]
    return (flat[0] if len(flat) == 1 else dr.concat(flat)), plans
