"""The field behind a system, with the power and the accuracy of each step."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from optics.numerics.accuracy import Plan
from optics.numerics.autodiff import Array
from optics.numerics.grid import Grid, OnWindow
from optics.numerics.read_only import ReadOnlyArrays

__all__ = ["StackResult", "SystemStep"]


@dataclass(frozen=True)
class SystemStep:
    """Power and accuracy of one step: the propagation to the next plane.

    distance: distance [m] of the step, negative for backward propagation.
    plan: plan of the step. Its predicted error is relative to the light within the next plane's window.
    power_in, power_out: power [intensity m²] at the start, and power that arrives within the window.
    evanescent_power: fraction of power_in in waves that do not propagate (see PropagationResult). This fraction is a
        lower bound, because the samples omit some of the waves that cannot reach the next plane.
    """

    distance: float
    plan: Plan
    power_in: float
    power_out: float
    evanescent_power: float


@dataclass(frozen=True, eq=False)
class StackResult(ReadOnlyArrays, OnWindow):
    """The field behind a system of pupils and free space.

    u: complex field (y, x) at the pitch dx [m], including the carrier exp(ikz). Sample n//2 is on the axis.
    steps: power and accuracy of each propagation from plane to plane.
    predicted_error: relative L2 error of the intensity.
    window: grid of the samples [m]; `x` and `y` are the positions of its columns and rows.
    field_parts: real and imaginary part of u as Dr.Jit tensors (y, x) with the derivatives of the system's parameters;
        None if no parameter carries a derivative.
    """

    u: np.ndarray
    dx: float
    steps: tuple[SystemStep, ...]
    predicted_error: float
    window: Grid
    field_parts: tuple[Array, Array] | None
    _intensity: Array | None = field(repr=False)

    @property
    def tensor(self) -> np.ndarray | Array:
        """Intensity |u|², (y, x): a Dr.Jit tensor with derivatives if a parameter carries one, else a NumPy array."""
        return np.square(self.u.real) + np.square(self.u.imag) if self._intensity is None else self._intensity

    def __repr__(self) -> str:
        size = " x ".join(map(str, self.u.shape))
        error = f"predicted error {self.predicted_error:.1e}"
        return f"<StackResult of {size} samples {self.dx:.3g} m apart, {len(self.steps)} steps, {error}>"
