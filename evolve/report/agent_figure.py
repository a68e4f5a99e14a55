"""Drawing of an animal: its head and eyes, seen from the front and above, and the horizontal fields of view."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

import sim
from evolve.report.markup import Html, html, joined

__all__ = ["agent_figure"]

RADIUS = 48.0  # radius of the head, in units of the drawing
REACH = 2.8  # length of the drawn fields of view, in head radii
ELEVATION = math.radians(42)  # elevation of the viewpoint in front of the animal
AHEAD = math.radians(205)  # direction of the heading in the drawing; the viewpoint is slightly to one side of it
LARGEST_EYE = math.radians(24)  # maximum half angle of an eye's disk on the head


def agent_figure(eyes: sim.Eyes, name: str, placed: Sequence[float] | np.ndarray) -> Html:
    """Return a drawing of the head, seen from the front and above.

    Eyes are disks on the head, so small that only eyes with the same azimuth overlap.

    eyes: design of the eyes
    name: prefix of the ids in the drawing, unique on the page
    placed: azimuths of the eyes [rad], (eye,)
    """
    azimuths = [float(azimuth) for azimuth in placed]
    between = _closest(azimuths)
    half = min(LARGEST_EYE, 0.45 * between) if eyes.n_eyes > 1 and between > 0 else LARGEST_EYE
    fields = joined(_field(azimuth, math.radians(eyes.fov_deg)) for azimuth in azimuths)
    behind = joined(_eye(azimuth, half) for azimuth in azimuths if not _faces(azimuth))
    before = joined(_eye(azimuth, half) for azimuth in azimuths if _faces(azimuth))
    height, width = eyes.resolution
    size = f"{eyes.fov_deg:.0f} degrees wide and {eyes.fovy_deg:.0f} high"
    says = f"{eyes.n_eyes} eyes of {height} by {width} receptors, each {size}"
    return html(
        '<svg class="agent" viewBox="-150 -112 300 224" role="img" aria-label="{}">'
        '<defs><radialGradient id="{}-skin" cx="38%" cy="30%" r="75%"><stop offset="0" stop-color="#efe4d2"/>'
        '<stop offset=".6" stop-color="#c9b79c"/><stop offset="1" stop-color="#7d6c52"/></radialGradient></defs>'
        '<g class="fields">{}</g>{}<circle r="{}" fill="url(#{}-skin)"/>{}</svg>',
        *(says, name, fields, behind, RADIUS, name, before),
    )


def _closest(azimuths: Sequence[float]) -> float:
    """Return the smallest angle between two different azimuths; 0 if all azimuths are equal."""
    around = np.unique(np.round(np.mod(azimuths, 2 * math.pi), 6))
    return float(np.diff([*around, around[0] + 2 * math.pi]).min()) if len(around) > 1 else 0.0


def _projected(points: np.ndarray) -> np.ndarray:
    """Return the positions of points in the drawing, in its units, (n, 2).

    points: (x ahead, y to the left, z up) in radii of the head, (n, 3)
    """
    x, y, z = points.T
    turned = AHEAD - math.pi
    depth = x * math.cos(turned) + y * math.sin(turned)  # towards the viewpoint
    right = -x * math.sin(turned) + y * math.cos(turned)
    up = z * math.cos(ELEVATION) - depth * math.sin(ELEVATION)
    return RADIUS * np.stack([right, -up], axis=1)


def _faces(azimuth: float) -> bool:
    """Return whether an eye at this azimuth is on the visible side of the head."""
    return math.cos(azimuth - (AHEAD - math.pi)) > 0


def _field(azimuth: float, fov: float) -> Html:
    """Return the horizontal field of view of an eye as a sector in the plane of the eyes.

    azimuth, fov: direction of the eye and width of the field [rad]
    """
    angles = azimuth + np.linspace(-fov / 2, fov / 2, 1 + max(2, int(math.degrees(fov) / 5)))
    near = np.array([[math.cos(azimuth), math.sin(azimuth), 0.0]])
    far = REACH * np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], axis=1)
    return html('<polygon points="{}"/>', _points(_projected(np.concatenate([near, far]))))


def _eye(azimuth: float, half: float) -> Html:
    """Return an eye as a disk on the head's equator, with a highlight.

    azimuth, half: direction of the eye, and half the angle that the disk covers on the head [rad]
    """
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
