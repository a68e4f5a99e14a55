"""Optic flow: where what eyes look at moves on their retinas, from geometry alone.

What lies on a rigid body goes with it, and the eye goes with its own (Longuet-Higgins & Prazdny 1980). Taken from one
moment to another it is exact, whatever has happened in between.
"""

from __future__ import annotations

import numpy as np

import optics
from sim.eyes.sampling import on_tangent_plane
from sim.scene.poses import Poses

Frames = tuple[np.ndarray, np.ndarray]  # pupils [m] (world, eye, 3), eyes' frames (world, eye, 3, 3)


def receptor_centres(eye: optics.Eye) -> np.ndarray:
    """Places of the receptors' centres on the tangent plane, x to the right and y down [receptors], (receptor, 2)."""
    height, width = eye.resolution
    row, column = (index.ravel() for index in np.indices((height, width)))
    return np.stack([column + 0.5 - width / 2, row + 0.5 - height / 2], axis=-1)


def flow_between(
    eye: optics.Eye, depth: np.ndarray, ids: np.ndarray, moments: tuple[Poses, Poses], frames: tuple[Frames, Frames]
) -> np.ndarray:
    """(world, eye, 2, height, width) float32: to the right and down [receptors]; NaN where there is nothing to see, or
    where it is beside or behind the eye by then.

    depth, ids: of what each receptor's centre sees at the first moment, (world, eye, height, width)
    moments: where everything is · frames: of the eyes, at both
    """
    worlds, eyes = depth.shape[:2]
    geoms, far = ids.reshape(worlds, eyes, -1), depth.reshape(worlds, eyes, -1, 1)
    seen = geoms >= 0
    centres = receptor_centres(eye)
    (pupils, axes), (later_pupils, later_axes) = frames
    local = on_tangent_plane(eye, centres) * np.where(seen[..., None], far, 1.0)
    points = pupils[:, :, None] + np.einsum("wepq,werq->werp", axes, local)
    carried = _carried(points, np.where(seen, geoms, 0), moments)
    ahead = np.einsum("weqp,werq->werp", later_axes, carried - later_pupils[:, :, None])
    before = seen & (ahead[..., 2] > 0)
    side = eye.receptor_pitch / eye.sensor_distance
    places = ahead[..., :2] / np.where(before, ahead[..., 2], 1.0)[..., None] / side * [1, -1]
    found = np.where(before[..., None], places - centres, np.nan)
    return np.moveaxis(found, -1, 2).reshape(worlds, eyes, 2, *eye.resolution).astype(np.float32)


def _carried(points: np.ndarray, geoms: np.ndarray, moments: tuple[Poses, Poses]) -> np.ndarray:
    """Where points (world, eye, receptor, 3) on these geoms are later."""
    world = np.arange(len(points))[:, None, None]
    (old_place, old_turn), (place, turn) = (
        (poses.geom_xpos[world, geoms], poses.geom_xmat[world, geoms]) for poses in moments
    )
    on_geom = np.einsum("werpq,werp->werq", old_turn, points - old_place)
    found: np.ndarray = place + np.einsum("werpq,werq->werp", turn, on_geom)
    return found
