"""PSFs inside a PyTorch graph. Gradients flow from a loss on the PSF back to the relief.

lens = optics.torch.PointSpread(radius=30e-6, sensor_distance=240e-6, wavelengths=[550e-9], dx=1e-6, shape=(33, 33))
psf = lens()                    # torch tensor (wavelength, y, x)
loss(psf).backward()            # fills lens.relief.grad
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import torch

from optics.elements.pupil import Pupil
from optics.elements.relief import BSplineRelief, HeightMap
from optics.numerics.arguments import of_kind, vacuum_wavelengths
from optics.numerics.autodiff import Array, Scalar
from optics.numerics.backend import BackendError
from optics.numerics.device import VARIABLE, make_ready
from optics.numerics.number_types import full_precision
from optics.numerics.precision import precision
from optics.point_spread.psf import psf as drjit_psf

__all__ = ["PointSpread", "psf"]


def psf(
    heights: torch.Tensor, *, radius: Any, n: Any = 1.5, pupil: dict[str, Any] | None = None, **view: Any
) -> torch.Tensor:
    """Return `optics.psf` of a relief as a torch tensor that is differentiable with respect to the heights.

    heights: heights [m]. A (4, 4) tensor holds the control points of a BSplineRelief. A square tensor of any other size
        holds the samples of a HeightMap.
    radius, n: radius [m] of the pupil and refractive index of the relief. If they are one-element tensors, gradients
        flow back to them, too.
    pupil: further arguments of `optics.Pupil`, as a dictionary.
    view: arguments of `optics.psf` except the pupil.

    Returns a tensor (wavelength, y, x) [1/m²]. It is float32 unless dtype="float64".

    Raises:
        ValueError: see `optics.psf`.
        AccuracyError: see `optics.psf`.
        BackendError: RHABDOM_DEVICE requires a GPU that torch cannot use.
    """
    import drjit as dr

    of_kind("heights", heights, torch.Tensor, "torch.zeros(4, 4)")
    place = _place()
    if view.get("field"):
        raise ValueError("field: only `optics.psf` returns it; this function returns the intensity")
    precision(view.get("dtype", "float32"))  # refuses other types

    @dr.wrap(source="torch", target="drjit")
    def spread(heights: Array, radius: Scalar, n: Scalar) -> Array:
        relief = BSplineRelief(heights) if heights.shape == (4, 4) else HeightMap(heights)
        return drjit_psf(Pupil(radius, relief, n=n, **(pupil or {})), **view).tensor

    tensor: torch.Tensor = spread(
        _moved("heights", heights, place), _moved("radius", radius, place), _moved("n", n, place)
    )
    return tensor.to(heights.device)


def _place() -> str:
    """Return the torch name of the device on which optics computes.

    Raises:
        BackendError: Dr.Jit or this build of torch cannot compute on this device.
    """
    place = make_ready()
    if place == "cuda" and not torch.cuda.is_available():
        raise BackendError(f"{VARIABLE} requires a GPU, but this torch has none: must be cpu, or torch built for CUDA")
    return place


def _moved(name: str, value: Any, place: str) -> Any:
    value = full_precision(name, value)
    return value.double().to(place) if isinstance(value, torch.Tensor) else value


class PointSpread(torch.nn.Module):
    """Module with a learnable relief: forward() returns the pupil's PSF, (wavelength, y, x).

    radius: radius [m] of the pupil.
    wavelengths, sensor_distance, dx, shape, ...: arguments of `optics.psf`.
    heights: initial heights [m], (4, 4) control points (default: flat) or (n, n) samples.
    unit: length [m] of one unit of the learnt parameter. Choose it such that the parameter is near 1, as optimisers
        expect.

    The only learnt parameter is `relief`, which equals heights / unit.
    """

    def __init__(
        self,
        radius: float,
        wavelengths: Sequence[float] | float = (550e-9,),
        *,
        heights: torch.Tensor | None = None,
        n: float = 1.5,
        unit: float = 1e-6,
        **view: Any,
    ) -> None:
        super().__init__()
        if heights is not None:
            of_kind("heights", heights, torch.Tensor, "torch.zeros(4, 4)")
        known = torch.zeros(4, 4) if heights is None else full_precision("heights", heights)
        start = known.detach().double()
        self.relief = torch.nn.Parameter(start / unit)
        self.radius, self.n, self.unit = radius, n, unit
        self.view = {"wavelengths": vacuum_wavelengths(wavelengths), **view}

    @property
    def heights(self) -> torch.Tensor:
        """Heights [m] of the relief: the learnt parameter times its unit."""
        return self.relief * self.unit

    def forward(self) -> torch.Tensor:
        return psf(self.heights, radius=self.radius, n=self.n, **self.view)
