"""Mounts: positions and directions of eyes on a MuJoCo model."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import mujoco
import numpy as np

from optics.numerics.arguments import (
    LARGEST,
    did_you_mean,
    finite,
    in_range,
    items,
    of_kind,
    one_of,
    reals,
    shown,
    whole,
)

EXAMPLE = "sim.Mount('head')"
MOST_EYES = 10_000  # chosen limit for the eyes of a fan or ring
KINDS = ("site", "camera", "body")  # kinds of objects among which a name is searched, in this order
# Axes (ahead, left, up) in the frame of the object that carries the eye, as rows. In the frame of a body or site, x
# points ahead and z up. MuJoCo's cameras look along -z, with x to the right.
_AXES = {
    "site": np.eye(3),
    "body": np.eye(3),
    "camera": np.array([[0.0, 0, -1], [-1, 0, 0], [0, 1, 0]]),
}


@dataclass(frozen=True)
class Mount:
    """Position and direction of one eye on a model.

    With all angles 0, the eye looks along the +x axis of a body or site, or in the viewing direction of a camera.

    on: name of a site, a camera or a body of the model
    azimuth_deg: rotation to the left, about the z axis of the object's frame (for a camera: about its upward axis)
    elevation_deg: rotation upwards, applied after the azimuth
    roll_deg: rotation about the optical axis, which turns the eye's top to the left; applied last
    offset: offset of the pupil from the origin of the object's frame [m], (ahead, left, up). The angles do not rotate
        the offset.
    kind: "site", "camera" or "body", to distinguish objects of different kinds with the same name; None: the first of
        these kinds with an object of this name

    Raises:
        ValueError: `on` is not a nonempty string, an angle is not finite, `offset` is not three finite numbers, or the
            kind is unknown.
    """

    on: str
    azimuth_deg: float = 0.0
    elevation_deg: float = 0.0
    roll_deg: float = 0.0
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    kind: str | None = None

    def __post_init__(self) -> None:
        if not of_kind("Mount: on", self.on, str, "'head'"):
            raise ValueError(f"Mount: on = {self.on!r}: must be the name of a site, a camera or a body, such as 'head'")
        for name in ("azimuth_deg", "elevation_deg", "roll_deg"):
            object.__setattr__(self, name, finite(f"Mount: {name}", getattr(self, name)))
        offset = reals("Mount: offset", self.offset)
        if offset.shape != (3,) or not np.isfinite(offset).all():
            raise ValueError(f"Mount: offset = {shown(self.offset)}: must be three lengths (ahead, left, up) [m]")
        object.__setattr__(self, "offset", tuple(map(float, offset)))
        if self.kind is not None and not (isinstance(self.kind, str) and self.kind in KINDS):
            raise ValueError(f"Mount: kind = {shown(self.kind)}: must be one of {', '.join(map(repr, KINDS))}, or None")

    def mirrored(self) -> Mount:
        """Return the mirror image of the mount on the other side of the body, with left and right exchanged."""
        ahead, left, up = self.offset
        return replace(self, azimuth_deg=-self.azimuth_deg, roll_deg=-self.roll_deg, offset=(ahead, -left, up))

    def found_in(self, model: mujoco.MjModel) -> tuple[str, int]:
        """Return the kind and id of the object that carries the eye.

        Raises:
            ValueError: the model has no such object, or is not an MjModel.
        """
        of_kind("model", model, mujoco.MjModel, "mujoco.MjModel.from_xml_path('robot.xml')")
        for kind in KINDS if self.kind is None else (self.kind,):
            index = mujoco.mj_name2id(model, getattr(mujoco.mjtObj, f"mjOBJ_{kind.upper()}"), self.on)
            if index >= 0:
                return kind, index
        names = _names(model, KINDS if self.kind is None else (self.kind,))
        what = " or ".join(KINDS) if self.kind is None else self.kind
        raise ValueError(f"Mount: no {what} {self.on!r} in the model{did_you_mean(self.on, names)}")

    def local(self, kind: str) -> tuple[np.ndarray, np.ndarray]:
        """Return the position of the pupil [m], (3,), and the eye's frame, (3, 3).

        Both are given in the frame of the object that carries the eye. The columns of the eye's frame are (right, up,
        ahead).

        kind: kind of the object, "site", "camera" or "body"

        Raises:
            ValueError: the kind is unknown.
        """
        ahead, left, up = _AXES[one_of("kind", kind, KINDS)]
        azimuth, elevation, roll = np.radians([self.azimuth_deg, self.elevation_deg, self.roll_deg])
        level = np.cos(azimuth) * ahead + np.sin(azimuth) * left
        beside = -np.sin(azimuth) * ahead + np.cos(azimuth) * left
        axis = np.cos(elevation) * level + np.sin(elevation) * up
        top = -np.sin(elevation) * level + np.cos(elevation) * up
        upwards = np.cos(roll) * top + np.sin(roll) * beside
        rightwards = np.sin(roll) * top - np.cos(roll) * beside
        return np.asarray(self.offset) @ _AXES[kind], np.column_stack([rightwards, upwards, axis])


def mounts_of(where: str, said: Any) -> tuple[Mount, ...]:
    """Return mounts as a tuple, after checking that they are a sequence of mounts.

    where: name of the mounts in error messages
    said: the mounts

    Raises:
        ValueError: `said` is a single mount, or not a sequence of mounts.
    """
    if not isinstance(said, Sequence) or not all(isinstance(mount, Mount) for mount in said):
        raise ValueError(f"{where} = {shown(said)}: must be several of sim.Mount, such as (sim.Mount('head'),)")
    return tuple(said)


def both_sides(mounts: Iterable[Mount]) -> tuple[Mount, ...]:
    """Return each mount followed by its mirror image on the other side of the body.

    mounts: several mounts, or none

    Raises:
        ValueError: `mounts` is a single mount, or contains anything other than mounts.
    """
    return tuple(one for mount in items("mounts", mounts, Mount, EXAMPLE) for one in (mount, mount.mirrored()))


def ring(on: str, n_eyes: int, placement_range_deg: float, radius: float) -> tuple[Mount, ...]:
    """Return mounts in a circle around the upward axis of an object, from left to right. The eyes look outwards.

    The upward axis of a body or site is its z axis. A single eye looks ahead. The eyes of the built-in agent
    (`sim.Eyes`) are arranged in the same way.

    on: name of a body, site or camera
    n_eyes: number of eyes, 1 to 10,000
    placement_range_deg: angle from the first to the last eye [degrees]. With 360 (n - 1) / n degrees, n eyes are evenly
        spaced around the whole circle.
    radius: radius of the circle [m], 0 to 10¹⁵

    Raises:
        ValueError: an argument is invalid.
    """
    return fan(Mount(on, offset=(in_range("radius", radius, 0, LARGEST), 0.0, 0.0)), n_eyes, placement_range_deg)


def fan(mount: Mount, n_eyes: int, placement_range_deg: float, elevation_deg: float = 0.0) -> tuple[Mount, ...]:
    """Return mounts from left to right, evenly spaced over a range of azimuths.

    The azimuth of `mount` is the middle of the range. The offset of each mount is that of `mount`, rotated by the
    difference between their azimuths about the upward axis of the object that carries the eyes. A single eye keeps the
    azimuth of `mount`.

    n_eyes: number of eyes, 1 to 10,000
    placement_range_deg: angle from the first to the last eye [degrees]
    elevation_deg: angle that is added to the elevation of `mount` [degrees]

    Raises:
        ValueError: an argument is invalid.
    """
    of_kind("mount", mount, Mount, EXAMPLE)
    n_eyes = whole("n_eyes", n_eyes, 1, MOST_EYES)
    half, elevation_deg = finite("placement_range_deg", placement_range_deg) / 2, finite("elevation_deg", elevation_deg)
    azimuths = np.linspace(half, -half, n_eyes) if n_eyes > 1 else np.zeros(1)
    return tuple(_turned(mount, float(azimuth), elevation_deg) for azimuth in azimuths)


def _turned(mount: Mount, azimuth_deg: float, elevation_deg: float) -> Mount:
    (ahead, left, up), (c, s) = mount.offset, (f(np.radians(azimuth_deg)) for f in (np.cos, np.sin))
    return replace(
        mount,
        azimuth_deg=mount.azimuth_deg + azimuth_deg,
        elevation_deg=mount.elevation_deg + elevation_deg,
        offset=(ahead * c - left * s, ahead * s + left * c, up),
    )


def _names(model: mujoco.MjModel, kinds: Iterable[str]) -> list[str]:
    counts = {"site": model.nsite, "camera": model.ncam, "body": model.nbody}
    return [name for kind in kinds for i in range(counts[kind]) if (name := getattr(model, kind)(i).name)]
