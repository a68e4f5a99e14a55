"""Poses of models in which only a few bodies move.

Arrays that contain all bodies, geoms, sites or cameras of the model are built only when they are read.
"""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from sim.scene.poses import OF_MODELS, Poses, of_models

_PREFIX = {"geom": "geom_x", "site": "site_x", "camera": "cam_x"}


class ReferencePose:
    """A model in its reference pose, from which a few bodies move.

    bodies: ids of the moving bodies. Geoms, sites and cameras move rigidly with them; no other body may be attached to
        them
    turning: number of bodies that may also rotate, which come first in `bodies`. The others keep their rotation
    """

    def __init__(self, model: mujoco.MjModel, bodies: Sequence[int], turning: int) -> None:
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        self.poses, self.bodies, self.n_bodies = Poses.from_data(data), list(bodies), model.nbody
        self.turning = turning
        self.body_of = {"geom": model.geom_bodyid.copy(), "site": model.site_bodyid, "camera": model.cam_bodyid}
        self._local = {(kind, i): self._in_body(kind, i) for kind in _PREFIX for i in self.moved(kind)}
        self._slots: dict[tuple[int, ...], slice | list[int] | None] = {}
        self._kept: dict[tuple[int, ...], np.ndarray | None] = {}

    def moved(self, kind: str) -> list[int]:
        """Return the ids of the elements of a kind ("geom", "site" or "camera") that are fixed to moving bodies."""
        return [int(i) for i in np.flatnonzero(np.isin(self.body_of[kind], self.bodies))]

    def local(self, kind: str, index: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the origin (3,) [m] and rotation (3, 3) of an element in the frame of its body."""
        return self._local[kind, index]

    def slots(self, geoms: Sequence[int] | np.ndarray) -> slice | list[int] | None:
        """Return the index of the body of each of these geoms, in the list `bodies` of moving bodies.

        With these indices, the frames of the geoms can be taken from those of the bodies. This requires that each geom
        has the same frame as its body, as most geoms do. Return None if a geom has a frame of its own, or if its body
        does not move. The result is a slice if the indices are adjacent, because a slice copies nothing.
        """
        key = tuple(geoms)
        if key not in self._slots:
            bodies = [int(self.body_of["geom"][geom]) for geom in key]
            local = [self._local.get(("geom", geom)) for geom in key]
            alike = all(at is not None and not at[0].any() and np.array_equal(at[1], np.eye(3)) for at in local)
            self._slots[key] = as_slice([self.bodies.index(body) for body in bodies]) if alike else None
        return self._slots[key]

    def kept_turns(self, geoms: Sequence[int] | np.ndarray) -> np.ndarray | None:
        """Return the rotations of these geoms, (1, geom, 3, 3), if none of their bodies turns, else None."""
        key = tuple(geoms)
        if key not in self._kept:
            turning = np.isin(self.body_of["geom"][list(key)], self.bodies[: self.turning]).any()
            self._kept[key] = None if turning else self.poses.geom_xmat[:, list(key)]
        return self._kept[key]

    def _in_body(self, kind: str, index: int) -> tuple[np.ndarray, np.ndarray]:
        prefix = _PREFIX[kind]
        origin, turned = self.poses.frames("body", int(self.body_of[kind][index]))
        place, rotation = (getattr(self.poses, f"{prefix}{what}")[0, index] for what in ("pos", "mat"))
        # Rounded, so that an element that shares its body's frame gets exactly 0 and 1.
        found = turned[0].T @ (place - origin[0]), turned[0].T @ rotation
        return np.round(found[0], 14) + 0.0, np.round(found[1], 14) + 0.0


class MovedBodies(Poses):
    """Poses of worlds that differ from a reference pose only in the poses of some bodies, the moved bodies.

    reference: the model in its reference pose, and the ids of the moved bodies
    positions: positions of the moved bodies [m], (world, body, 3)
    rotations: rotations of those moved bodies that may turn, (world, turning body, 3, 3). In the list of moved bodies,
        the bodies that may turn come before those that may not
    models: model of each world, if sizes, colours or materials of geoms differ between worlds; None: all worlds have
        the sizes, colours and materials of the renderer's model
    """

    reference: ReferencePose
    positions: np.ndarray
    rotations: np.ndarray

    def __init__(
        self,
        reference: ReferencePose,
        positions: np.ndarray,
        rotations: np.ndarray,
        models: Sequence[mujoco.MjModel] | None = None,
    ) -> None:
        own = {} if models is None else {name: of_models(models, name) for name in OF_MODELS}
        vars(self).update(reference=reference, positions=positions, rotations=rotations, **own)

    def __getattr__(self, name: str) -> np.ndarray:
        """Build an array, one of the attributes that `Poses` defines, when the attribute is first read."""
        if name not in Poses.__dataclass_fields__:
            raise AttributeError(name)
        vars(self)[name] = built = self._built(name)
        return built

    @property
    def n(self) -> int:
        return len(self.positions)

    def geom_places(self, geoms: Sequence[int] | np.ndarray) -> np.ndarray:
        if (slots := self.reference.slots(geoms)) is not None:
            return self.positions[:, slots]
        return np.stack([self._frame("geom", int(geom))[0] for geom in geoms], axis=1)

    def geom_turns(self, geoms: Sequence[int] | np.ndarray) -> np.ndarray:
        if (kept := self.reference.kept_turns(geoms)) is not None:
            return kept
        if (slots := self.reference.slots(geoms)) is not None:
            return self._turns()[:, slots]
        return np.stack([self._frame("geom", int(geom))[1] for geom in geoms], axis=1)

    def take(self, worlds: np.ndarray) -> MovedBodies:
        found = MovedBodies(self.reference, self.positions[worlds], self.rotations[worlds])
        own = {name: array[worlds] for name in OF_MODELS if (array := vars(self).get(name)) is not None}
        vars(found).update(own)
        return found

    def frames(self, kind: str, index: int) -> tuple[np.ndarray, np.ndarray]:
        if kind != "body":
            return self._frame(kind, index)
        if index not in self.reference.bodies:
            return super().frames(kind, index)
        place = self.reference.bodies.index(index)
        if place < self.reference.turning:
            return self.positions[:, place], self.rotations[:, place]
        return self.positions[:, place], np.broadcast_to(self.reference.poses.xmat[0, index], (self.n, 3, 3))

    def _frame(self, kind: str, index: int) -> tuple[np.ndarray, np.ndarray]:
        body = int(self.reference.body_of[kind][index])
        if body not in self.reference.bodies:
            still = (getattr(self.reference.poses, f"{_PREFIX[kind]}{what}")[0, index] for what in ("pos", "mat"))
            origin, rotation = (np.broadcast_to(array, (self.n, *array.shape)) for array in still)
            return origin, rotation
        origin, rotation = self.frames("body", body)
        offset, turn = self.reference.local(kind, index)
        return (
            origin + rotation @ offset if offset.any() else origin,
            rotation if np.array_equal(turn, np.eye(3)) else rotation @ turn,
        )

    def _turns(self) -> np.ndarray:
        """Return the rotations of all moving bodies, (world, body, 3, 3)."""
        found: np.ndarray = np.repeat(self.reference.poses.xmat[:, self.reference.bodies], self.n, axis=0)
        found[:, : self.reference.turning] = self.rotations
        return found

    def _built(self, name: str) -> np.ndarray:
        found: np.ndarray = np.repeat(getattr(self.reference.poses, name), self.n, axis=0)
        if name == "xpos":
            found[:, self.reference.bodies] = self.positions
        if name == "xmat":
            found[:, self.reference.bodies] = self._turns()
        for kind, prefix in _PREFIX.items():
            if name.startswith(prefix):
                for index in self.reference.moved(kind):
                    found[:, index] = self._frame(kind, index)[name.endswith("mat")]
        return found


def as_slice(indices: list[int]) -> slice | list[int]:
    """Return indices into an array, as a slice if they are adjacent. Indexing with a slice avoids a copy."""
    adjacent = bool(indices) and indices == list(range(indices[0], indices[0] + len(indices)))
    return slice(indices[0], indices[-1] + 1) if adjacent else indices
