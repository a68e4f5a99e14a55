"""Snapshot of a renderer's model, which is compared with the rendered worlds.

If a world differs from the model in a way that the renderer cannot show, the world is refused.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import mujoco
import numpy as np

from sim.scene import inventory, surfaces
from sim.scene.poses import HEADLIGHT, OF_MODELS, OTHERS, Poses, of_model

ROUNDING = 1e-6  # a few steps of float32: tolerance for positions [m] (relative beyond 1 m) and rotations
_MORE = {"size": ", and be a primitive without a texture", "material": ", with its materials"}
# Elements other than geoms, by fields of `Poses`; the last entry is MuJoCo's name.
_THINGS = (
    ("mat_rgba", "material", "mat_rgba"),
    ("mat_emission", "material", "mat_emission"),
    ("light_diffuse", "light", "light_diffuse"),
    ("light_active", "light", "light_active"),
    ("heights", "hfield", "hfield_data"),
)


class ModelSnapshot:
    """The state of a model when its renderer was built. Arrays are copies, since tasks may change the model later.

    geoms: ids of the visible geoms
    hidden: ids of the geoms that are invisible only because their alpha is 0
    moving: ids of the geoms that may move; all other geoms must remain in the model's pose
    resizable: ids of the geoms whose sizes in a rendered world may differ from those in the model
    varied: ids of the geoms whose appearance in a rendered world may differ from that in the model, each with the ids
        of the materials that it may have. If the list of materials is empty, only the geom's colour may differ (see
        `appearances.varied_geoms`)
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        geoms: Sequence[int],
        hidden: Sequence[int],
        moving: np.ndarray,
        resizable: np.ndarray,
        varied: Mapping[int, Sequence[int]],
    ) -> None:
        self._model, self._geoms = model, list(geoms)
        self._drawn = {geom: materials for geom, materials in varied.items() if materials}
        self._may = {
            "size": resizable.tolist(),
            "colour": [geom for geom in varied if geom not in self._drawn],
            "material": list(self._drawn),
        }
        self._hidden, self._still = np.array(hidden, int), np.setdiff1d(geoms, moving)
        self._own = {name: of_model(model, name).copy() for name in OF_MODELS}
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        self._place = data.geom_xpos[self._still].copy()
        self._turn = data.geom_xmat[self._still].reshape(-1, 3, 3).copy()
        self._counts = self._that_count()

    def _that_count(self) -> dict[str, list[int]]:
        """Return the ids of materials, lights and height fields whose values must be the same in worlds and model.

        The result is a dictionary. A key is the name of a field of `Poses`, for example "mat_rgba". The entry lists
        the ids of the elements for which this field must have the same value in every rendered world as in the model.
        Materials and height fields that do not affect images are omitted, for example materials that no geom has.
        """
        model, either = self._model, [*self._geoms, *self._hidden]
        more = {material for materials in self._drawn.values() for material in materials}
        unset = [g for g in either if np.array_equal(model.geom_rgba[g], surfaces.UNSET_RGBA)]
        fields = [g for g in self._geoms if model.geom_type[g] == mujoco.mjtGeom.mjGEOM_HFIELD]
        lights = list(range(model.nlight))
        return {
            "mat_rgba": sorted({int(model.geom_matid[g]) for g in unset} | more),
            "mat_emission": sorted({int(model.geom_matid[g]) for g in either} | more),
            "light_diffuse": lights,
            "light_active": lights,
            "heights": sorted({int(model.geom_dataid[g]) for g in fields}),
        }

    def refuse_differences(self, poses: Poses) -> None:
        """Refuse worlds that differ from the model in a way that the renderer cannot show.

        Raises:
            ValueError: a world differs in such a way; the message names the element.
        """
        self._refuse_other_materials(poses)
        for what, name in (("size", "geom_size"), ("colour", "geom_rgba"), ("material", "geom_matid")):
            differs = self._differing(poses, name)
            wrong = [g for g in differs if g in self._geoms and g not in self._may[what]]
            if wrong:
                raise ValueError(
                    f"{self._named('geom', wrong[0])} differs in {what} from the renderer's model: must be in "
                    f"`varied`{_MORE.get(what, '')}"
                )
        for name, kind, known_as in _THINGS:
            wrong = [thing for thing in self._differing(poses, name) if thing in self._counts[name]]
            if wrong:
                raise ValueError(
                    f"{self._named(kind, wrong[0])} differs in {known_as} from the renderer's model, which "
                    "still shows the old value: make a new renderer"
                )
        if others := self._differing(poses, "others"):
            named = (*OTHERS, *(f"vis.headlight.{name}" for name in HEADLIGHT))[others[0]]
            raise ValueError(
                f"{named} differs from the renderer's model, which still shows the old value: make a new renderer"
            )
        self._refuse_what_appears(poses)
        self._refuse_what_is_elsewhere(poses)

    def _named(self, kind: str, index: int) -> str:
        return f"{kind} {getattr(self._model, kind)(index).name or str(index)!r}"

    def _differing(self, poses: Poses, name: str) -> list[int]:
        """Return the ids of the elements (such as geoms) for which a field in some world differs from the model.

        poses: state of the rendered worlds
        name: the field of `poses` that is compared, such as "geom_size"
        """
        own, here = self._own[name], getattr(poses, name)
        if here is None:
            return []
        if here.shape[1:] != own.shape:
            raise ValueError("poses of another model")
        alike = here[:1] if here.strides[0] == 0 else here  # all worlds share one model
        if (alike == own).all():
            return []
        differs = (alike != own).reshape(len(alike), len(own), -1).any(axis=(0, 2))
        return [int(thing) for thing in np.flatnonzero(differs)]

    def _refuse_other_materials(self, poses: Poses) -> None:
        own = self._own["geom_matid"][None]
        for geom, materials in self._drawn.items():
            here = (own if poses.geom_matid is None else poses.geom_matid)[:, geom]
            if not np.isin(here, materials).all():
                listed = inventory.listed_materials(self._model, list(materials))
                name = self._model.geom(geom).name
                raise ValueError(f"geom {name!r} has a material other than {listed}, see `varied`")

    def _refuse_what_appears(self, poses: Poses) -> None:
        """Refuse geoms whose alpha was 0 when the renderer was made and is positive now.

        `refuse_differences` calls this after it has refused worlds in which a material's alpha differs from the model.
        """
        if not len(self._hidden) or not (self._differing(poses, "geom_rgba") + self._differing(poses, "geom_matid")):
            return
        rgba, material = (
            (self._own[name][None] if getattr(poses, name) is None else getattr(poses, name))[:, self._hidden]
            for name in ("geom_rgba", "geom_matid")
        )
        of_material = (rgba == surfaces.UNSET_RGBA).all(axis=-1) & (material >= 0)
        alpha = rgba[..., 3].copy()
        if of_material.any():
            alpha = np.where(of_material, self._own["mat_rgba"][material, 3], alpha)
        seen = self._hidden[(alpha > 0).any(axis=0)]
        if len(seen):
            raise ValueError(
                f"{self._named('geom', seen[0])} was invisible (alpha 0) when the renderer was made and is visible "
                "now: make a new renderer"
            )

    def _refuse_what_is_elsewhere(self, poses: Poses) -> None:
        if not len(self._still):
            return
        places, turns = poses.geom_xpos[:, self._still], poses.geom_xmat[:, self._still]
        if (places == self._place).all() and (turns == self._turn).all():
            return
        moved = np.abs(places - self._place) > ROUNDING * np.maximum(1, np.abs(self._place))
        turned = np.abs(turns - self._turn) > ROUNDING
        elsewhere = self._still[moved.any(axis=(0, 2)) | turned.any(axis=(0, 2, 3))]
        if len(elsewhere):
            raise ValueError(
                f"{self._named('geom', elsewhere[0])} is static in the renderer's model and has moved: must be on a "
                "joint or on a mocap body"
            )
