"""Search pupils and other objects for attributes that are tensors of PyTorch and require a gradient."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass, replace
from typing import Any

from optics.elements.beam import Beam
from optics.numerics.autodiff import of_torch

__all__ = ["refuse_torch", "torch_numbers", "with_numbers"]


def torch_numbers(element: Any) -> dict[str, Any]:
    """Return the tensors that require a gradient, with paths of attributes as keys: {"height.samples": tensor}.

    element: a pupil, or another dataclass, dictionary or tuple, which is searched with all its entries.
    """
    return dict(_tensors(element, ""))


def with_numbers(element: Any, numbers: Mapping[str, Any]) -> Any:
    """Return a copy of `element` with some attributes replaced.

    numbers: new values by paths of attributes, {"height.samples": value}, as in the result of `torch_numbers`.
    """
    return _replaced(element, "", numbers)


def refuse_torch(beam: Beam) -> None:
    """Raise a ValueError if a number in `beam` is a PyTorch tensor that requires a gradient, which would be lost."""
    own = {"sensor_distance": beam.distance, "source_distance": beam.source.distance}
    own |= {"source_angle": next(filter(of_torch, beam.source.angle), None)}
    for name in [*torch_numbers(beam.pupil), *(name for name, value in own.items() if of_torch(value))]:
        raise ValueError(
            f"{name} requires a gradient of PyTorch, which would be lost here: must be passed to optics.torch.psf, or "
            "without its gradient, as in tensor.detach()"
        )


def _children(element: Any) -> list[tuple[str, Any, Any]]:
    """Return (name for messages, key, value) for each field of a dataclass, or each entry of a dictionary or tuple."""
    if isinstance(element, float | int | str | None):
        return []  # most elements
    if is_dataclass(element) and not isinstance(element, type):
        return [(f".{field.name}", field.name, getattr(element, field.name)) for field in fields(element) if field.init]
    if isinstance(element, tuple):
        return [(f"[{place}]", place, value) for place, value in enumerate(element)]
    if isinstance(element, dict):
        return [(f"[{str(key).strip('()')}]", key, value) for key, value in element.items()]
    return []


def _tensors(element: Any, place: str) -> Iterator[tuple[str, Any]]:
    if of_torch(element):
        yield place.removeprefix("."), element
    for name, _, value in _children(element):
        yield from _tensors(value, place + name)


def _replaced(element: Any, place: str, numbers: Mapping[str, Any]) -> Any:
    if place.removeprefix(".") in numbers:
        return numbers[place.removeprefix(".")]
    changed = {key: _replaced(value, place + name, numbers) for name, key, value in _children(element)}
    if all(changed[key] is value for _, key, value in _children(element)):
        return element
    if isinstance(element, tuple):
        return tuple(changed.values())
    return changed if isinstance(element, dict) else replace(element, **changed)
