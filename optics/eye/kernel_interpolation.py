"""Number of kernels for a range of distances or directions: the fewest with an acceptable interpolation error.

Kernels are computed at nodes that are evenly spaced over [-1, 1] along every axis, and interpolated linearly between
them. The interpolation error is proportional to the square of the node spacing. It is measured by computing kernels
at points between the nodes. Most of these kernels are reused, because these points are nodes of the next larger set.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from optics.numerics.accuracy import AccuracyError
from optics.numerics.autodiff import Array, plain
from optics.numerics.interpolation import linear_weights

__all__ = ["Choice", "NodeChoice", "NodeError", "nodes", "worst_difference"]

MOST_CHECKS = 8  # choice: largest number of kernels between nodes that are computed to measure the interpolation error
# Places of these kernels in a field of [0, 1]²: the corners, and four places between them in separate rows and columns.
SPREAD = (*itertools.product((0.0, 1.0), repeat=2), (0.2, 0.6), (0.4, 0.2), (0.6, 0.8), (0.8, 0.4))
CAUTION = 1.3  # choice: safety factor on this error, which may be larger at positions that are not measured
Place = tuple[float, ...]


class NodeError(AccuracyError):
    """The interpolation error is above the tolerance even with the largest number of nodes that is tried."""


@dataclass(frozen=True)
class Choice:
    """The numbers of nodes that were chosen for one stage, and the reason for the choice.

    Nodes are the positions for which kernels are computed. One stage is the choice along depth, the other the choice
    along the two axes of the field.

    stage: "depth" or "field".
    counts: number of nodes along each axis of the stage.
    predicted_error: error of a receptor's signal, relative to the signal of a white surface, for any scene at most as
        bright as white. None if the user requested the number.
    why: the reason.
    """

    stage: str
    counts: tuple[int, ...]
    predicted_error: float | None
    why: str

    def __str__(self) -> str:
        error = "not predicted" if self.predicted_error is None else f"error {self.predicted_error:.1e}"
        return f"{self.stage:<7}{' x '.join(map(str, self.counts)):>7}   {error:<15}{self.why}"


def nodes(count: int) -> np.ndarray:
    """Return evenly spaced positions of nodes from -1 to 1; 0 for a single node."""
    return np.linspace(-1, 1, count) if count > 1 else np.zeros(1)


def checks(counts: tuple[int, ...]) -> list[Place]:
    """Return the places at which the interpolation error is measured, for these numbers of nodes along each axis.

    If there is a single node, it lies in the middle. The error is then measured at both ends of the axis or, if there
    are two axes, at the corners of the square [-1, 1]² and at the middles of its sides. With more nodes, it is measured
    halfway between nodes, along every axis with several nodes. If there are many such points, only a few are used. If
    there is one axis, these are evenly spaced. If there are two, they are the points next to all four corners and a few
    between them, because the error of a pupil without symmetry may be largest at any corner.
    """
    if max(counts) == 1:
        return [place for place in _places([nodes(3)] * len(counts)) if any(place)]
    axes = [(nodes(n)[1:] + nodes(n)[:-1]) / 2 if n > 1 else nodes(1) for n in counts]
    found = _places(axes)
    if len(found) <= MOST_CHECKS:
        return found
    shares = SPREAD if len(axes) == 2 else np.linspace(0, 1, MOST_CHECKS)[:, np.newaxis]
    return list(dict.fromkeys(_place(axes, at) for at in shares))


def _place(axes: Sequence[np.ndarray], shares: Iterable[float]) -> Place:
    """Return a point: its coordinate along each axis is selected from the list of positions along this axis.

    axes: list of positions for each axis.
    shares: for each axis, the place of the selected position in its list: 0 for the first position, 1 for the last, and
        a fraction for those between them.
    """
    return tuple(float(axis[round(share * (len(axis) - 1))]) for axis, share in zip(axes, shares, strict=True))


def _places(axes: Iterable[np.ndarray]) -> list[Place]:
    return list(itertools.product(*(map(float, axis) for axis in axes)))


@dataclass(frozen=True)
class NodeChoice:
    """Choice of the number of nodes along depth, or of the numbers along the two axes of the field of view.

    Nodes are the positions for which kernels are computed.

    stage: "depth" or "field".
    kernel_at: function that returns the kernel at a place, which has one coordinate from -1 to 1 for each axis.
    candidates: numbers of nodes to try, in ascending order.
    samples_per_receptor: number of kernel samples along a side of the area over which a receptor averages light.
        Errors of signals are averaged over the same area. 1: errors are not averaged.
    white: function that returns the signal of a white surface, divided by the signal that it would have if no light
        were lost in the pupil or at the receptors. This fraction is less than 1 if the pupil has an absorbing mask, and
        with waveguides. Errors are divided by it. With waveguides, a call of this function takes long, because it
        computes a kernel.
    known: kernels that have been computed, by place.
    """

    stage: str
    kernel_at: Callable[[Place], Array]
    candidates: Sequence[tuple[int, ...]]
    samples_per_receptor: int
    white: Callable[[], float] = lambda: 1.0
    known: dict[Place, np.ndarray] = field(default_factory=dict)

    def choose(self, tolerance: float, most: float | None = None) -> Choice:
        """Return the first candidate whose predicted error is within `most` or, if that is None, the tolerance.

        most: part of the tolerance that is available for the axes of this choice (None: all).

        Raises:
            NodeError: the predicted error of every candidate exceeds this limit.
        """
        error = math.inf
        for counts in self.candidates:
            error = CAUTION * self.error(counts)
            if error <= (tolerance if most is None else most):
                share = "" if most is None else f", of which {most:.2g} is available here"
                return Choice(self.stage, counts, error, f"fewest within the tolerance of {tolerance:g}{share}")
        share = "" if most is None else f", of which {self.stage} may use {most:.2g}"
        nodes_leave = f"{' x '.join(map(str, self.candidates[-1]))} {self.stage} nodes leave"
        raise NodeError(
            f"tolerance = {tolerance:g}{share}: {nodes_leave} {error:.1e} of the signal of white as an error; "
            "increase the tolerance or specify a number of nodes"
        )

    def error(self, counts: tuple[int, ...]) -> float:
        """Return the largest measured interpolation error, relative to the signal of a white surface.

        counts: number of nodes along each axis.
        """
        coarse = _places(nodes(n) for n in counts)
        worst = 0.0
        for place in checks(counts):
            by_axis = [linear_weights(np.asarray(at), nodes(n)) for at, n in zip(place, counts, strict=True)]
            shares = [math.prod(map(float, share)) for share in itertools.product(*by_axis)]
            between = [(s, self._kernel(node)) for s, node in zip(shares, coarse, strict=True) if s > 0]
            worst = max(worst, worst_difference([*between, (-1, self._kernel(place))], self.samples_per_receptor))
        return worst / self.white() if worst > 0 else 0.0

    def _kernel(self, place: Place) -> np.ndarray:
        if place not in self.known:
            self.known[place] = plain(self.kernel_at(place))
        return self.known[place]


def worst_difference(terms: Sequence[tuple[float, np.ndarray]], samples_per_receptor: int) -> float:
    """Return the largest absolute signal of the kernel Σ weight · kernel, over all scenes with radiance in [0, 1].

    It is the sum of the positive values of the combined receptive field (kernel ⊗ receptor aperture), or of the
    magnitudes of its negative values, whichever is larger.

    terms: pairs of a weight and a kernel (band, ky, kx).
    """
    sides = np.max([kernel.shape for _, kernel in terms], axis=0)
    total = np.zeros(sides)
    for share, kernel in terms:
        margins = (sides - kernel.shape) // 2
        inner = tuple(slice(margin, side - margin) for margin, side in zip(margins, sides, strict=True))
        total[inner] += share * kernel
    s = samples_per_receptor
    for _ in range(2):  # convolution with the receptor's aperture along one axis, then along the other
        summed = np.cumsum(np.pad(total, ((0, 0), (0, 0), (s, s - 1))), axis=2)
        total = np.swapaxes(summed[..., s:] - summed[..., :-s], 1, 2) / s
    return float(max(np.maximum(sign * total, 0).sum(axis=(1, 2)).max() for sign in (1, -1)))
