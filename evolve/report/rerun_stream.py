"""Writer of recordings for rerun."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

import sim
from evolve.config.run_config import ConfigError

__all__ = ["RerunStream", "require_rerun"]

PATH = (230, 180, 60)


def require_rerun() -> Any:
    """Return the package rerun.

    Raises:
        ConfigError: rerun is not installed.
    """
    try:
        import rerun
    except ImportError:
        raise ConfigError("--rrd needs rerun: pip install 'rhabdom[rerun]'") from None
    return rerun


@dataclass(frozen=True)
class RerunStream:
    """Stream of a recording.

    rr: the package · stream: rr.RecordingStream · seconds: duration of one action

    Entities are specified by their parts, ("world", "goal"), because names may contain any characters.
    """

    rr: Any
    stream: Any
    seconds: float

    def always(self, entity: tuple[str, ...], *what: Any) -> None:
        """Log constant data."""
        self.stream.log(list(entity), *what, static=True)

    def log(self, t: int, entity: tuple[str, ...], what: Any) -> None:
        """Log the state before action t."""
        self.stream.set_time("action", sequence=t)
        self.stream.set_time("time", duration=t * self.seconds)
        self.stream.log(list(entity), what)

    def columns(self, entity: tuple[str, ...], n: int, columns: Any) -> None:
        """Log the states before each of n actions."""
        actions, rr = np.arange(n), self.rr
        times = [rr.TimeColumn("action", sequence=actions), rr.TimeColumn("time", duration=actions * self.seconds)]
        rr.send_columns(rr.new_entity_path(list(entity)), times, columns, recording=self.stream)

    def camera(self, entity: tuple[str, ...], eyes: sim.Eyes) -> None:
        """Log an entity as a camera for one of these eyes, which looks along z with x to the right and y down."""
        height, width = eyes.resolution
        focal_length = width / (2 * math.tan(math.radians(eyes.fov_deg) / 2))  # in receptors
        axes = self.rr.ViewCoordinates.RDF
        self.always(entity, self.rr.Pinhole(focal_length=focal_length, width=width, height=height, camera_xyz=axes))

    def path(self, points: np.ndarray) -> None:
        """Log the animal's whole path, (t, 3) [m]."""
        self.always(("world", "path"), self.rr.LineStrips3D([points], colors=PATH))


def camera_frames(rotations: np.ndarray) -> np.ndarray:
    """Return right-handed camera frames, columns (right, down, ahead), of eyes' frames (..., 3, 3), columns
    (right, up, ahead)."""
    return rotations * np.array([1, -1, 1])
