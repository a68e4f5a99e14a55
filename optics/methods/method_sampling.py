"""The interface of all methods: samples with which a method meets a tolerance, and the PSF from these samples."""

from __future__ import annotations

from typing import Protocol

from optics.elements.beam import Beam
from optics.methods.problem import Problem
from optics.numerics.autodiff import Array
from optics.numerics.field import Field

__all__ = ["Sampling", "WithField"]


class WithField(Protocol):
    """The additional interface of all exact methods except "far_field": the complex field."""

    def field(self, beam: Beam, problem: Problem) -> Field:
        """Return the field for unit amplitude at the pupil, without the carrier e^{ikz} of a plane wave."""


class Sampling(Protocol):
    """Samples with which one method solves a problem.

    `seconds` is the predicted time on two cores, without the time of compilation.
    """

    @property
    def method(self) -> str: ...

    @property
    def seconds(self) -> float: ...

    @property
    def samples(self) -> tuple[int, int]:
        """Numbers of samples of the pupil (y, x), or numbers of nodes: (radial, angular), or (nodes, 1)."""

    @property
    def padding(self) -> float:
        """Period of the pupil's transform, in samples, divided by the number of samples; 1 without a period."""

    @property
    def bytes(self) -> float:
        """Predicted memory of the method at its peak, without the arrays of the window (`window_cost`)."""

    @property
    def model_error(self) -> float:
        """Relative L2 error of the intensity with infinitely many samples; 0 for exact methods."""

    def intensity(self, beam: Beam, problem: Problem) -> Array:
        """Return the intensity over the window, for unit amplitude at the pupil, as a flat Dr.Jit array."""

    def plane(self, problem: Problem) -> float:
        """Return the width [m] of the square over which rounding errors are spread.

        Rounding errors have a fraction of the power of all light. Spread evenly over the square, this power has the
        intensity power / width². Within the window, rounding errors are therefore smaller if the square is wider.
        """
