"""Sizes, colours and materials that differ between built-in worlds of one layout."""

from __future__ import annotations

from collections.abc import Mapping

import mujoco

from sim.scene.primitive_geoms import is_resizable
from sim.scene.variation import SIZE, START, Drawn, Variation
from sim.scene.world_models import WorldModels

__all__ = ["VariedAppearances", "varied_appearances"]


class VariedAppearances:
    """Copies of the model for rendering, one per world. Physics uses one model for all worlds.

    models: the models of the worlds
    varied: names of the geoms that differ between worlds, with the materials that they may have
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

    def start_episode(self, world: int, drawn: Mapping[str, Drawn]) -> None:
        """Set a world's sizes, colours and materials."""
        self._bodies.start_episode(world, drawn)
        for geom, name in self._sizes.items():
            self.models[world].geom_size[geom] = float(drawn[name]) * self._natural[geom]


def varied_appearances(model: mujoco.MjModel, n: int, variation: Variation) -> VariedAppearances | None:
    """Return the varied appearances; None if only light varies.

    Raises:
        ValueError: `variation` names an object that the model lacks or that cannot vary. Or it varies a starting
            position, but the task itself places the agent and the objects.
    """
    if starts := variation.of_things(START):
        raise ValueError(
            f"vary: {next(iter(starts.values()))}: must be left out, the task itself places agent and objects"
        )
    return VariedAppearances(model, n, variation) if variation.of_appearances else None


def _weightless(model: mujoco.MjModel, thing: str, name: str) -> int:
    """Return the id of the geom `thing`, after checking that the geom's size may differ between worlds.

    The geom's size differs only in the models for rendering. Physics uses one model for all worlds, with one size, so
    the geom must be one that agents cannot touch.

    name: name of the varied quantity, for error messages

    Raises:
        ValueError: there is no such geom, agents touch it, or it is not a plain primitive.
    """
    geom = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, thing)
    if geom < 0:
        known = ", ".join(model.geom(g).name for g in range(model.ngeom) if model.geom(g).name)
        raise ValueError(f"vary: {name}: the model has no geom {thing!r}; it has {known}")
    if model.geom_contype[geom] or model.geom_conaffinity[geom]:
        raise ValueError(f"vary: {name}: agents touch {thing!r}, which all worlds share: its size must not vary")
    if not is_resizable(model, geom):
        raise ValueError(
            f"vary: {name}: {thing!r} has a texture, or is a mesh or plane: only plain primitives may differ in size"
        )
    return int(geom)
