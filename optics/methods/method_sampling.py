"""The interface of all methods: samples with which a method meets a tolerance, and the PSF from these samples."""

from __future__ import annotations

from typing import Protocol

from optics.elements.beam import Beam
from optics.methods.problem import Problem
from optics.numerics.autodiff import Array
from optics.numerics.field import Field

__all__ = ["Sampling", "WithField"]


class WithField(Protocol):
    """Interface of samplings that can also compute the complex field: all exact methods except "far_field"."""

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
        """Numbers of samples of the pupil along y and along x.

        For quadrature nodes, the value is (radial nodes, angular nodes) or (number of nodes, 1) instead.
        """

    @property
    def padding(self) -> float:
        """Padding: period of the pupil's Fourier transform, in samples, divided by the samples across the pupil.

        The value is 1 for methods without a padded transform.
        """

    @property
    def bytes(self) -> float:
        """Predicted memory of the method at its peak, without the arrays of the window (`window_cost`)."""

    @property
    def model_error(self) -> float:
        """Relative L2 error of the intensity with infinitely many samples; 0 for exact methods."""

    def intensity(self, beam: Beam, problem: Problem) -> Array:
        """Return the intensity over the window, for unit amplitude at the pupil, as a flat Dr.Jit array."""

    def plane(self, problem: Problem) -> float:
        """Return the width [m] of the square over which rounding errors are taken as evenly spread.

        The square lies in the plane of the window. The power of all rounding errors is a fraction of the power of all
        light, which depends on the number type. Spread evenly over the square, it has the intensity power / width².
        Within the window, rounding errors are therefore smaller if the square is wider.
        """
