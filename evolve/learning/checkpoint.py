"""Checkpoint: the state of a training run, from which training can continue in new worlds."""

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
    """State of a training run.

    steps: number of training steps so far
    curve: (steps, mean return of the evaluation episodes) at each evaluation so far
    unit: unit of rewards, by which the learner's rewards are divided
    now: current values of all tensors that learning changes
    best: values of the same tensors at the evaluation with the highest mean return
    adam: state of the optimizer: mean, square, steps
    """

    steps: int
    curve: tuple[tuple[int, float], ...]
    unit: float
    now: Mapping[str, Tensor]
    best: Mapping[str, Tensor]
    adam: Mapping[str, Tensor | int]


def save_checkpoint(checkpoint: Checkpoint, path: Path) -> None:
    """Write a checkpoint as safetensors, completely or not at all. Numbers are stored in its metadata."""
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
    """Load a checkpoint that `save_checkpoint` wrote; None if the file is missing or damaged.

    Nothing in the file is executed.

    Raises:
        StrangeFileError: the path is a link, FIFO or directory.
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
