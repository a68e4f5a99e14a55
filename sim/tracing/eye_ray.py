"""A ray from an eye into the scene, and data about its eye, which functions of the renderer pass to each other."""

from __future__ import annotations

from dataclasses import dataclass

from optics.numerics.autodiff import Array


@dataclass(frozen=True)
class EyeRay:
    """A ray, with the axis and the body of its eye.

    ray: ray from the pupil into the scene (Ray3f)
    axis: axis of the eye (Vector3f)
    cosine: cosine of the angle between the ray and the axis
    body: position of the body that carries the eyes (Point3f), if the eyes stand upright on one body; otherwise the
        pupil
    """

    ray: Array
    axis: Array
    cosine: Array
    body: Array
