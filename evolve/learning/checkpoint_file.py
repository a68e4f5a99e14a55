"""Files of checkpoints: each names its training run (its owner) and has a checksum. Unusable files are renamed.

`TrainingRung.owners` defines the data that identify an owner. This module does not import torch, so that the main
process can check a file before a worker loads it.
"""

from __future__ import annotations

import hashlib
import json
import re
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from evolve.store.regular_files import StrangeFileError, read, sync_folder

__all__ = ["CheckpointError", "CheckpointWarning", "metadata_of", "owned", "read_owned", "set_aside"]

LENGTH_BYTES = 8  # [bytes] size of the number at the start of a safetensors file, which is the length of its header
ENTRY = "training"  # entry of the metadata with all numbers; safetensors writes several entries in random order
BLANK = "0" * 64  # text that stands in for the checksum while it is computed
OTHERS = {"rung": "another rung", "ends": "rungs of other lengths", "settings": "other settings"}


class CheckpointError(ValueError):
    """A checkpoint cannot be used; the message states the reason in one line."""


class CheckpointWarning(UserWarning):
    """An unusable checkpoint was renamed; training starts from an earlier checkpoint or from the beginning."""


def metadata_of(content: bytes) -> dict[str, str]:
    """Return the metadata in the header of a safetensors file; {} if it has none.

    content: content of the file

    Raises:
        ValueError: the header is not JSON.
    """
    header = json.loads(content[LENGTH_BYTES : _end(content)])
    metadata = header.get("__metadata__") if isinstance(header, dict) else None
    return metadata if isinstance(metadata, dict) else {}


def owned(owner: Mapping[str, Any], numbers: Mapping[str, Any]) -> dict[str, str]:
    """Return the metadata of a checkpoint: `owner`, `numbers`, and a placeholder that `sealed` replaces by a checksum.

    owner: description of the training run to which the checkpoint belongs, see `TrainingRung.owners`
    numbers: contents of the checkpoint that are not tensors, by name
    """
    return {ENTRY: json.dumps({**numbers, "owner": owner, "sha256": BLANK})}


def sealed(content: bytes) -> bytes:
    """Return the content of a checkpoint file, in which a SHA-256 checksum replaces a placeholder.

    content: content of a safetensors file with the metadata that `owned` returns; they contain the placeholder, 64
        zeros. The checksum is computed from this content
    """
    return _with_checksum(content, BLANK, hashlib.sha256(content).hexdigest())


def read_owned(path: Path, owner: Mapping[str, Any]) -> tuple[bytes, dict[str, Any]] | None:
    """Return the bytes of a checkpoint, and the numbers in its metadata; None if the file does not exist.

    owner: training run to which the checkpoint must belong, see `TrainingRung.owners`

    Raises:
        CheckpointError: the file is damaged or unreadable, has no checksum, or belongs to another owner.
        StrangeFileError: the path is a link, FIFO or directory, or the file is too large.
    """
    try:
        content = read(path)
    except FileNotFoundError:
        return None
    except StrangeFileError:
        raise
    except OSError as error:
        raise CheckpointError(f"it cannot be read ({error.strerror})") from error
    try:
        numbers = json.loads(metadata_of(content)[ENTRY])
        checksum = numbers.get("sha256", "")
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise CheckpointError("it is damaged, or not a checkpoint") from None
    if checksum == "":
        raise CheckpointError("it has no checksum, because an older version wrote it")
    if not isinstance(checksum, str) or re.fullmatch("[0-9a-f]{64}", checksum) is None:
        raise CheckpointError("it is damaged (its checksum has a wrong form)")
    if hashlib.sha256(_with_checksum(content, checksum, BLANK)).hexdigest() != checksum:
        raise CheckpointError("it is damaged (its checksum differs)")
    _require_owner(numbers.get("owner"), owner)
    return content, numbers


def set_aside(path: Path, reason: CheckpointError) -> None:
    """Rename a checkpoint that cannot be used, so that its candidate is trained again.

    reason: error whose message states why the checkpoint cannot be used

    Warns:
        CheckpointWarning: always; the message is one line with the reason and the new name.

    Raises:
        OSError: the file cannot be renamed.
    """
    number, aside = 1, path.with_name(f"{path.name}.unused")
    while aside.exists():
        number += 1
        aside = path.with_name(f"{path.name}.unused-{number}")
    path.rename(aside)
    sync_folder(path.parent)
    words = f"{path}: {reason}; it is renamed to {aside.name}, and its candidate is trained again"
    warnings.warn(words, CheckpointWarning, stacklevel=2)


def _require_owner(found: Any, owner: Mapping[str, Any]) -> None:
    if not isinstance(found, dict) or found.keys() != owner.keys():
        raise CheckpointError("it belongs to another version")
    differing = [name for name, value in owner.items() if found[name] != value]
    if differing:
        raise CheckpointError(f"it belongs to {OTHERS.get(differing[0], 'another candidate')}")


def _end(content: bytes) -> int:
    """Return the position [bytes] at which a file's header ends.

    If the length of the header is damaged, the position may lie beyond the end of the file.
    """
    return LENGTH_BYTES + int.from_bytes(content[:LENGTH_BYTES], "little")


def _with_checksum(content: bytes, old: str, new: str) -> bytes:
    end = _end(content)
    return content[:end].replace(old.encode(), new.encode()) + content[end:]
