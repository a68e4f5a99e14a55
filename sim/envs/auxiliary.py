"""Auxiliary observations for each receptor: depth, geom id and optic flow of the visible surface.

No animal can sense these quantities, and they contain no noise. They are useful only in training, as targets of
auxiliary losses or as additional inputs of a critic.
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
    """Depth, geom id and optic flow in all worlds, for each receptor of an agent's eyes of the same kind.

    Each value belongs to the point that is visible at the centre of the receptor.

    renderer: renderer of depth and ids for these eyes.
    names: the requested quantities, of "depth", "ids" and "flow".
    prefix: prefix of their names in an observation.
    spaces: spaces of the entries in one world's observation, by name:
        depth: distance of the visible point along the eye's axis [m], (eye, height, width) float32; 0 if nothing is
            visible
        ids: id of the visible geom, (eye, height, width) int32; -1 if nothing is visible
        flow: motion of the visible point on the retina since the last observation, to the right and down [receptors],
            (eye, 2, height, width) float32. The flow is 0 in three cases: in the first observation of an episode, if
            nothing is visible, and if the visible point was not in front of the eye at the last observation.
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

    def render(self, poses: Poses, fresh: np.ndarray) -> dict[str, np.ndarray]:
        """Return the auxiliary entries of the observations by name, each (world, ...).

        fresh: indices of the worlds whose episode has just begun
        """
        depth = self._renderer.depth(poses)
        found = {DEPTH: np.where(np.isfinite(depth), depth, 0).astype(np.float32)}
        if {IDS, FLOW} & {*self._names}:
            found[IDS] = self._renderer.ids(poses)
        if FLOW in self._names:
            found[FLOW] = self._flow(poses, depth, found[IDS])
            found[FLOW][fresh] = 0.0
        self._before = poses
        return {self._prefix + name: found[name] for name in self._names}

    def go_on_from(self, poses: Poses) -> None:
        """Set the poses of the previous observation, from which the next optic flow is computed."""
        self._before = poses

    def _flow(self, now: Poses, depth: np.ndarray, ids: np.ndarray) -> np.ndarray:
        """Return the optic flow of the points that are visible now, (world, eye, 2, height, width).

        The flow is 0 if nothing is visible, and for points that were not in front of the eye at the previous poses.

        Points are followed from their present positions back to the previous poses. The flow is the negative of this
        motion.

        depth, ids: depth and geom id of the point that is visible at the centre of each receptor, see `flow_between`
        """
        before = now if self._before is None else self._before
        frames = self._renderer.eye_frames(now), self._renderer.eye_frames(before)
        return -np.nan_to_num(flow_between(self._renderer.eye, depth, ids, (now, before), frames), nan=0.0)
