"""Checkpoint: the state of a training run, from which training can continue in new worlds."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import safetensors
import safetensors.torch
from torch import Tensor

from evolve.learning.checkpoint_file import CheckpointError, owned, read_owned, sealed
from evolve.store.atomic_files import write_whole

__all__ = ["Checkpoint", "load_checkpoint", "save_checkpoint"]


@dataclass(frozen=True)
class Checkpoint:
    """State of a training run.

    steps: number of training steps so far
    curve: (steps, mean return) of each evaluation so far
    unit: number by which the learner divides rewards
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


def save_checkpoint(checkpoint: Checkpoint, path: Path, owner: Mapping[str, Any]) -> None:
    """Write a checkpoint as a safetensors file, completely or not at all.

    The file's metadata contain `steps`, `curve`, `unit` and the number of steps of the optimizer.

    owner: the training run from which the checkpoint comes, see `TrainingRung.owners`

    Raises:
        OSError: the file cannot be written.
    """
    parts = {"now": checkpoint.now, "best": checkpoint.best, "adam": checkpoint.adam}
    tensors = {
        f"{part}/{name}": value.detach().clone().contiguous()
        for part, values in parts.items()
        for name, value in values.items()
        if isinstance(value, Tensor)
    }
    numbers = {"steps": checkpoint.steps, "curve": checkpoint.curve, "unit": checkpoint.unit}
    metadata = owned(owner, {**numbers, "adam_steps": checkpoint.adam["steps"]})
    write_whole(path, sealed(safetensors.torch.save(tensors, metadata)))


def load_checkpoint(path: Path, owner: Mapping[str, Any]) -> Checkpoint | None:
    """Load a checkpoint that `save_checkpoint` wrote for the same owner; None if the file is missing.

    Nothing in the file is executed.

    Raises:
        CheckpointError: the file is damaged or unreadable, or belongs to another owner.
        StrangeFileError: the path is a link, FIFO or directory, or the file is too large.
    """
    found = read_owned(path, owner)
    if found is None:
        return None
    content, numbers = found
    try:
        tensors = safetensors.torch.load(content)
        checkpoint = Checkpoint(
            steps=int(numbers["steps"]),
            curve=tuple((int(steps), float(value)) for steps, value in numbers["curve"]),
            unit=float(numbers["unit"]),
            now=_part(tensors, "now"),
            best=_part(tensors, "best"),
            adam={**_part(tensors, "adam"), "steps": int(numbers["adam_steps"])},
        )
    except (safetensors.SafetensorError, KeyError, TypeError, ValueError, OverflowError) as error:
        raise CheckpointError(f"its content is not that of a checkpoint ({type(error).__name__})") from error
    _require_possible(checkpoint)
    return checkpoint


def _require_possible(checkpoint: Checkpoint) -> None:
    """Check that a training run could have produced this checkpoint.

    Raises:
        CheckpointError: the steps, the learning curve or the unit of rewards are impossible.
    """
    at = [0, *(steps for steps, _ in checkpoint.curve)]
    if at != sorted(set(at)) or not 0 < checkpoint.steps == at[-1]:
        raise CheckpointError("its steps and its learning curve are impossible")
    if not 0 < checkpoint.unit < math.inf:
        raise CheckpointError(f"its unit of rewards is {checkpoint.unit:.3g}, and not positive")


def _part(tensors: Mapping[str, Tensor], part: str) -> dict[str, Tensor]:
    return {name.removeprefix(f"{part}/"): value for name, value in tensors.items() if name.startswith(f"{part}/")}
