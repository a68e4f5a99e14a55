"""Tensors from a run's files (safetensors): read through the one door to them, and nothing in them is executed."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import safetensors.torch

from evolve.store.regular_files import read

if TYPE_CHECKING:
    from torch import Tensor

__all__ = ["read_tensors"]

LENGTH_BYTES = 8  # of the header's length, at the beginning of a file


def read_tensors(path: Path) -> tuple[dict[str, str], dict[str, Tensor]]:
    """Metadata and tensors of a file, by name.

    Raises:
        StrangeFileError: it is no regular file.
        OSError: it cannot be read.
        SafetensorError: it holds something else.
        ValueError: its header is no JSON.
    """
    content = read(path)
    tensors = safetensors.torch.load(content)  # checks the header, so that what follows can rely on it
    end = LENGTH_BYTES + int.from_bytes(content[:LENGTH_BYTES], "little")
    metadata = json.loads(content[LENGTH_BYTES:end]).get("__metadata__") or {}
    return metadata, tensors
