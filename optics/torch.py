"""PSFs and images inside a PyTorch graph. Gradients flow from a loss back to every tensor in the pupil.

psf(pupil, wavelengths, sensor_distance, ...)     PSFs of one or several pupils, as a tensor
camera_image(scene, pupil, sensor, ...)           electrons in the pixels of a camera
eye_signals(eye, radiance, ...)                   signals of an eye's receptors
PointSpread(radius, wavelengths, ...)             module with a learnable relief

heights = torch.zeros(32, 32, dtype=torch.float64, requires_grad=True)    # [m]
pupil = optics.Pupil(30e-6, optics.HeightMap(heights), thin_lens_focal_length=240e-6)
psf = optics.torch.psf(pupil, 550e-9, 240e-6, dx=1e-6, shape=(33, 33))    # tensor (wavelength, y, x)
loss(psf).backward()                                                      # fills heights.grad
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
import torch

from optics.elements.pupil import Pupil
from optics.elements.relief import BSplineRelief, HeightMap, Relief
from optics.elements.torch_numbers import torch_numbers, with_numbers
from optics.eye import camera
from optics.eye.eye import Eye
from optics.eye.sensor_pixels import SensorPixels
from optics.numerics.arguments import flag, in_range, of_kind, shown, vacuum_wavelengths, wavelength_row
from optics.numerics.autodiff import Array, plain
from optics.numerics.grid import Grid
from optics.numerics.number_types import full_precision
from optics.numerics.renamed import warn_once
from optics.numerics.torch_graph import (
    DrJitOperation,
    common_device,
    computing_device,
    on_device,
    once,
    plain_numbers,
)
from optics.point_spread.light_batch import LightBatch, is_row
from optics.point_spread.psf import psf as drjit_psf
from optics.point_spread.psf_result import OF_CELLS

__all__ = ["PointSpread", "camera_image", "eye_signals", "psf"]

FORMER = "heights", "radius", "n", "pupil"  # arguments that `psf` had before it accepted pupils


def psf(
    pupil: Pupil | Sequence[Pupil] | None = None,
    /,
    wavelengths: Sequence[float] | float = (550e-9,),
    sensor_distance: Any = None,
    source_distance: Any = math.inf,
    source_angle: Any = (0.0, 0.0),
    *,
    pixel_means: bool = False,
    requires_grad: bool = False,
    device: torch.device | str | None = None,
    **view: Any,
) -> torch.Tensor:
    """Return `optics.psf` as a tensor with gradients to the tensors in the pupil, the distances and the angle.

    pupil: a pupil, or a sequence of pupils. Some of its numbers may be tensors that require gradients: the radius, the
        refractive index and the focal length, the samples of a `HeightMap`, `PixelRelief`, `WavefrontMap` or `MaskMap`,
        the control points of a `BSplineRelief`, the coefficients of a `Zernike`, and the waist of a `GaussianMask`.
        Tensors that require no gradients are treated as numbers.
    wavelengths: one or several wavelengths [m] in vacuum.
    sensor_distance, source_distance: distances [m] behind and in front of the pupil. Each is a number, or a row of
        numbers: a sequence, or a tensor with one axis. Two rows must have the same length and are used pairwise.
    source_angle: direction (x, y) [rad] in which the light travels: two numbers, or a tensor of two elements.
    pixel_means: True for the mean of the PSF over each square pixel of side dx, as a sensor measures it. False for the
        samples of `optics.psf`.
    requires_grad: True to raise a ValueError if no tensor requires a gradient.
    device: device of the result, and of the computation if no tensor requires a gradient. None: the device of the
        tensors that require gradients, or the CPU if there are none.
    view: dx, shape, tolerance, method, dtype and centre, see `optics.psf`.

    Returns a tensor (pupil, distance, wavelength, y, x) [1/m²], float32 unless dtype="float64". It has an axis of
    pupils only if a sequence of pupils is passed, and an axis of distances only if a distance is a row. Each gradient
    has the device and the precision of its tensor. Only first derivatives are available.

    At tolerances of 3e-4 or more, the PSFs of a pupil for several source distances and wavelengths can be computed from
    the same samples, on the device of the tensors. One call for all of them is then much faster than separate calls.

    A call psf(heights, radius=..., n=..., pupil={...}) with a square tensor of heights [m] still works.

    Raises:
        ValueError: an argument is invalid; the message names it with its value and valid range. See `optics.psf`.
        AccuracyError: see `optics.psf`.
        BackendError: see `optics.psf`, or RHABDOM_DEVICE requires a GPU that torch cannot use.
        RuntimeError: `device` is unknown to torch or, in a backward pass, second derivatives are requested.
    """
    former = {name: view.pop(name) for name in FORMER if name in view}
    if former or isinstance(pupil, torch.Tensor):
        device = getattr(former.get("heights", pupil), "device", None) if device is None else device
        pupil = _former_pupil(pupil, former)
    if view.get("field"):
        raise ValueError("field: only `optics.psf` returns it; this function returns the intensity")
    light = LightBatch.from_arguments(pupil, sensor_distance, source_distance, source_angle)
    lambdas, numbers = wavelength_row(wavelengths), torch_numbers(light)
    if flag("requires_grad", requires_grad) and not numbers:
        raise ValueError("no tensor requires a gradient: at least one must have requires_grad=True")
    place = torch.device(device) if device is not None else common_device(numbers)
    values = plain_numbers(numbers)
    fixed = with_numbers(light, values)
    numbers = numbers if torch.is_grad_enabled() else {}
    light = with_numbers(light, once(numbers, values)) if numbers else fixed
    integrated = flag("pixel_means", pixel_means) and view.get("method") not in OF_CELLS
    pixels = _pixels(fixed, lambdas, view) if integrated else None
    view = _completed(view if pixels is None else {**view, **vars(pixels.samples)})
    found = _images(light, fixed, numbers, lambdas, view, computing_device(numbers, place)).to(place)
    if pixels is not None:
        rows, columns = (torch.tensor(part).to(place, found.dtype) for part in (pixels.rows, pixels.columns))
        found = rows @ found @ columns.T
    found = found.unflatten(0, (len(light.pupils), len(light.distances)))
    found = found if is_row(sensor_distance) or is_row(source_distance) else found[:, 0]
    return found[0] if isinstance(pupil, Pupil) else found


def _images(
    light: LightBatch,
    fixed: LightBatch,
    numbers: Mapping[str, torch.Tensor],
    wavelengths: np.ndarray,
    view: Mapping[str, Any],
    place: torch.device,
) -> torch.Tensor:
    """Return the PSFs of all members of the batch `light`, (member, wavelength, y, x); see `LightBatch.members`.

    At coarse tolerances, PyTorch computes members with the same pupil and sensor distance as one stack, on the device
    `place`. Dr.Jit computes all other members.

    light, numbers: the batch, and those of its numbers that are tensors: {"pupils[0].aperture_radius": tensor}.
    fixed: the batch `light` with plain numbers instead of tensors, without derivatives.
    """
    convert = partial(on_device, place) if numbers or place.type != "cpu" else np.asarray
    found = light.coarse_images(fixed, wavelengths, view, convert)
    images = {member: torch.as_tensor(image) for member, image in found.items()}
    rest = [member for member in range(len(light.members)) if member not in images]
    if rest:

        def others(own: Sequence[Array]) -> Array:
            changed = with_numbers(light, dict(zip(numbers, own, strict=True)))
            return changed.images(rest, wavelengths, view)

        computed = DrJitOperation.apply(others, *numbers.values())
        if len(rest) == len(light.members):
            return computed
        images |= dict(zip(rest, computed.to(place), strict=True))
    return torch.stack([images[member] for member in range(len(images))])


def _completed(view: Mapping[str, Any]) -> dict[str, Any]:
    """Return the arguments of `optics.psf` for window, tolerance, method and dtype: those in `view`, or defaults."""
    known = {name: value.default for name, value in inspect.signature(drjit_psf).parameters.items()}
    named = ("dx", "shape", "tolerance", "method", "dtype", "centre")
    return {name: known[name] for name in named} | dict(view)


def _pixels(light: LightBatch, wavelengths: np.ndarray, view: Mapping[str, Any]) -> SensorPixels:
    asked = _completed(view)
    window = Grid(asked["shape"], asked["dx"], asked["centre"])
    tolerance = in_range("tolerance", asked["tolerance"], 1e-12, 0.5)
    return SensorPixels.around(window, light.cutoff(wavelengths), tolerance)


def camera_image(scene: Any, pupil: Pupil, sensor: camera.Sensor, *, device: Any = None, **view: Any) -> torch.Tensor:
    """Return the electrons of `optics.camera_image` as a tensor (channel, y, x) with gradients to the pupil's tensors.

    scene: see `optics.camera_image`. It carries no gradients.
    pupil: see `psf`.
    sensor: a sensor with bits=None, because rounded numbers have no derivatives.
    device: device of the result, see `psf`.
    view: depth, samples_per_pixel, field_zones, rng, sensor_distance and tolerance, see `optics.camera_image`.

    Raises:
        ValueError: an argument is invalid; the message names it with its value and valid range.
        AccuracyError: see `optics.camera_image`.
        BackendError: see `psf`.
        RuntimeError: see `psf`.
    """
    of_kind("pupil", pupil, Pupil, "optics.Pupil(1e-3)")
    return _operation(lambda own: camera.camera_image(scene, own, sensor, **view), pupil, device)


def eye_signals(
    eye: Eye, radiance: np.ndarray, samples_per_receptor: int, rng: Any = None, z: Any = math.inf, *, device: Any = None
) -> torch.Tensor:
    """Return the signals of `optics.Eye.see`, (channel, h, w), differentiable with respect to the eye's tensors.

    eye: an eye. Its field of view may be a tensor. `psf` lists the parameters of the eye's pupil that may be tensors.
    radiance, samples_per_receptor, rng, z: see `optics.Eye.see`. Of these, only the distance z carries a gradient.
    device: device of the result, see `psf`.

    Raises:
        ValueError: an argument is invalid; the message names it with its value and valid range.
        AccuracyError: see `optics.Eye.see`.
        BackendError: see `psf`.
        RuntimeError: see `psf`.
    """
    of_kind("eye", eye, Eye, "optics.Eye(optics.Pupil(30e-6))")
    seen = radiance, samples_per_receptor, rng
    return _operation(lambda own: own["eye"].see(*seen, own["z"]), {"eye": eye, "z": z}, device)


def _operation(compute: Callable[[Any], Any], element: Any, device: Any) -> torch.Tensor:
    """Return compute(element) as a tensor, differentiable with respect to the tensors in `element`."""
    numbers = torch_numbers(element)
    place = torch.device(device) if device is not None else common_device(numbers)
    if not numbers or not torch.is_grad_enabled():
        fixed = with_numbers(element, {name: plain(tensor)[()] for name, tensor in numbers.items()})
        return torch.from_numpy(np.asarray(compute(fixed))).to(place)

    def result(own: Sequence[Array]) -> Array:
        return compute(with_numbers(element, dict(zip(numbers, own, strict=True))))

    return DrJitOperation.apply(result, *numbers.values()).to(place)


def _former_pupil(heights: Any, given: Mapping[str, Any]) -> Any:
    """Return the pupil that deprecated arguments of `psf` describe; ValueError if there are heights but no radius."""
    if heights is None and given.keys() == {"pupil"}:
        return given["pupil"]
    heights = of_kind("heights", given.get("heights", heights), torch.Tensor, "torch.zeros(4, 4)")
    if "radius" not in given:
        raise ValueError("radius is missing: must be that of the pupil [m]; or pass optics.Pupil(radius, heights)")
    radius, n = (full_precision(name, given.get(name, 1.5)) for name in ("radius", "n"))
    return Pupil(radius, _guessed(heights, 5), n=n, **(given.get("pupil") or {}))


def _guessed(heights: torch.Tensor, stacklevel: int) -> Relief:
    """Return the relief for a tensor of heights: 4 x 4 heights are control points, others are samples of a map.

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


class PointSpread(torch.nn.Module):
    """Module with a learnable relief: forward() returns the pupil's PSF, with the axes of `psf`.

    radius, n: radius [m] of the pupil, and refractive index of its relief.
    wavelengths, sensor_distance, dx, shape, ...: arguments of `psf`. The constructor checks the wavelengths, and
        forward() checks the others.
    heights: initial relief, a `BSplineRelief`, `HeightMap` or `PixelRelief`. None: a flat `BSplineRelief`. A tensor of
        heights [m] is interpreted as control points if it is 4 x 4, and otherwise as samples of a `HeightMap`.
    unit: length [m] of one unit of the learnt parameter, not 0. Optimisers work best if the parameter is near 1.
    pupil: further arguments of `optics.Pupil`, as a dictionary.

    The only learnt parameter is `relief`, which equals heights / unit.

    Raises:
        ValueError: heights or wavelengths are invalid. Other invalid arguments raise the errors of `psf` in forward().
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
            relief = _guessed(of_kind("heights", heights, torch.Tensor, "torch.zeros(4, 4)"), 4)
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
