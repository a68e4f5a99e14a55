"""Reading of tensors from a run's safetensors files; nothing in a file is executed."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import safetensors.torch

from evolve.learning.checkpoint_file import metadata_of
from evolve.store.regular_files import read

if TYPE_CHECKING:
    from torch import Tensor

__all__ = ["read_tensors"]


def read_tensors(path: Path) -> tuple[dict[str, str], dict[str, Tensor]]:
    """Return the metadata and the tensors of a file, each by name.

    Raises:
        StrangeFileError: the path is not a regular file, or the file is too large.
        OSError: the file cannot be read.
        SafetensorError: the file is not a safetensors file.
        ValueError: the header is not JSON.
    """
    content = read(path)
    tensors = safetensors.torch.load(content)  # also validates the header, which is parsed below
    return metadata_of(content), tensors
