"""Calls of `psf` and `PointSpread` with a tensor of heights, as before they accepted pupils and reliefs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import torch

from optics.elements.pupil import Pupil
from optics.elements.relief import BSplineRelief, HeightMap, Relief
from optics.numerics.arguments import of_kind
from optics.numerics.number_types import full_precision
from optics.numerics.renamed import warn_once

__all__ = ["FORMER", "former_pupil", "guessed_relief"]

FORMER = "heights", "radius", "n", "pupil"  # arguments that `psf` had before it accepted pupils


def former_pupil(heights: Any, given: Mapping[str, Any]) -> Any:
    """Return the pupil of a call that passes heights and arguments of `Pupil`."""
    if heights is None and given.keys() == {"pupil"}:
        return given["pupil"]
    heights = of_kind("heights", given.get("heights", heights), torch.Tensor, "torch.zeros(4, 4)")
    if "radius" not in given:
        raise ValueError("radius is missing: must be that of the pupil [m]; or pass optics.Pupil(radius, heights)")
    radius, n = (full_precision(name, given.get(name, 1.5)) for name in ("radius", "n"))
    return Pupil(radius, guessed_relief(heights, 5), n=n, **(given.get("pupil") or {}))


def guessed_relief(heights: torch.Tensor, stacklevel: int) -> Relief:
    """Return the relief for a tensor of heights in a former call: 4 x 4 heights are control points.

    stacklevel: number of calls from `warnings.warn` to the user's code.
    """
    full_precision("heights", heights)
    if heights.shape != (4, 4):
        return HeightMap(heights)
    warn_once(
        "heights of optics.torch",
        "heights of 4 x 4 are taken as control points: pass optics.BSplineRelief(heights) in a Pupil to say so, or "
        "optics.HeightMap(heights) for samples; the guess will be removed in version 0.3",
        stacklevel,
    )
    return BSplineRelief(heights)
