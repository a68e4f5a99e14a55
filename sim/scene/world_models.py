"""A model for each world, if quantities of objects differ between worlds or a task changes the model.

If sizes differ, MuJoCo's compiler computes the mass, the inertia and all other quantities that depend on the sizes of a
world's geoms. The mass of an object with a density therefore scales with its volume, and an object with a given mass
keeps this mass. A new episode changes the contents of a world's MjModel and MjData, but does not replace these Python
objects.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np

from optics.numerics.arguments import did_you_mean
from sim.scene import source, surfaces
from sim.scene import variation as of_worlds
from sim.scene.appearances import in_material, material_of
from sim.scene.model_settings import ModelSettings
from sim.scene.primitive_geoms import is_resizable
from sim.scene.variation import COLOR, MATERIAL, OF_THINGS, SIZE, START, Variation

Drawn = Mapping[str, of_worlds.Drawn]
# Fields that do not depend on sizes. They are not copied, because some are large.
_FIXED = ("tex", "mesh", "hfield", "skin", "mat_", "name", "text", "numeric", "tuple", "key", "path")
_JOINTS = (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE)


class WorldModels:
    """Models of `n` worlds.

    given: source of the model, see `sim.scene.source.load`; only needed if sizes differ
    model: the compiled model; worlds have copies of it
    n: number of worlds
    variation: ranges of the quantities that differ between worlds; None: nothing differs
    models: models of the worlds; a single one for all, unless `own` is True
    own: True if each world has its own model, because sizes, colours or materials differ between worlds, or because
        a task changes the model (`separate`). If it is True, each episode starts from the compiled model.
    varied: names of the geoms whose size, colour or material differs, each with the materials that episodes may choose

    Raises:
        ValueError: `variation` names an object that the model lacks or that cannot vary, or sizes differ and the source
            is a compiled model.
    """

    def __init__(self, given: Any, model: mujoco.MjModel, n: int, variation: Variation | None) -> None:
        ranges = {what: {} if variation is None else variation.of_things(what) for what in OF_THINGS}
        self.model = model
        self._sizes = {_geom(model, thing, name): name for thing, name in ranges[SIZE].items()}
        self._colors = {_geom(model, thing, name): name for thing, name in ranges[COLOR].items()}
        self._starts = {name: _place(model, thing, name, variation) for thing, name in ranges[START].items()}
        materials = {_geom(model, thing, name): name for thing, name in ranges[MATERIAL].items()}
        self._materials = {geom: (name, self._candidates(geom, name, variation)) for geom, name in materials.items()}
        self.varied = {
            model.geom(g).name: tuple(self._materials[g][1]) if g in self._materials else ()
            for g in sorted({*self._sizes, *self._colors, *self._materials})
        }
        self.own, self._compiled = False, ModelSettings(model).to_bytes()
        self.models = [copy.copy(model)] * n
        self._settings = [ModelSettings(self.models[0])] * n
        if self.varied:
            self.separate()
        if self._sizes:
            self._prepare_sizes(given)

    def separate(self) -> None:
        """Give each world its own copy of the compiled model from now on."""
        self.own, self.models = True, [copy.copy(self.model) for _ in self.models]
        self._settings = [ModelSettings(model) for model in self.models]

    def get_state(self, world: int) -> bytes:
        """Return the current settings of a world's model, see `ModelSettings`."""
        return self._settings[world].to_bytes()

    def set_state(self, world: int, held: bytes) -> None:
        """Restore the settings that `get_state` returned."""
        self._settings[world].restore(held)

    def differs(self) -> bool:
        """Return whether the model that worlds share has changed since compilation; False if each world has its own."""
        return not self.own and self.get_state(0) != self._compiled

    def noted(self) -> bytes:
        """Return the current settings (`ModelSettings`) of the model that all worlds share.

        The result is empty if each world has its own model.
        """
        return b"" if self.own else self.get_state(0)

    def require_unchanged(self, before: bytes, whose: str) -> None:
        """Require that the worlds' shared model still has the settings `before`, which `noted` returned earlier.

        If there is only one world, a changed model is accepted and becomes the world's own model.

        whose: beginning of the message

        Raises:
            RuntimeError: the model that several worlds share has changed.
        """
        if self.own or self.get_state(0) == before:
            return
        self.own = len(self.models) == 1
        if not self.own:
            raise RuntimeError(
                f"{whose}: {self._settings[0].differing(before)} of data.model has changed, and all worlds share it: "
                "must be changed by the first `reset`, too; then each world has its own model"
            )

    def start_episode(self, world: int, drawn: Drawn) -> None:
        """Set the sizes, colours and materials in a world's model to the values drawn for an episode.

        If each world has its own model, the settings of this model are first reset to those of the compiled model.

        Raises:
            ValueError: a material in `drawn` is not one of the materials that `variation` lists for the geom.
        """
        mine = self.models[world]
        if self.own and self.get_state(world) != self._compiled:
            self.set_state(world, self._compiled)
        if self._sizes:
            self._resize(mine, drawn)
        for geom, name in self._colors.items():
            mine.geom_rgba[geom] = surfaces.set_rgba([*np.asarray(drawn[name]), surfaces.rgba(self.model, geom)[3]])
        for geom, (name, candidates) in self._materials.items():
            if (material := str(drawn[name])) not in candidates:
                raise ValueError(f"{name} = {material!r}: must be one of {', '.join(candidates)}")
            mine.geom_matid[geom] = candidates[material]

    def place(self, data: mujoco.MjData, drawn: Drawn) -> None:
        """Put objects at the starting places that were drawn at random, by setting their positions in `data`."""
        for name, (where, address) in self._starts.items():
            getattr(data, where)[address] = drawn[name]

    def _candidates(self, geom: int, name: str, variation: Variation | None) -> dict[str, int]:
        """Return the ids of the materials that episodes may choose for a geom, by the names of the materials.

        Raises:
            ValueError: `variation` contains both materials and colours for the geom, the geom has a colour of its own,
                which would replace the colours of the materials, or a material is unknown.
        """
        assert variation is not None
        if geom in self._colors:
            raise ValueError(f"vary: {name} and {self._colors[geom]}: must be one of them; materials have colours")
        if not np.array_equal(self.model.geom_rgba[geom], surfaces.UNSET_RGBA):
            raise ValueError(f"vary: {name}: the geom's own rgba replaces the colours of its materials: must have none")
        return {each: material_of(self.model, each, f"vary: {name}") for each in variation.ranges[name]}

    def _prepare_sizes(self, given: Any) -> None:
        model, self._spec = self.model, _specification(given)
        for geom, name in self._sizes.items():
            drawn = self._materials.get(geom, ("", {}))[1].values()
            variants = [in_material(model, geom, material).model for material in drawn] or [model]
            if not all(is_resizable(variant, geom) for variant in variants):
                raise ValueError(
                    f"vary: {name}: must be a sphere, capsule, cylinder, ellipsoid or box without a texture"
                )
        by_name = {geom.name: geom for geom in self._spec.geoms}
        self._geoms = {geom: by_name[model.geom(geom).name] for geom in self._sizes}
        self._natural = {geom: (np.array(mjs.size), np.array(mjs.fromto)) for geom, mjs in self._geoms.items()}
        self._fields = _fields_of(model)

    def _resize(self, mine: mujoco.MjModel, drawn: Drawn) -> None:
        for geom, mjs in self._geoms.items():
            factor, (size, ends) = float(drawn[self._sizes[geom]]), self._natural[geom]
            middle = np.tile((ends[:3] + ends[3:]) / 2, 2)
            # A capsule that is defined by its ends keeps its centre. Its half length is not used.
            mjs.size, mjs.fromto = factor * size, middle + factor * (ends - middle)
        compiled = self._spec.compile()
        for name in self._fields:
            np.copyto(getattr(mine, name), getattr(compiled, name))
        for name in ("meaninertia", "meanmass", "meansize", "extent"):
            setattr(mine.stat, name, getattr(compiled.stat, name))
        mine.stat.center[:] = compiled.stat.center


