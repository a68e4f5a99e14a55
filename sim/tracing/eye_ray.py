"""A ray that leaves an eye, inside a kernel."""

from __future__ import annotations

from dataclasses import dataclass

from optics.numerics.autodiff import Array


@dataclass(frozen=True)
class EyeRay:
    """ray: from the pupil into the scene (Ray3f) · axis: of the eye (Vector3f) · cosine: of the angle between the two

    body: place of the eyes' body (Point3f) if they stand upright on one; otherwise the pupil
    """

    ray: Array
    axis: Array
    cosine: Array
    body: Array
