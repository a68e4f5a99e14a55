"""One rung of a training run under successive halving."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from evolve.config.assemble import to_toml
from evolve.config.run_config import RunConfig
from evolve.genome.phenotype import Phenotype
from evolve.learning.checkpoint_file import CheckpointError, read_owned, set_aside
from evolve.store.versions import fingerprint

__all__ = ["TrainingRung"]


@dataclass(frozen=True)
class TrainingRung:
    """A training run from its start to the end of one of its rungs (the parts into which it is divided).

    ends: number of training steps at the end of each rung, from the first rung to this one
    checkpoints: path of the checkpoint at the end of each of these rungs; training continues from the latest usable
        checkpoint of an earlier rung
    candidate: id of the candidate; None if the training does not belong to a run
    """

    ends: tuple[int, ...]
    checkpoints: tuple[Path, ...]
    candidate: int | None = None

    @property
    def number(self) -> int:
        """Number of this rung (part of a training run), counted from 0; a candidate's record stores it as `rung`."""
        return len(self.ends) - 1

    def owners(self, phenotype: Phenotype, config: RunConfig, seed: int) -> tuple[dict[str, Any], ...]:
        """Return the owner of each checkpoint: all inputs on which the state of training depends, as JSON values.

        The numbers of workers and of generations are left out, because they have no effect on this state. A checkpoint
        with another owner must not be used.

        seed: seed of the training run
        """
        common = {
            "candidate": self.candidate,
            "seed": seed,
            "animal": hashlib.sha256(json.dumps(phenotype.to_json()).encode()).hexdigest()[:16],
            "settings": fingerprint(to_toml(config)),
        }
        numbers = range(len(self.ends))
        return tuple({**common, "rung": number, "ends": list(self.ends[: number + 1])} for number in numbers)

    def set_aside_unusable(self, phenotype: Phenotype, config: RunConfig, seed: int) -> None:
        """Rename unusable checkpoints of earlier rungs (parts of the training run); see `set_aside`.

        Checkpoints are checked from the latest earlier rung backwards, until one is usable. The usable
        checkpoint keeps its name.

        Raises:
            OSError: a checkpoint is not a regular file, or cannot be renamed.
        """
        owners = self.owners(phenotype, config, seed)
        for path, owner in reversed(list(zip(self.checkpoints[:-1], owners[:-1], strict=True))):
            try:
                if read_owned(path, owner) is not None:
                    return
            except CheckpointError as error:
                set_aside(path, error)
