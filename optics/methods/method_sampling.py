"""The interface of all methods: the samples with which a method meets a tolerance, and the PSF from these samples."""

from __future__ import annotations

from typing import Protocol

from optics.elements.beam import Beam
from optics.methods.problem import Problem
from optics.numerics.autodiff import Array
from optics.numerics.field import Field

__all__ = ["Sampling", "WithField"]


class WithField(Protocol):
    """The additional interface of exact methods except "far_field": the complex field."""

    def field(self, beam: Beam, problem: Problem) -> Field:
        """Return U over the window for unit amplitude at the pupil, without the carrier e^{ikz}."""


class Sampling(Protocol):
    """Samples with which one method solves a problem. The predicted time is for a warm kernel on two cores."""

    @property
    def method(self) -> str: ...

    @property
    def seconds(self) -> float: ...

    @property
    def samples(self) -> tuple[int, int]:
        """(y, x) samples of the pupil, or (radial, angular) nodes, or (nodes, 1)."""

    @property
    def padding(self) -> float:
        """Period of the pupil's transform divided by the number of its samples; 1 without a period."""

    @property
    def largest(self) -> int:
        """Side of the largest square array."""

    @property
    def model_error(self) -> float:
        """Relative L2 error of the intensity with infinitely many samples; 0 for exact methods."""

    def intensity(self, beam: Beam, problem: Problem) -> Array:
        """Return |U|² over the window for unit amplitude at the pupil, a flat Dr.Jit array."""

    def plane(self, problem: Problem) -> float:
        """Return the width [m] over which rounding errors spread the pupil's light."""
