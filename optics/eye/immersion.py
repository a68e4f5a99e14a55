"""Eyes in water."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from optics.elements.pupil import MIDDLE
from optics.elements.turbid_medium import TurbidMedium
from optics.eye.eye_spec import EyeSpec
from optics.numerics.arguments import of_kind

__all__ = ["immersed"]


def immersed(eye: Any, medium: TurbidMedium | None) -> Any:
    """Return an eye that is immersed in a medium.

    The medium is in front of the pupil (`Pupil.object_n`). A refracting surface between air and the eye, such as a
    cornea, therefore loses power. The retina and its receptors do not move, so the field of view changes: tan(fov/2) is
    multiplied by n/n', where n is the former index in front of the pupil and n' the index of the medium, both at 550
    nm. A pupil without `object_n` has the same medium on both sides. The medium then also fills the eye, and the field
    of view does not change. A perfect lens is perfect in every medium. Air and fog have no effect.

    eye: an `optics.Eye`
    medium: the medium in front of the pupil; None: air

    Raises:
        ValueError: an argument has the wrong type, or the new field of view is outside [1e-3, 170] degrees.
    """
    of_kind("eye", eye, EyeSpec, "optics.Eye()")
    if medium is not None:
        of_kind("medium", medium, TurbidMedium, "optics.sea_water(1), or None")
    pupil = eye.pupil
    if medium is None or medium.refractive_index is None or pupil is None:
        return eye
    index = medium.refractive_index
    if pupil.object_n is None:
        return replace(eye, pupil=replace(pupil, medium_n=index))
    ratio = index.at(MIDDLE) / pupil.index_before(MIDDLE)
    upright = eye.vertical_fov_deg
    return replace(
        eye,
        pupil=replace(pupil, object_n=index),
        fov_deg=_narrower(eye.fov_deg, ratio),
        vertical_fov_deg=None if upright is None else _narrower(upright, ratio),
        density=eye.lattice,
    )


def _narrower(fov_deg: float, ratio: float) -> float:
    """Return the field of view [degrees] that a retina has after its focal length is multiplied by `ratio`."""
    return math.degrees(2 * math.atan(math.tan(math.radians(fov_deg) / 2) / ratio))
