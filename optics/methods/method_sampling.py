"""What every method gives: the samples by which it meets a tolerance, and the picture that it makes of them."""

from __future__ import annotations

from typing import Protocol

from optics.elements.beam import Beam
from optics.methods.problem import Problem
from optics.numerics.autodiff import Array
from optics.numerics.field import Field

__all__ = ["Sampling", "WithField"]


class WithField(Protocol):
    """What exact methods but "far_field" give besides."""

    def field(self, beam: Beam, problem: Problem) -> Field:
        """U over the window for unit amplitude at the pupil, less the carrier e^{ikz}."""


class Sampling(Protocol):
    """How one method samples a problem; its time is predicted for a warm kernel on two cores."""

    @property
    def method(self) -> str: ...

    @property
    def seconds(self) -> float: ...

    @property
    def samples(self) -> tuple[int, int]:
        """(y, x) samples of the pupil, or (radial, angular) nodes, or (nodes, 1)."""

    @property
    def padding(self) -> float:
        """Period of the pupil's transform over its samples; 1 where nothing is periodic."""

    @property
    def largest(self) -> int:
        """Side of the largest square array."""

    @property
    def model_error(self) -> float:
        """Relative L2 error of the intensity that the method would make with any number of samples: 0 if exact."""

    def intensity(self, beam: Beam, problem: Problem) -> Array:
        """|U|² over the window for unit amplitude at the pupil, a flat Dr.Jit array."""

    def plane(self, problem: Problem) -> float:
        """Width [m] over which rounding spreads the pupil's light."""
