"""Functions of Dr.Jit arrays as operations of PyTorch, and tensors that can be differentiated only once."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import torch

from optics.numerics.autodiff import Array, is_known, keep_copy, plain
from optics.numerics.backend import BackendError
from optics.numerics.device import VARIABLE, make_ready
from optics.numerics.precision import padded_for_packets, precision

__all__ = [
    "DrJitOperation",
    "common_device",
    "computing_device",
    "on_device",
    "once",
    "plain_numbers",
    "torch_place",
]

# Types of devices for whose tensors the processor computes: "mps" has no double precision, and "meta" no numbers.
ON_PROCESSOR = ("cpu", "mps", "meta")


class Once(torch.autograd.Function):
    """The identity; an attempt to compute its second derivative raises an error."""

    @staticmethod
    def forward(ctx: Any, tensor: Any) -> Any:
        return tensor.view_as(tensor)

    @staticmethod
    def backward(ctx: Any, gradient: Any) -> Any:
        return FirstDerivative.apply(gradient.requires_grad_())[0] if torch.is_grad_enabled() else gradient


def once(numbers: Mapping[str, torch.Tensor], values: Mapping[str, Any]) -> dict[str, torch.Tensor]:
    """Return tensors, by name, that equal those given, but can be differentiated only once.

    values: NumPy copies of the given tensors from `plain_numbers`. They are attached to the new tensors, so that they
        need not be copied from a GPU again.
    """
    found = {name: Once.apply(tensor) for name, tensor in numbers.items()}
    for name, tensor in found.items():
        keep_copy(tensor, np.asarray(values[name]))
    return found


class DrJitOperation(torch.autograd.Function):
    """A function of Dr.Jit arrays as an operation of PyTorch, whose backward pass can be repeated."""

    @staticmethod
    def forward(ctx: Any, function: Callable[[list[Array]], Array], *numbers: Any) -> Any:
        import drjit as dr

        place, types = torch_place(), precision("float64")
        own = [_on_drjit(tensor.double(), types.Tensor64, place) for tensor in numbers]
        dr.enable_grad(own)
        found = function(own)
        dr.eval(found)
        ctx.own, ctx.found, ctx.kinds = own, found, [(t.shape, t.dtype, t.device) for t in numbers]
        return _on_torch(dr.detach(found), place)

    @staticmethod
    def backward(ctx: Any, *gradients: Any) -> Any:
        import drjit as dr

        place = torch_place()
        dr.set_grad(ctx.found, _on_drjit(gradients[0], type(ctx.found), place))
        dr.backward_from(ctx.found, flags=dr.ADFlag.ClearVertices)  # keeps the edges for further passes
        slopes = dr.grad(ctx.own)
        dr.eval(slopes)
        found = [
            _on_torch(slope, place).reshape(shape).to(place_of, dtype)
            for slope, (shape, dtype, place_of) in zip(slopes, ctx.kinds, strict=True)
        ]
        dr.clear_grad(ctx.own)
        if torch.is_grad_enabled():
            found = FirstDerivative.apply(*(slope.requires_grad_() for slope in found))
        return None, *found


class FirstDerivative(torch.autograd.Function):
    """First derivatives; an attempt to differentiate them raises an error."""

    @staticmethod
    def forward(ctx: Any, *slopes: Any) -> Any:
        return tuple(slope.clone() for slope in slopes)

    @staticmethod
    def backward(ctx: Any, *gradients: Any) -> Any:
        raise RuntimeError("optics.torch.psf has no second derivatives: must be differentiated once")


def _on_drjit(tensor: torch.Tensor, kind: Any, place: str) -> Array:
    tensor = tensor.detach().resolve_neg().to(place).reshape(tensor.shape or (1,)).contiguous()
    return kind(padded_for_packets(tensor.numpy()), tuple(tensor.shape)) if place == "cpu" else kind(tensor)


def _on_torch(tensor: Array, place: str) -> torch.Tensor:
    return torch.from_numpy(np.array(tensor.numpy())) if place == "cpu" else tensor.torch().clone()


def torch_place() -> str:
    """Return PyTorch's name of the device on which optics computes.

    Raises:
        BackendError: Dr.Jit or this build of torch cannot compute on this device.
    """
    place = make_ready()
    if place == "cuda" and not torch.cuda.is_available():
        raise BackendError(f"{VARIABLE} requires a GPU, but this torch has none: must be cpu, or torch built for CUDA")
    return place


def common_device(numbers: Mapping[str, torch.Tensor]) -> torch.device:
    """Return the device of all tensors, or the CPU if there are none; ValueError if their devices differ.

    Single numbers on the CPU are not considered, because PyTorch combines them with tensors on any device.
    """
    places = {name: t.device for name, t in numbers.items() if t.ndim or t.device.type != "cpu"}
    for first, known in places.items():
        for name, place in places.items():
            if place != known:
                raise ValueError(f"{name} is on {place} and {first} on {known}: must be on one device, or pass device=")
        return known
    return torch.device("cpu")


def computing_device(numbers: Mapping[str, torch.Tensor], otherwise: torch.device) -> torch.device:
    """Return the device on which PyTorch computes with these tensors.

    This is the device that the tensors share. Single numbers on the CPU are not considered, because PyTorch combines
    them with tensors on any device. If the tensors are on several devices, or only such single numbers are given, the
    device is the argument `otherwise`. If the device found in this way is of the type cpu, mps or meta, the device on
    which Dr.Jit computes is returned instead.
    """
    places = {tensor.device for tensor in numbers.values() if tensor.ndim or tensor.device.type != "cpu"}
    found = places.pop() if len(places) == 1 else otherwise
    return torch.device(torch_place()) if found.type in ON_PROCESSOR else found


def plain_numbers(numbers: Mapping[str, torch.Tensor]) -> dict[str, Any]:
    """Return the values of tensors, by name, as NumPy arrays or single numbers without derivatives.

    If several tensors are on one GPU, their values are copied together, because the program waits for each copy.
    """
    away = {name: t for name, t in numbers.items() if t.device.type not in ON_PROCESSOR and not is_known(t)}
    copied: dict[str, Any] = {}
    if len(away) > 1 and len({tensor.device for tensor in away.values()}) == 1:
        flat = torch.cat([tensor.detach().double().reshape(-1) for tensor in away.values()]).cpu().numpy()
        parts = np.split(flat, np.cumsum([tensor.numel() for tensor in away.values()])[:-1])
        copied = {name: part.reshape(away[name].shape)[()] for name, part in zip(away, parts, strict=True)}
    return {name: copied[name] if name in copied else plain(tensor)[()] for name, tensor in numbers.items()}


def on_device(place: torch.device, values: np.ndarray) -> torch.Tensor:
    """Return an array of NumPy as a tensor on a device. On the processor, tensor and array share memory."""
    tensor = torch.from_numpy(values)
    return tensor if place.type == "cpu" else tensor.to(place)
