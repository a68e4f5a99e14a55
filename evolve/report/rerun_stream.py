"""What all recordings for rerun are written with."""

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
    """The package rerun.

    Raises:
        ConfigError: it is not installed.
    """
    try:
        import rerun
    except ImportError:
        raise ConfigError("--rrd needs rerun: pip install 'rhabdom[rerun]'") from None
    return rerun


@dataclass(frozen=True)
class RerunStream:
    """rr: the package · stream: rr.RecordingStream · seconds: that one action lasts

    Entities are given by their parts, ("world", "goal"): names may hold any signs.
    """

    rr: Any
    stream: Any
    seconds: float

    def always(self, entity: tuple[str, ...], *what: Any) -> None:
        """Log what does not change."""
        self.stream.log(list(entity), *what, static=True)

    def log(self, t: int, entity: tuple[str, ...], what: Any) -> None:
        """Log what is so before action t."""
        self.stream.set_time("action", sequence=t)
        self.stream.set_time("time", duration=t * self.seconds)
        self.stream.log(list(entity), what)

    def columns(self, entity: tuple[str, ...], n: int, columns: Any) -> None:
        """Log what is so before each of n actions."""
        actions, rr = np.arange(n), self.rr
        times = [rr.TimeColumn("action", sequence=actions), rr.TimeColumn("time", duration=actions * self.seconds)]
        rr.send_columns(rr.new_entity_path(list(entity)), times, columns, recording=self.stream)

    def camera(self, entity: tuple[str, ...], eyes: sim.Eyes) -> None:
        """That this is one of these eyes, which looks along its z axis with x to the right and y down."""
        height, width = eyes.resolution
        focal_length = width / (2 * math.tan(math.radians(eyes.fov_deg) / 2))  # in receptors
        axes = self.rr.ViewCoordinates.RDF
        self.always(entity, self.rr.Pinhole(focal_length=focal_length, width=width, height=height, camera_xyz=axes))

    def path(self, points: np.ndarray) -> None:
        """The animal's whole path, (t, 3) [m]."""
        self.always(("world", "path"), self.rr.LineStrips3D([points], colors=PATH))


def camera_frames(rotations: np.ndarray) -> np.ndarray:
    """Of eyes' frames (..., 3, 3), columns (right, up, ahead), those of cameras: (right, down, ahead), which are
    right-handed."""
    return rotations * np.array([1, -1, 1])
