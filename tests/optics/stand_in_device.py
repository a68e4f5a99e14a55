"""A device for tests of PyTorch code on machines without a GPU.

Its tensors keep their numbers in the memory of the processor, but follow the rules of a GPU: NumPy cannot read them,
and an operation on tensors of two devices fails, except for single numbers on the processor. All copies between the
device and the host are recorded.

PyTorch knows the name of the device and has no code for it here, so no tensor can be on it by accident.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import torch
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils._pytree import tree_flatten, tree_map

__all__ = ["DEVICE", "Copies", "DeviceTensor", "stand_in"]

DEVICE = torch.device("xla", 0)
WITHOUT_NUMBERS = torch.device("meta")  # the device of these tensors as C++ sees it
FAILURE = "Expected all tensors to be on the same device"
# Operations whose result's shape depends on the numbers of a tensor, so that a GPU must be waited for.
WAITS = {torch.ops.aten.nonzero, torch.ops.aten.equal, torch.ops.aten.is_nonzero, torch.ops.aten.masked_select}


@dataclass
class Copies:
    """Numbers of elements of all copies, in order.

    to_host: copies from the device to the host, for which the program waits.
    to_device: copies of arrays from the host to the device.
    """

    to_host: list[int] = field(default_factory=list)
    to_device: list[int] = field(default_factory=list)


class DeviceTensor(torch.Tensor):
    """A tensor on the device. `inner` contains its numbers."""

    __torch_function__ = torch._C._disabled_torch_function_impl

    @staticmethod
    def __new__(cls, inner: torch.Tensor) -> DeviceTensor:
        kind = {"dtype": inner.dtype, "device": WITHOUT_NUMBERS}
        return torch.Tensor._make_wrapper_subclass(cls, inner.shape, strides=inner.stride(), **kind)

    def __init__(self, inner: torch.Tensor) -> None:
        self.inner = inner

    def __repr__(self, **_: Any) -> str:
        return f"DeviceTensor({tuple(self.shape)})"

    @property
    def device(self) -> torch.device:
        return DEVICE

    def numpy(self, **_: Any) -> Any:
        raise TypeError(f"can't convert {DEVICE} device type tensor to numpy")

    def __array__(self, *_: Any, **__: Any) -> Any:
        return self.numpy()

    def tolist(self) -> Any:
        return self.cpu().tolist()

    @classmethod
    def __torch_dispatch__(cls, function: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        return _computed(function, args, kwargs or {}, Copies())


class _Mode(TorchDispatchMode):
    def __init__(self, copies: Copies) -> None:
        super().__init__()
        self.copies = copies

    def __torch_dispatch__(self, function: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        return _computed(function, args, kwargs or {}, self.copies)


@contextmanager
def stand_in() -> Iterator[Copies]:
    """Make the device available, and record copies."""
    with _Mode(copies := Copies()):
        yield copies


def _computed(function: Any, args: Any, kwargs: dict[str, Any], copies: Copies) -> Any:
    tensors = [one for one in tree_flatten((args, kwargs))[0] if isinstance(one, torch.Tensor)]
    here = any(isinstance(one, DeviceTensor) for one in tensors)
    wanted = kwargs.get("device")
    there = here if wanted is None else torch.device(wanted).type in (DEVICE.type, WITHOUT_NUMBERS.type)
    kwargs = {**kwargs, "device": torch.device("cpu")} if wanted is not None else kwargs
    moves = function in (torch.ops.aten._to_copy.default, torch.ops.aten.copy_.default)
    if moves and function is torch.ops.aten.copy_.default:
        there = isinstance(args[0], DeviceTensor)
        here = isinstance(args[1], DeviceTensor)
    if here and not moves and any(not isinstance(one, DeviceTensor) and one.ndim for one in tensors):
        raise RuntimeError(f"{FAILURE}: {function} of {[(type(one).__name__, tuple(one.shape)) for one in tensors]}")
    size = max([one.numel() for one in tensors], default=1)
    if moves and here != there:
        (copies.to_device if there else copies.to_host).append(size)
    if function is torch.ops.aten._local_scalar_dense.default and here:
        copies.to_host.append(1)
        there = False
    if function.overloadpacket in WAITS and here:
        copies.to_host.append(size)
    inner = tree_map(lambda one: one.inner if isinstance(one, DeviceTensor) else one, (args, kwargs))
    found = function(*inner[0], **inner[1])
    known = {id(one.inner): one for one in tensors if isinstance(one, DeviceTensor)}
    return tree_map(lambda one: _wrapped(one, known) if there and isinstance(one, torch.Tensor) else one, found)


def _wrapped(tensor: torch.Tensor, known: dict[int, DeviceTensor]) -> DeviceTensor:
    """Return a tensor on the device; in-place operations return the tensor that they change."""
    return known[id(tensor)] if id(tensor) in known else DeviceTensor(tensor.resolve_conj().resolve_neg())
