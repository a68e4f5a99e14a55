"""A module of PyTorch with a learnable relief."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import torch

from optics.elements.pupil import Pupil
from optics.elements.relief import BSplineRelief, Relief
from optics.numerics.arguments import of_kind, shown, vacuum_wavelengths
from optics.numerics.autodiff import plain
from optics.torch.former_calls import guessed_relief
from optics.torch.tensor_psf import psf

__all__ = ["PointSpread"]


class PointSpread(torch.nn.Module):
    """Module with a learnable relief: forward() returns the pupil's PSF, (wavelength, y, x).

    radius: radius [m] of the pupil.
    wavelengths, sensor_distance, dx, shape, ...: arguments of `psf`.
    heights: initial relief, a `BSplineRelief`, `HeightMap` or `PixelRelief`. None: a flat `BSplineRelief`. A tensor of
        heights [m] is interpreted as control points if it is 4 x 4, and otherwise as samples of a `HeightMap`.
    n: refractive index of the relief.
    unit: length [m] of one unit of the learnt parameter. Choose it such that the parameter is near 1, as optimisers
        expect.
    pupil: further arguments of `optics.Pupil`, as a dictionary.

    The only learnt parameter is `relief`, which equals heights / unit.
    """

    def __init__(
        self,
        radius: float,
        wavelengths: Sequence[float] | float = (550e-9,),
        *,
        heights: Relief | torch.Tensor | None = None,
        n: float = 1.5,
        unit: float = 1e-6,
        pupil: Mapping[str, Any] | None = None,
        **view: Any,
    ) -> None:
        super().__init__()
        relief = BSplineRelief(np.zeros((4, 4))) if heights is None else heights
        if not isinstance(relief, Relief):
            relief = guessed_relief(of_kind("heights", heights, torch.Tensor, "torch.zeros(4, 4)"), 4)
        start = relief.control_points if isinstance(relief, BSplineRelief) else getattr(relief, "samples", None)
        if start is None:
            raise ValueError(f"heights = {shown(relief)}: must be a BSplineRelief, HeightMap or PixelRelief")
        self.relief = torch.nn.Parameter(torch.tensor(plain(start)) / unit)
        self._kind: Callable[[torch.Tensor], Relief] = type(relief)
        self.radius, self.n, self.unit, self.pupil = radius, n, unit, dict(pupil or {})
        self.view = {"wavelengths": vacuum_wavelengths(wavelengths), **view}

    @property
    def heights(self) -> torch.Tensor:
        """Heights [m] of the relief: the learnt parameter times its unit."""
        return self.relief * self.unit

    def forward(self) -> torch.Tensor:
        pupil = Pupil(self.radius, self._kind(self.heights), n=self.n, **self.pupil)
        return psf(pupil, device=self.relief.device, **self.view)
