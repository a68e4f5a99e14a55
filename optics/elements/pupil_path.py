"""Parts of a pupil's optical path that do not depend on the wavelength.

The sum of these parts, weighted by refractive indices, is the path: see `Pupil.path`. The parts can therefore be
computed once for several wavelengths and sources.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from optics.numerics.array_library import library, like
from optics.numerics.autodiff import Array, Scalar

if TYPE_CHECKING:
    from optics.elements.pupil import Pupil

__all__ = ["lens_path", "relief_height", "wavefront_ahead"]


def lens_path(focal_length: Scalar, x: Array, y: Array) -> Array:
    """Return the length [m] by which an ideal lens shortens the path at points (x, y) [m].

    At the distance r from the axis, this length is √(r² + f²) - f in vacuum if the focal length f is positive. If f is
    negative, it is minus the length for |f|. x and y are arrays as in `Relief.height`.
    """
    f, own = like(x, focal_length), library(x)
    r2 = x * x + y * y
    return r2 / (own.sqrt(r2 + f * f) + own.abs(f)) * own.sign(f)


def relief_height(pupil: Pupil, x: Array, y: Array) -> Array | None:
    """Return the height [m] of the relief at points (x, y) [m]; None without a relief."""
    if pupil.height is None:
        return None
    scale = 1 / like(x, pupil.aperture_radius)
    return pupil.height.height(x * scale, y * scale)


def wavefront_ahead(pupil: Pupil, x: Array, y: Array) -> Array | None:
    """Return the length [m] by which the wavefront is ahead of the ideal one at (x, y) [m]; None without aberration."""
    if pupil.wavefront is None:
        return None
    own = pupil.aperture_radius if pupil.wavefront.radius is None else pupil.wavefront.radius
    scale = 1 / like(x, own)
    return pupil.wavefront.ahead(x * scale, y * scale)
