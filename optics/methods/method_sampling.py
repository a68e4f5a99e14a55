"""The interface of all methods: samples with which a method meets a tolerance, and the PSF from these samples."""

from __future__ import annotations

from typing import Protocol

from optics.elements.beam import Beam
from optics.methods.problem import Problem
from optics.numerics.autodiff import Array
from optics.numerics.field import Field

__all__ = ["Sampling", "WithField"]


class WithField(Protocol):
    """Interface of samplings that can compute the complex field, not only the intensity.

    The samplings of all exact methods except "far_field" have this interface.
    """

    def field(self, beam: Beam, problem: Problem) -> Field:
        """Return the field for unit amplitude at the pupil, without the carrier e^{ikz} of a plane wave."""


class Sampling(Protocol):
    """Plan of one method for the propagation from a pupil to a window: samples of the pupil, and predicted cost.

    `seconds` is the predicted time on two cores, without the time of compilation.
    """

    @property
    def method(self) -> str: ...

    @property
    def seconds(self) -> float: ...

    @property
    def samples(self) -> tuple[int, int]:
        """Numbers of samples of the pupil along y and along x.

        If the samples are no grid, the value is (number of samples, 1). For the method "hankel", it is (number of radii
        in the pupil, number of angles in the spectrum).
        """

    @property
    def padding(self) -> float:
        """Padding: period of the pupil's Fourier transform, in samples, divided by the samples across the pupil.

        The value is 1 for methods without a padded transform.
        """

    @property
    def bytes(self) -> float:
        """Predicted peak memory of the propagation, without the arrays over the window that `window_cost` counts."""

    @property
    def model_error(self) -> float:
        """Relative L2 error of the intensity with infinitely many samples; 0 for exact methods."""

    def intensity(self, beam: Beam, problem: Problem) -> Array:
        """Return the intensity over the window, for unit amplitude at the pupil, as a flat Dr.Jit array."""

    def plane(self, problem: Problem) -> float:
        """Return the width [m] of the square over which rounding errors are assumed to be evenly spread.

        The square lies in the plane of the window. The total power of rounding errors is the power of all light times
        a number that depends on the number type. The intensity of rounding errors is taken to be this total power
        divided by width². Within the window, rounding errors are therefore smaller if the square is wider.
        """
