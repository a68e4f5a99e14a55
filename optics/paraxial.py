"""The paraxial diffraction integrals: Fresnel's, and Fraunhofer's without the quadratic phase."""

from __future__ import annotations

from typing import Any

from optics.numerics.autodiff import is_tracked, number
from optics.numerics.field import Field
from optics.numerics.fourier import dft2
from optics.numerics.grid import Grid
from optics.numerics.precision import opaque

__all__ = ["paraxial_integral"]


def paraxial_integral(u: Field, distance: Any, wavelength: float, window: Grid, curved: bool = True) -> Field:
    """Field over the window at `distance`, up to a phase that intensity forgets:

    U(x) = 1/(iλz) ∫ u(ξ) e^{iπξ²/λz} e^{-2πi x·ξ/λz} dξ   (Goodman, Introduction to Fourier Optics, eq. 4-17);

    with curved=False the quadratic phase is 1 (eq. 4-25). wavelength [m] in the medium. One Fourier sum of free output
    pitch.
    """
    types, grid = u.types, u.grid
    scale = opaque(types, distance) * opaque(types, wavelength)
    if curved:
        x, y = grid.coordinates(types)
        u = u * Field.from_waves(1.0, (x * x + y * y) * (0.5 / scale), grid, types)
    period = scale if is_tracked(distance) else wavelength * number(distance)
    return dft2(u, period / (grid.dx * window.dx), window.shape, -1, window.dx, window.centre).scaled(
        grid.dx**2 / scale
    )
