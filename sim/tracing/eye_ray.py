"""A ray that leaves an eye, inside a kernel."""

from __future__ import annotations

from dataclasses import dataclass

from optics.numerics.autodiff import Array


@dataclass(frozen=True)
class EyeRay:
    """ray: from the pupil, into the scene (Ray3f) · axis: of the eye (Vector3f) · cosine: between the two

    body: where the eye's body is (Point3f), of eyes that stand upright on one; else the pupil
    """

    ray: Array
    axis: Array
    cosine: Array
    body: Array
