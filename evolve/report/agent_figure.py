"""The animal as a figure: its head and eyes from in front and above, with what its eyes look at on their level."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

import sim
from evolve.report.markup import Html, html, joined

__all__ = ["agent_figure"]

RADIUS = 48.0  # of the head, in units of the drawing
REACH = 2.8  # head radii that fields of view are drawn
ELEVATION = math.radians(42)  # of the onlooker, in front of the animal
AHEAD = math.radians(205)  # direction that the head is seen from: a little to its left, so that it is no flat face
LARGEST_EYE = math.radians(24)  # half angle of the head that an eye's disk takes, at most


def agent_figure(eyes: sim.Eyes, name: str, placed: Sequence[float] | np.ndarray) -> Html:
    """A drawing of the head, seen from in front and above; eyes as disks, as wide as their room on the head allows.

    name: keeps the ids in the drawing apart from those of others on the page
    placed: azimuths of the eyes [rad]
    """
    azimuths = [float(azimuth) for azimuth in placed]
    between = _closest(azimuths)
    half = min(LARGEST_EYE, 0.45 * between) if eyes.n_eyes > 1 and between > 0 else LARGEST_EYE
    fields = joined(_field(azimuth, math.radians(eyes.fov_deg)) for azimuth in azimuths)
    behind = joined(_eye(azimuth, half) for azimuth in azimuths if not _faces(azimuth))
    before = joined(_eye(azimuth, half) for azimuth in azimuths if _faces(azimuth))
    height, width = eyes.resolution
    says = f"{eyes.n_eyes} eyes of {height} by {width} receptors, {eyes.fov_deg:.0f} degrees wide each"
    return html(
        '<svg class="agent" viewBox="-150 -112 300 224" role="img" aria-label="{}">'
        '<defs><radialGradient id="{}-skin" cx="38%" cy="30%" r="75%"><stop offset="0" stop-color="#efe4d2"/>'
        '<stop offset=".6" stop-color="#c9b79c"/><stop offset="1" stop-color="#7d6c52"/></radialGradient></defs>'
        '<g class="fields">{}</g>{}<circle r="{}" fill="url(#{}-skin)"/>{}</svg>',
        *(says, name, fields, behind, RADIUS, name, before),
    )


def _closest(azimuths: Sequence[float]) -> float:
    """Between neighbours that do not look the same way, all round; 0 where there are none."""
    around = np.unique(np.round(np.mod(azimuths, 2 * math.pi), 6))
    return float(np.diff([*around, around[0] + 2 * math.pi]).min()) if len(around) > 1 else 0.0


def _projected(points: np.ndarray) -> np.ndarray:
    """Points (n, 3) in head radii, x ahead, y left, z up, as the onlooker sees them, (n, 2) in units of the drawing."""
    x, y, z = points.T
    turned = AHEAD - math.pi
    depth = x * math.cos(turned) + y * math.sin(turned)  # towards the onlooker
    right = -x * math.sin(turned) + y * math.cos(turned)
    up = z * math.cos(ELEVATION) - depth * math.sin(ELEVATION)
    return RADIUS * np.stack([right, -up], axis=1)


def _faces(azimuth: float) -> bool:
    """Whether an eye on the head's equator is on the side that is seen."""
    return math.cos(azimuth - (AHEAD - math.pi)) > 0


def _field(azimuth: float, fov: float) -> Html:
    """What an eye looks at, as a sector on the level of the eyes."""
    angles = azimuth + np.linspace(-fov / 2, fov / 2, 1 + max(2, int(math.degrees(fov) / 5)))
    near = np.array([[math.cos(azimuth), math.sin(azimuth), 0.0]])
    far = REACH * np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], axis=1)
    return html('<polygon points="{}"/>', _points(_projected(np.concatenate([near, far]))))


def _eye(azimuth: float, half: float) -> Html:
    """A disk on the head's equator, with a glint."""
    around = np.linspace(0, 2 * math.pi, 33)[:-1]
    normal = np.array([math.cos(azimuth), math.sin(azimuth), 0.0])
    left, up = np.array([-math.sin(azimuth), math.cos(azimuth), 0.0]), np.array([0.0, 0.0, 1.0])
    rim = math.cos(half) * normal + math.sin(half) * (np.cos(around)[:, None] * left + np.sin(around)[:, None] * up)
    glint = _projected((normal + 0.3 * math.sin(half) * (up + left))[None])[0]
    return html(
        '<polygon class="eye" points="{}"/><circle class="glint" cx="{}" cy="{}" r="{}"/>',
        *(_points(_projected(rim)), f"{glint[0]:.1f}", f"{glint[1]:.1f}", f"{0.16 * RADIUS * math.sin(half):.1f}"),
    )


def _points(points: Iterable[Iterable[float]]) -> str:
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
