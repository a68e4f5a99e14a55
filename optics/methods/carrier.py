"""The phase of a spherical wave from the pupil's centre. Without this phase, fields are easier to interpolate."""

from __future__ import annotations

from optics.elements.beam import Beam
from optics.methods.problem import Problem
from optics.numerics.autodiff import Array
from optics.numerics.field import Field
from optics.numerics.precision import opaque, padded_for_packets, precision
from optics.numerics.radial_profile import DistinctRadii, RadialProfile

__all__ = ["on_line", "on_window", "with_sphere"]


def with_sphere(field: Field, x: Array, y: Array, beam: Beam, problem: Problem, sign: int) -> Field:
    """Return the field times e^{±ik(ρ - z)} at points (x, y) [m].

    ρ is the distance of the point from the pupil's centre, z the distance between the planes of the pupil and the
    window, and k the wave number behind the pupil. ρ - z is computed as (x² + y²)/(ρ + z).

    sign: sign of the exponent.
    """
    import drjit as dr

    types = precision(problem.dtype)
    z, r2 = opaque(types, beam.distance), x * x + y * y
    waves = r2 / (dr.sqrt(r2 + z * z) + z) * opaque(types, sign / problem.wavelength)
    return field * Field.from_waves(1.0, waves, field.grid, types)


def on_window(field: Field, beam: Beam, problem: Problem) -> Field:
    """Return a field over the window times e^{ik(ρ - z)}, the phase factor of a spherical wave, see `with_sphere`.

    ρ is the distance of a point of the window from the pupil's centre, and z the distance between the planes of the
    pupil and the window. k is the wave number behind the pupil.
    """
    x, y = problem.window.coordinates(precision(problem.dtype))
    return with_sphere(field, x, y, beam, problem, +1)


def on_line(profile: Field, line: RadialProfile | DistinctRadii, beam: Beam, problem: Problem) -> Field:
    """Return a rotationally symmetric field over the window, interpolated from the field's values at some radii.

    The spherical phase is removed before the interpolation and restored afterwards. Without this phase, the field is as
    smooth as the intensity.

    profile: field at the radii `line.positions`, including its spherical phase.
    """
    types, window = precision(problem.dtype), problem.window
    r = types.Float64(padded_for_packets(line.positions))
    slow = with_sphere(profile, r, 0 * r, beam, problem, -1)
    re, im = (line.onto(part, window, types, signed=True) for part in (slow.re, slow.im))
    return on_window(Field(re, im, window, types), beam, problem)
