"""What every method gives: the samples by which it meets a tolerance, and the picture that it makes of them."""

from __future__ import annotations

from typing import Protocol

from optics.elements.beam import Beam
from optics.methods.problem import Problem
from optics.numerics.autodiff import Array

__all__ = ["Sampling"]


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
    def largest(self) -> int:
        """Side of the largest square array."""

    @property
    def model_error(self) -> float:
        """Relative L2 error of the intensity that the method would make with any number of samples: 0 if exact."""

    def intensity(self, beam: Beam, problem: Problem) -> Array:
        """|U|² over the window for unit amplitude at the pupil, a flat Dr.Jit array."""

    def plane(self, problem: Problem) -> float:
        """Width [m] over which rounding spreads the pupil's light."""
