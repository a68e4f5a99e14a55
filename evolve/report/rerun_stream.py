"""RerunStream: writer of a recording for Rerun."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

import sim
from evolve.config.run_config import ConfigError

__all__ = ["RerunStream", "require_rerun"]

PATH = (230, 180, 60)  # colour of the animal's path


def require_rerun() -> Any:
    """Return the package `rerun`.

    Raises:
        ConfigError: the package `rerun` is not installed.
    """
    try:
        import rerun
    except ImportError:
        raise ConfigError("--rrd needs rerun: pip install 'rhabdom[rerun]'") from None
    return rerun


@dataclass(frozen=True)
class RerunStream:
    """Writer of a recording.

    rr: the package `rerun`
    stream: an rr.RecordingStream
    seconds: duration of one action [s]

    An entity is specified by the parts of its path, such as ("world", "goal"), because names may contain any
    characters.
    """

    rr: Any
    stream: Any
    seconds: float

    def always(self, entity: tuple[str, ...], *what: Any) -> None:
        """Write those data of an entity that are constant over the recording."""
        self.stream.log(list(entity), *what, static=True)

    def log(self, t: int, entity: tuple[str, ...], what: Any) -> None:
        """Log data that describe an entity at the time before action t."""
        self.stream.set_time("action", sequence=t)
        self.stream.set_time("time", duration=t * self.seconds)
        self.stream.log(list(entity), what)

    def columns(self, entity: tuple[str, ...], n: int, columns: Any) -> None:
        """Log the states that an entity has before each of n actions.

        columns: one state for each action, in the format that `rerun.send_columns` takes
        """
        actions, rr = np.arange(n), self.rr
        times = [rr.TimeColumn("action", sequence=actions), rr.TimeColumn("time", duration=actions * self.seconds)]
        rr.send_columns(rr.new_entity_path(list(entity)), times, columns, recording=self.stream)

    def camera(self, entity: tuple[str, ...], eyes: sim.Eyes) -> None:
        """Log an entity as a camera with the field of view of these eyes.

        In its own frame, the camera looks along z, with x to the right and y down.
        """
        height, width = eyes.resolution
        # In receptor widths and heights.
        focal_length = [
            side / (2 * math.tan(math.radians(fov) / 2))
            for side, fov in ((width, eyes.fov_deg), (height, eyes.fovy_deg))
        ]
        axes = self.rr.ViewCoordinates.RDF
        self.always(entity, self.rr.Pinhole(focal_length=focal_length, width=width, height=height, camera_xyz=axes))

    def path(self, points: np.ndarray) -> None:
        """Log the animal's whole path, (t, 3) [m]."""
        self.always(("world", "path"), self.rr.LineStrips3D([points], colors=PATH))


def camera_frames(rotations: np.ndarray) -> np.ndarray:
    """Return the frames of eyes as right-handed frames of cameras, (..., 3, 3).

    The columns of an eye's frame are (right, up, ahead). A camera's frame has the columns (right, down, ahead).

    rotations: frames of the eyes, (..., 3, 3)
    """
    return rotations * np.array([1, -1, 1])
