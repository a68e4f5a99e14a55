"""Images of a camera with gradients in PyTorch."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch

from optics.elements.pupil import Pupil
from optics.elements.torch_numbers import torch_numbers, with_numbers
from optics.eye import camera
from optics.numerics.arguments import of_kind
from optics.numerics.autodiff import Array, plain
from optics.torch.autograd import Evaluation, common_device

__all__ = ["camera_image"]


def camera_image(scene: Any, pupil: Pupil, sensor: camera.Sensor, *, device: Any = None, **view: Any) -> torch.Tensor:
    """Return the electrons of `optics.camera_image` as a tensor (channel, y, x) with gradients to the pupil's tensors.

    scene: see `optics.camera_image`. It carries no gradients.
    pupil: see `psf`.
    sensor: a sensor with bits=None, because rounded numbers have no derivatives.
    device: device of the result, see `psf`.
    view: depth, samples_per_pixel, field_zones, rng, sensor_distance and tolerance, see `optics.camera_image`.

    Raises:
        ValueError: an argument is invalid; the message names it with its value and valid range.
        AccuracyError: see `optics.psf`.
    """
    numbers = torch_numbers(of_kind("pupil", pupil, Pupil, "optics.Pupil(1e-3)"))
    place = torch.device(device) if device is not None else common_device(numbers)
    if not numbers or not torch.is_grad_enabled():
        fixed = with_numbers(pupil, {name: plain(tensor)[()] for name, tensor in numbers.items()})
        return torch.from_numpy(np.asarray(camera.camera_image(scene, fixed, sensor, **view))).to(place)

    def electrons(own: Sequence[Array]) -> Array:
        return camera.camera_image(scene, with_numbers(pupil, dict(zip(numbers, own, strict=True))), sensor, **view)

    return Evaluation.apply(electrons, *numbers.values()).to(place)
