"""Optic flow: the motion, on the retina, of the images of visible points, from geometry alone.

A point on a rigid body moves with the body, and an eye moves with its own body (Longuet-Higgins & Prazdny 1980). The
flow between two moments is exact for any motion between them.
"""

from __future__ import annotations

import numpy as np

import optics
from sim.eyes.tangent_plane import from_receptors, on_tangent_plane, tangent_size, to_receptors
from sim.scene.poses import Poses

Frames = tuple[np.ndarray, np.ndarray]  # pupils [m] (world, eye, 3), eyes' frames (world, eye, 3, 3)


def receptor_centres(eye: optics.Eye) -> np.ndarray:
    """Return the receptors' centres, relative to the middle of the retina [receptor widths and heights], (receptor, 2).

    The coordinate x points to the right, and y points down.
    """
    height, width = eye.resolution
    row, column = (index.ravel() for index in np.indices((height, width)))
    return np.stack([column + 0.5 - width / 2, row + 0.5 - height / 2], axis=-1)


def flow_between(
    eye: optics.Eye, depth: np.ndarray, ids: np.ndarray, moments: tuple[Poses, Poses], frames: tuple[Frames, Frames]
) -> np.ndarray:
    """Return, for each receptor, how far the image of the point that it sees moves between two moments.

    The flow is the displacement from the first to the second moment, to the right and down [receptors]. It is NaN if a
    receptor sees no point, or if the point is not in front of the eye at the second moment. The result is an array
    (world, eye, 2, height, width) float32.

    depth, ids: depth and geom that each receptor's centre sees at the first moment, (world, eye, height, width)
    moments: poses at both moments
    frames: positions of the pupils, and eyes' frames, at both moments
    """
    worlds, eyes = depth.shape[:2]
    geoms, far = ids.reshape(worlds, eyes, -1), depth.reshape(worlds, eyes, -1, 1)
    seen = geoms >= 0
    centres = receptor_centres(eye)
    (pupils, axes), (later_pupils, later_axes) = frames
    local = on_tangent_plane(eye, from_receptors(eye, centres)) * np.where(seen[..., None], far, 1.0)
    points = pupils[:, :, None] + np.einsum("wepq,werq->werp", axes, local)
    carried = _carried(points, np.where(seen, geoms, 0), moments)
    ahead = np.einsum("weqp,werq->werp", later_axes, carried - later_pupils[:, :, None])
    before = seen & (ahead[..., 2] > 0)
    height, width = tangent_size(eye)
    places = ahead[..., :2] / np.where(before, ahead[..., 2], 1.0)[..., None] / [width, -height]
    found = np.where(before[..., None], to_receptors(eye, places) - centres, np.nan)
    return np.moveaxis(found, -1, 2).reshape(worlds, eyes, 2, *eye.resolution).astype(np.float32)


def _carried(points: np.ndarray, geoms: np.ndarray, moments: tuple[Poses, Poses]) -> np.ndarray:
    """Return the positions, at the second moment, of points (world, eye, receptor, 3) that are fixed to these geoms.

    points: positions in the world at the first moment [m]
    geoms: id of each point's geom, (world, eye, receptor)
    """
    world = np.arange(len(points))[:, None, None]
    (old_place, old_turn), (place, turn) = (
        (poses.geom_xpos[world, geoms], poses.geom_xmat[world, geoms]) for poses in moments
    )
    on_geom = np.einsum("werpq,werp->werq", old_turn, points - old_place)
    found: np.ndarray = place + np.einsum("werpq,werq->werp", turn, on_geom)
    return found
