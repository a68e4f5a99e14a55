"""What an observation may hold beside signals: how far what each receptor looks at is, which geom, and how it moves.

No animal knows these. They are exact, and for whoever trains: targets of auxiliary losses, or a critic's privilege.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from gymnasium import spaces

from sim.render.labels import Labels
from sim.render.optic_flow import flow_between
from sim.scene.poses import Poses
from sim.tasks.eye_kinds import AUXILIARY

DEPTH, IDS, FLOW = AUXILIARY


class Auxiliary:
    """Of one kind of eyes, in all worlds, for each receptor's centre.

    renderer: the eyes · names: of AUXILIARY, what is wanted · prefix: of what these are called
    spaces: of what one world's observation holds, by name:
        depth: along the eye's axis [m], (eye, height, width) float32; 0 where there is nothing
        ids: of the geom, (eye, height, width) int32; -1 where there is nothing
        flow: how far it has moved on the retina since the last observation, to the right and down [receptors],
            (eye, 2, height, width) float32; 0 in an episode's first, where there is nothing, and where what is seen now
            was not before the eye then
    """

    def __init__(self, renderer: Labels, names: Sequence[str], prefix: str = "") -> None:
        self._renderer, self._names, self._prefix = renderer, tuple(names), prefix
        frame, geoms = (len(renderer.mounts), *renderer.eye.resolution), renderer.model.ngeom
        known: dict[str, spaces.Box] = {
            DEPTH: spaces.Box(0.0, np.inf, frame, np.float32),
            IDS: spaces.Box(-1, geoms - 1, frame, np.int32),
            FLOW: spaces.Box(-np.inf, np.inf, (frame[0], 2, *frame[1:]), np.float32),
        }
        self.spaces = {prefix + name: known[name] for name in self._names}
        self._before: Poses | None = None

    def look(self, poses: Poses, fresh: np.ndarray) -> dict[str, np.ndarray]:
        """Arrays (world, ...) by name; fresh: numbers of the worlds whose episode has just begun."""
        depth = self._renderer.depth(poses)
        ids = self._renderer.ids(poses) if {IDS, FLOW} & {*self._names} else None
        found = {DEPTH: np.where(np.isfinite(depth), depth, 0).astype(np.float32)}
        if ids is not None:
            found[IDS] = ids
        if FLOW in self._names and ids is not None:
            found[FLOW] = self._flow(poses, depth, ids)
            found[FLOW][fresh] = 0.0
        self._before = poses
        return {self._prefix + name: found[name] for name in self._names}

    def go_on_from(self, poses: Poses) -> None:
        """Everything stood here when it was last looked at."""
        self._before = poses

    def _flow(self, now: Poses, depth: np.ndarray, ids: np.ndarray) -> np.ndarray:
        """Backwards in time, and its sign changed: of what is seen now."""
        before = now if self._before is None else self._before
        frames = self._renderer.eye_frames(now), self._renderer.eye_frames(before)
        return -np.nan_to_num(flow_between(self._renderer.eye, depth, ids, (now, before), frames), nan=0.0)