def _geom(model: mujoco.MjModel, thing: str, name: str) -> int:
    found = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, thing)
    if found < 0:
        known = [model.geom(g).name for g in range(model.ngeom) if model.geom(g).name]
        hint = did_you_mean(thing, known) or (
            f"; it has {', '.join(map(repr, known))}" if known else "; none has a name"
        )
        raise ValueError(f"vary: {name}: the model has no geom {thing!r}{hint}")
    return int(found)


def _place(model: mujoco.MjModel, thing: str, name: str, variation: Variation | None) -> tuple[str, Any]:
    """Return the name of the field of mjData that contains an object's position, and the object's indices in it.

    thing: name of the object, which is a joint or a body
    name: name of the range of the object's initial places, a key of `variation.ranges`

    Raises:
        ValueError: the range consists of numbers, but the object is not a hinge or slide joint; or the range consists
            of points, but the object is neither a mocap body nor a body with a free joint.
    """
    assert variation is not None
    spatial = np.ndim(variation.ranges[name][0]) == 1
    joint = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, thing)
    body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, thing)
    if joint >= 0 and mujoco.mjtJoint(int(model.jnt_type[joint])) in _JOINTS and not spatial:
        return "qpos", int(model.jnt_qposadr[joint])
    if body >= 0 and spatial and model.body_mocapid[body] >= 0:
        return "mocap_pos", int(model.body_mocapid[body])
    if body >= 0 and spatial and model.body_jntnum[body] == 1:
        first = int(model.body_jntadr[body])
        if model.jnt_type[first] == mujoco.mjtJoint.mjJNT_FREE:
            start = int(model.jnt_qposadr[first])
            return "qpos", slice(start, start + 3)
    form = "points (x, y, z)" if spatial else "numbers"
    wanted = "a mocap body or one with a free joint" if spatial else "a hinge or slide joint"
    joints = [model.joint(j).name for j in range(model.njnt)]
    bodies = [model.body(b).name for b in range(1, model.nbody)]
    hint = did_you_mean(thing, [known for known in (bodies if spatial else joints) if known])
    raise ValueError(f"vary: {name} is between {form}: {thing!r} must be {wanted}{hint}")


def _specification(given: Any) -> mujoco.MjSpec:
    """Return the specification (MjSpec) of a model, which can be compiled repeatedly, with other sizes.

    given: source of the model, see `sim.scene.source.load`

    Raises:
        ValueError: `given` is a compiled model, or no specification can be read from it.
    """
    if source.is_compiled(given):
        kind = "an MjModel" if isinstance(given, mujoco.MjModel) else "a compiled file"
        raise ValueError(f"vary: sizes: model is {kind}: must be MJCF or an MjSpec, which can be compiled again")
    return source.specification(given)


def _fields_of(model: mujoco.MjModel) -> list[str]:
    names = [name for name in dir(model) if not name.startswith(("_", *_FIXED))]
    return [name for name in names if isinstance(getattr(model, name), np.ndarray) and getattr(model, name).size]
