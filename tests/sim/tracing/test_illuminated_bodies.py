"""The share of each light that reaches bodies, against very many rays from points of equivalent disks."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from sim.render.world_scene import WorldScene
from sim.scene.variant import variant
from sim.tracing.areas import illuminated_bodies
from sim.worlds.world import build_world
from tests.sim.tracing.area_views import COARSE
from tests.sim.tracing.crowded_rooms import WORLDS, bodies_of

POINTS = 4096  # points of a disk; a share's own error is then 0.005, and at most twice that


@pytest.fixture(scope="module")
def scene():
    return WorldScene(build_world("detection"), COARSE)


def table(scene, centres):
    tracer = scene.areas("all")
    place = dr.arange(mi.UInt32, tracer.places * WORLDS) % tracer.places
    bodies = [mi.Point3f(np.repeat(c, tracer.places, axis=0).T.astype(np.float32)) for c in np.moveaxis(centres, 1, 0)]
    return tracer, tracer.body_light(place, bodies, tracer.inputs)


def lit_by_rays(scene, disk, radius, centres, others):
    """Return the share, per light and world, of a horizontal disk's points that are lit, past walls and past `others`
    among the bodies.
    """
    rays, rng = scene.tracers.tracer_for("direct"), np.random.default_rng(1)
    r, turn = np.sqrt(rng.random(POINTS)) * radius, rng.uniform(0, 2 * np.pi, POINTS)
    points = disk[:, None] + np.stack([r * np.cos(turn), r * np.sin(turn), np.zeros(POINTS)], axis=-1)
    found = []
    for light in rays.lights:
        start = mi.Point3f(points.reshape(-1, 3).T.astype(np.float32))
        free = ~np.array(rays.footprints.blocks(start, light.direction, rays.inputs.cells)).astype(bool).reshape(
            WORLDS, -1
        )
        for k in others:
            way = centres[:, None, k] - points
            ahead = way @ light.direction
            beside = np.linalg.norm(way, axis=-1) ** 2 - ahead**2
            free &= ~((ahead > 0) & (beside < scene.upright.bodies.radii[k] ** 2))
        found.append(free.mean(axis=1))
    return np.array(found)


def errors(scene, side):
    """Return the root-mean-square error over bodies, worlds and lights, and the mean share of light that is blocked.

    side: normal of one side of the bodies; None: whole bodies
    """
    centres = bodies_of(scene)
    found, dark, radii = [], [], scene.upright.bodies.radii
    with variant(scene.variant):
        tracer, rows = table(scene, centres)
        lit = tracer._illumination.bodies
        world = dr.arange(mi.UInt32, WORLDS)
        for k, radius in enumerate(radii):
            if side is None:
                shares = lit.on_whole(mi.UInt32(k), world, rows)
                truth = lit_by_rays(scene, centres[:, k], radius, centres, ())
            else:
                shares = lit.on_side(mi.UInt32(k), mi.Vector3f(*side), world, rows)
                disk = centres[:, k] + np.array([*side[:2], 0]) * radius * illuminated_bodies.MIDDLE
                others = [j for j in range(len(radii)) if j != k]
                truth = lit_by_rays(scene, disk, radius / 2, centres, others)
            found.append(np.array([np.array(s) for s in shares]) - truth)
            dark.append(1 - truth)
    return float(np.sqrt(np.mean(np.square(found)))), float(np.mean(dark))


@pytest.mark.parametrize("side", [None, (1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0)])
def test_shares_are_those_of_disks(scene, side):
    """The limit is 1.5 times the measured error, including the rays' own 0.005. The table replaces the disk by a square
    of the same area, and edges of shadows by straight lines.
    """
    error, dark = errors(scene, side)
    assert dark > 0.09  # otherwise shadows would be too rare for a test
    assert error < 0.015


@pytest.mark.parametrize("side", [(-0.6, 0.0, 0.8), (0.4, 0.3, -0.8)])
def test_shares_between_the_tables_places_are_near_them(scene, side):
    """The limit is 1.5 times the measured error. If the table had twice as many places per axis, the error would be
    0.015.
    """
    assert errors(scene, side)[0] < 0.075


def other_bodies_do_not_shade(monkeypatch):
    monkeypatch.setattr(
        illuminated_bodies, "lit_past_sphere", lambda patch, directions, *_: [mi.Float(1) for _ in directions]
    )


def sides_are_mirrored(monkeypatch):
    right = illuminated_bodies.IlluminatedBodies.on_side
    monkeypatch.setattr(
        illuminated_bodies.IlluminatedBodies, "on_side", lambda self, k, towards, *rest: right(self, k, -towards, *rest)
    )


def rows_of_the_next_world(monkeypatch):
    right = illuminated_bodies.IlluminatedBodies._row
    monkeypatch.setattr(
        illuminated_bodies.IlluminatedBodies, "_row", lambda self, row, table: right(self, row + 1, table)
    )


@pytest.mark.parametrize("wrong", [other_bodies_do_not_shade, sides_are_mirrored, rows_of_the_next_world])
def test_wrong_tables_are_noticed(scene, monkeypatch, wrong):
    wrong(monkeypatch)
    assert max(errors(scene, side)[0] for side in ((1.0, 0.0, 0.0), (0.0, -1.0, 0.0))) > 0.1


def test_worlds_without_reflected_light_have_no_table(scene):
    assert scene.areas("direct").places == 0
