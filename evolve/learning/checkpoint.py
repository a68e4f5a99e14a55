"""A training as it stands: all that whoever goes on with it, in fresh worlds, needs to know. Tensors and numbers."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import safetensors
import safetensors.torch
from torch import Tensor

from evolve.learning.tensor_file import read_tensors
from evolve.store.atomic_files import write_whole
from evolve.store.regular_files import StrangeFileError

__all__ = ["Checkpoint", "load_checkpoint", "save_checkpoint"]


@dataclass(frozen=True)
class Checkpoint:
    """Where a training stands.

    steps: trained so far
    curve: (steps, mean return of the evaluation episodes), so far
    unit: in which rewards are measured
    now: all that learning has changed, as it is
    best: the same, as it was at the best evaluation
    adam: state of the optimizer: mean, square, steps
    """

    steps: int
    curve: tuple[tuple[int, float], ...]
    unit: float
    now: Mapping[str, Tensor]
    best: Mapping[str, Tensor]
    adam: Mapping[str, Tensor | int]


def save_checkpoint(checkpoint: Checkpoint, path: Path) -> None:
    """Write as safetensors, what is no tensor in the metadata; whole or not at all."""
    parts = {"now": checkpoint.now, "best": checkpoint.best, "adam": checkpoint.adam}
    tensors = {
        f"{part}/{name}": value.detach().clone().contiguous()
        for part, values in parts.items()
        for name, value in values.items()
        if isinstance(value, Tensor)
    }
    rest = {"steps": checkpoint.steps, "curve": checkpoint.curve, "unit": checkpoint.unit}
    metadata = {"training": json.dumps({**rest, "adam_steps": checkpoint.adam["steps"]})}
    write_whole(path, safetensors.torch.save(tensors, metadata))


def load_checkpoint(path: Path) -> Checkpoint | None:
    """Inverse of `save_checkpoint`; None where there is none, or a file that is none. Nothing in it is executed.

    Raises:
        StrangeFileError: a link, FIFO or directory bears its name.
    """
    try:
        metadata, tensors = read_tensors(path)
        rest = json.loads(metadata["training"])
        return Checkpoint(
            steps=int(rest["steps"]),
            curve=tuple((int(steps), float(value)) for steps, value in rest["curve"]),
            unit=float(rest["unit"]),
            now=_part(tensors, "now"),
            best=_part(tensors, "best"),
            adam={**_part(tensors, "adam"), "steps": int(rest["adam_steps"])},
        )
    except StrangeFileError:
        raise
    except (OSError, safetensors.SafetensorError, KeyError, TypeError, ValueError, OverflowError, RecursionError):
        return None


def _part(tensors: Mapping[str, Tensor], part: str) -> dict[str, Tensor]:
    return {name.removeprefix(f"{part}/"): value for name, value in tensors.items() if name.startswith(f"{part}/")}
