"""Lights of any model, which may move: directional lights, points, spots, and the headlight of each eye.

The spectrum and strength of each light are read from its emitter in Mitsuba (`sim.scene.lights`), so that the renderer
agrees with the Mitsuba scenes of `sim.mirror`, which contain these emitters.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import mujoco
import numpy as np

from optics.numerics.autodiff import Array
from sim.scene import lights
from sim.scene.poses import Poses
from sim.scene.spectra import Spectra
from sim.scene.variant import Description
from sim.tracing import lighting
from sim.tracing.world_rows import WorldRows

ROWS = 2  # rows of four floats for each light: its position and its direction
FAR = 1e6  # distance to the source of a directional light [m]
_DIRECTIONAL, _POINT, _SPOT = "directional", "point", "spot"


@dataclass(frozen=True)
class ModelLight:
    """One light of a model.

    light: id in the model; -1: the headlight of the observing eye
    kind: "directional", "point" or "spot"
    level: irradiance of a surface that faces the light, (band,); for "point" and "spot", at a distance of 1 m
    cutoff, exponent: for a spot, the cosine of its half angle, and the exponent of its falloff to the side
    direction: unit vector (3,) towards a directional light in the model's reference pose; None for other lights
    casts_shadow: True if obstacles block the light
    """

    light: int
    kind: str
    level: np.ndarray
    cutoff: float = -1.0
    exponent: float = 0.0
    direction: np.ndarray | None = None
    casts_shadow: bool = True


def model_lights(
    model: mujoco.MjModel, spectra: Spectra, wavelengths: np.ndarray
) -> tuple[list[ModelLight], list[str]]:
    """Return a model's lights, except for the sky, at wavelengths [m], and messages about properties left out.

    The messages describe properties of lights that have no counterpart in Mitsuba. The scene's Mitsuba variant must be
    active.
    """
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    emitters, left_out = lights.emitters(model, data, spectra)
    found = []
    for emitter in emitters:
        kind = emitter.description["type"]
        if kind not in (_DIRECTIONAL, _POINT, _SPOT):
            continue
        level, towards = _sampled({k: v for k, v in emitter.description.items() if k != "texture"}, wavelengths)
        cutoff, exponent = -1.0, 0.0
        if kind == _SPOT:
            cutoff = math.cos(math.radians(emitter.description["cutoff_angle"]))
            exponent = float(model.light_exponent[emitter.light])
        found.append(ModelLight(emitter.light, kind, level, cutoff, exponent, towards, emitter.casts_shadow))
    return found, left_out


def _sampled(description: Description, wavelengths: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
    """Return the strength of a light at these wavelengths [m] and, if it is directional, the direction towards it.

    The strength is the irradiance of a directional light or the intensity of another light, (band,). The direction is a
    unit vector (3,), or None for a light that is not directional.
    """
    emitter, found = mi.load_dict(description), []
    directional, towards = description["type"] == _DIRECTIONAL, None
    for spectrum in lighting.spectra(wavelengths):
        si = dr.zeros(mi.SurfaceInteraction3f)
        si.wavelengths = spectrum
        if not directional:
            si.p = mi.Point3f(description["to_world"] @ mi.ScalarPoint3f(0, 0, 1))
        sample, weight = emitter.sample_direction(si, mi.Point2f(0.5))
        found.append(np.array(weight).ravel())
        towards = np.array(sample.d, np.float64).ravel() if directional else None
    return np.concatenate(found)[: len(wavelengths)], towards


class Lights:
    """All lights of a model. The renderer's kernel evaluates each of them once per ray."""

    def __init__(self, found: list[ModelLight]) -> None:
        self.found = found

    def __len__(self) -> int:
        return len(self.found)

    def rows(self, poses: Poses) -> np.ndarray:
        """Return positions and directions of lights, (world, light, 8) float32; those of headlights are unused."""
        rows = np.zeros((poses.n, len(self), ROWS, 4), np.float32)
        for k, light in enumerate(self.found):
            if light.light >= 0:
                aim = poses.light_xdir[:, light.light]
                rows[:, k, 0, :3] = poses.light_xpos[:, light.light]
                rows[:, k, 1, :3] = aim / np.linalg.norm(aim, axis=-1, keepdims=True)
        return rows.reshape(poses.n, len(self), -1)

    def towards(self, k: int, point: Array, axis: Array, there: WorldRows) -> tuple[Array, Array, Array]:
        """Return the unit vector from a point to a light, the distance [m], and the light's relative strength.

        The relative strength, times the light's `level`, is the irradiance of a surface that is at the point and faces
        the light. The distance to a directional light or a headlight is a large constant.

        k: index of the light
        axis: axis of the observing eye
        there: positions and directions of all lights in the world that contains the point, see `rows`
        """
        light = self.found[k]
        if light.light < 0:
            return -axis, mi.Float(FAR), mi.Float(1)
        place, aim = (there.point(k * ROWS + i) for i in range(ROWS))
        if light.kind == _DIRECTIONAL:
            return -aim, mi.Float(FAR), mi.Float(1)
        way = place - mi.Vector3f(point)
        square = dr.maximum(dr.squared_norm(way), 1e-12)
        distance = dr.sqrt(square)
        towards, share = way / distance, dr.rcp(square)
        if light.kind == _SPOT:
            cosine = -dr.dot(towards, aim)
            profile: Array = dr.power(dr.maximum(cosine, 1e-6), light.exponent)
            share = dr.select(cosine > light.cutoff, share * profile, 0)
        return towards, distance, share
