"""Navigation: a course between striped walls, which leads from west to east around islands of walls."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import mujoco
import numpy as np
import scipy.ndimage

from optics.numerics.arguments import did_you_mean, shown
from sim.worlds.catalog import COURSES
from sim.worlds.course import GOAL_COLUMNS, Course
from sim.worlds.layout import CELL, Layout, Starts, add_floor
from sim.worlds.striped_walls import add_striped_walls

# Diagonal paths are wide: an agent between the corners of their walls can still move 2 m sideways. Paths split and join
# again. The shortest path is 90 m long.
SHORT = Course(
    """
    ###########################################
    #######...##########........###############
    ######..s..########....s.....##############
    #####.......######............#############
    ####...###...####...#....###...#########..#
    #S....#####...##...####...###...#######...#
    #S...#######..s...######...###.s.#####....#
    #S....#####......########...###...###...###
    ####...###...#############...###...#...####
    #####.......###############.s.........#####
    ######..s..#################......s..######
    #######...###################.......#######
    ###########################################
    """
)
# This course is twice as long as SHORT, and an episode has half as many actions. Only a fast agent gets far.
LONG = Course(
    """
    ##################################################################################
    #######...##########........###########################.......#########...########
    ######..s..########....s.....#########################......s..#######..s..#######
    #####.......######............#######################...........#####.......######
    ####...###...####...#....###...#####################...###...#...###...###...#####
    #S....#####...##...####...###...#######.##.########...###...###...#...#####......#
    #S...#######..s...######...###...#####..s...######...###...#####..s..#######.....#
    #S....#####......########...###...###........####...###...#######.....#####......#
    ####...###...#############...###...#...####...##...###...###########...###...#####
    #####.......###############...........######............#############.......######
    ######..s..#################......s..########...s......###############..s..#######
    #######...###################.......##########........#################...########
    ##################################################################################
    """,
    episode_steps=128,
)
DRAWN: Mapping[str, Course] = MappingProxyType(dict(zip(COURSES, (SHORT, LONG), strict=True)))


def course_named(course: str | Course) -> Course:
    """Return the built-in course of this name; return a `Course` unchanged.

    Raises:
        ValueError: there is no course of this name.
    """
    if isinstance(course, Course):
        return course
    if not isinstance(course, str) or course not in DRAWN:
        hint = did_you_mean(course, COURSES) if isinstance(course, str) else ""
        raise ValueError(
            f"course = {shown(course)}: must be sim.Course or one of {', '.join(map(repr, COURSES))}{hint}"
        )
    return DRAWN[course]


def add_layout(spec: mujoco.MjSpec, courses: Sequence[Course], rngs: Sequence[np.random.Generator]) -> Layout:
    """Add courses of equal size, which lie next to each other from south to north and are not connected.

    An episode starts on any of the courses.

    rngs: random number generators that draw the stripes on the walls: one for all courses, or one for each course
    """
    walls = np.concatenate([course.walls for course in courses])
    rows, columns = walls.shape
    add_floor(spec, (columns * CELL, rows * CELL))
    # Wall cells without an adjacent free cell are never visible, so they are omitted.
    near = scipy.ndimage.binary_dilation(~walls, np.ones((3, 3)))
    add_striped_walls(spec, walls & near, rngs)
    right, top = columns * CELL / 2 - CELL, rows * CELL / 2 - CELL
    return Layout(
        objects=(),
        starts=_starts(courses, training=False),
        training_starts=_starts(courses, training=True),
        object_spawn=np.empty((0, 2)),
        goal_region=np.array([right - GOAL_COLUMNS * CELL, -top, right, top]),
        episode_steps=courses[0].episode_steps,
    )


def _starts(courses: Sequence[Course], training: bool) -> Starts:
    """Return starting positions with headings along the courses."""
    positions, headings = list[np.ndarray](), list[float]()
    for number, course in enumerate(courses):
        cells = course.training_starts if training else course.starts
        north = (number - (len(courses) - 1) / 2) * len(course.walls) * CELL
        positions.append(course.places(cells) + np.array([0, north]))
        headings += [course.heading(cell) for cell in cells]
    return Starts(np.concatenate(positions), np.array(headings))
