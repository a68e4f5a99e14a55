"""Sizes, colours and materials that differ between the built-in worlds, all of which share one layout."""

from __future__ import annotations

from collections.abc import Mapping

import mujoco

from sim.scene.primitive_geoms import kind_of
from sim.scene.variation import SIZE, START, Drawn, Variation
from sim.scene.world_models import WorldModels

__all__ = ["VariedLooks", "varied_looks"]


class VariedLooks:
    """A copy of the model for each world, for renderers alone: agents move in the shared one.

    models: of each world · varied: names of geoms that differ, and of the materials that they may have
    """

    def __init__(self, model: mujoco.MjModel, n: int, variation: Variation) -> None:
        sizes = variation.of_things(SIZE)
        self._sizes = {_weightless(model, thing, name): name for thing, name in sizes.items()}
        rest = Variation({name: given for name, given in variation.ranges.items() if name not in sizes.values()})
        self._bodies = WorldModels(model, model, n, rest)
        if not self._bodies.own:
            self._bodies.separate()
        self._natural = model.geom_size.copy()
        names = {model.geom(geom).name: () for geom in self._sizes}
        self.models, self.varied = self._bodies.models, {**names, **self._bodies.varied}

    def begin(self, world: int, drawn: Mapping[str, Drawn]) -> None:
        """A world's looks from now on."""
        self._bodies.begin(world, drawn)
        for geom, name in self._sizes.items():
            self.models[world].geom_size[geom] = float(drawn[name]) * self._natural[geom]


def varied_looks(model: mujoco.MjModel, n: int, variation: Variation) -> VariedLooks | None:
    """None if only light varies.

    Raises:
        ValueError: the model has no such thing, or it cannot differ.
    """
    if starts := variation.of_things(START):
        raise ValueError(
            f"vary: {next(iter(starts.values()))}: must be left out, the task itself places agent and objects"
        )
    return VariedLooks(model, n, variation) if variation.of_looks else None


def _weightless(model: mujoco.MjModel, thing: str, name: str) -> int:
    """Id of a geom whose size can differ in a shared layout: it touches nothing."""
    geom = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, thing)
    if geom < 0:
        known = ", ".join(model.geom(g).name for g in range(model.ngeom) if model.geom(g).name)
        raise ValueError(f"vary: {name}: the model has no geom {thing!r}; it has {known}")
    if model.geom_contype[geom] or model.geom_conaffinity[geom]:
        raise ValueError(f"vary: {name}: {thing!r} is touched, and all worlds share one layout: its size must not vary")
    if kind_of(model, geom) is None:
        raise ValueError(
            f"vary: {name}: {thing!r} has a texture or is a mesh: only plain primitives may differ in size"
        )
    return int(geom)
