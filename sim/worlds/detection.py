"""Detection: an open walled field with a goal, which has vertical stripes, and two adversaries with horizontal ones."""

from __future__ import annotations

import mujoco
import numpy as np

from sim.worlds import materials
from sim.worlds.layout import CELL, Layout, Starts, add_floor, add_wall, cell_centers

FIELD = (9, 11)  # free cells (rows, columns), as published
OBJECT_RADIUS = 0.5  # [m], as published
OBJECTS = ("goal", "adversary_0", "adversary_1")
STRIPES = 6  # number of stripes on the visible half of an object
# Edges between an adversary's stripes [deg from the top]. As seen by an agent, they are about as far apart as the edges
# between a goal's stripes. In light from above, both kinds of objects have the same mean brightness, as computed by
# validation/sim/equal_brightness.py.
BAND_EDGES_DEG = (23.2, 47.8, 77.1, 107.0, 138.0, 170.0)
OBJECT_MARGIN = 2  # number of cells between the walls and the cells in which objects may be placed


def add_layout(spec: mujoco.MjSpec, rng: np.random.Generator) -> Layout:
    """Add a walled field with a goal and two adversaries. Nothing is random, so `rng` is not used.

    A goal has vertical stripes, which follow meridians. An adversary has horizontal stripes of about the same width,
    which follow parallels.

    A goal's stripes are 12 sectors of 30° around the vertical axis, and a viewer sees 6 of them. The edges of an
    adversary's stripes are placed such that in light from above, it has the same brightness as a goal, on average over
    the horizontal directions of view. From 2 m or more, a single receptor that sees the whole object therefore
    cannot distinguish a goal from an adversary by brightness.
    """
    materials.add_texture(spec, "upright_stripes", materials.stripes((8, 1536), 2 * STRIPES, axis=1))
    materials.add_texture(
        spec, "level_stripes", materials.stripes((1024, 8), [edge / 180 for edge in BAND_EDGES_DEG], axis=0)
    )
    materials.add_textured(spec, "goal", "upright_stripes")
    materials.add_textured(spec, "adversary", "level_stripes")
    return furnished_field(spec)


def furnished_field(spec: mujoco.MjSpec) -> Layout:
    """Add a walled field with a goal and two adversaries, made of the materials "goal" and "adversary".

    The agent starts in the outermost ring of cells. The objects are placed in the middle of the field.
    """
    _add_field(spec)
    _add_objects(spec)
    rows, columns = (a.ravel() for a in np.indices(FIELD))
    to_wall = np.minimum.reduce([rows, columns, FIELD[0] - 1 - rows, FIELD[1] - 1 - columns])
    centers = cell_centers(columns, rows, FIELD)
    return Layout(
        objects=OBJECTS,
        starts=Starts(centers[to_wall == 0]),
        object_spawn=centers[to_wall >= OBJECT_MARGIN],
        goal_region=None,
    )


def _add_field(spec: mujoco.MjSpec) -> None:
    length, width = FIELD[1] * CELL, FIELD[0] * CELL
    add_floor(spec, (length + 2 * CELL, width + 2 * CELL))
    x, y = (length + CELL) / 2, (width + CELL) / 2
    add_wall(spec, "wall_east", np.array([x, 0]), (CELL, width + 2 * CELL), "wall")
    add_wall(spec, "wall_west", np.array([-x, 0]), (CELL, width + 2 * CELL), "wall")
    add_wall(spec, "wall_north", np.array([0, y]), (length, CELL), "wall")
    add_wall(spec, "wall_south", np.array([0, -y]), (length, CELL), "wall")


def _add_objects(spec: mujoco.MjSpec) -> None:
    for name, center in zip(OBJECTS, ((0, 0), (2 * CELL, 0), (-2 * CELL, 0)), strict=True):
        body = spec.worldbody.add_body(name=name, mocap=True, pos=[*center, OBJECT_RADIUS])
        body.add_geom(
            name=name,
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            size=[OBJECT_RADIUS, 0, 0],
            material=name.partition("_")[0],
            contype=0,
            conaffinity=0,
        )
