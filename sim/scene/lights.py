"""MuJoCo's lights as Mitsuba emitters with the spectrum of daylight.

Units: a light of diffuse 1 lays the irradiance π · daylight(λ) on a surface that faces it, so that a white Lambertian
there has radiance daylight(λ): D65, 1 at 560 nm. Mitsuba's own `d65` is scaled otherwise (1.0101 at 560 nm), and
its `rgb` emitters inherit that; the tables here are optics' own.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import mujoco
import numpy as np

from optics.tabulated import Spectrum, daylight
from sim.scene.spectra import HEADLIGHT, Spectra, described

WAVELENGTHS_NM = np.arange(300.0, 781.0, 5.0)
_TYPES = mujoco.mjtLightType


@dataclass(frozen=True)
class Emitter:
    """A light as Mitsuba describes it; `position` and `direction` are where data puts it."""

    name: str
    light: int  # id in the model; -1: the camera's headlight
    description: dict[str, Any]


def emission(rgb: np.ndarray, scale: float, measured: Spectrum | None = None) -> dict[str, Any]:
    """Spectrum scale · rgb · daylight(λ) on 300-780 nm; a grey rgb is exactly that, a coloured one goes by the
    reflectance spectrum of its hue (Jakob and Hanika 2019). `measured` takes the place of daylight and hue."""
    level = float(np.max(rgb))
    if measured is not None:
        return described(measured, scale * level)
    values = scale * level * daylight(WAVELENGTHS_NM * 1e-9)
    if level > 0 and np.ptp(rgb) > 0:
        values = values * _hue(rgb / level)
    return {
        "type": "regular",
        "wavelength_min": float(WAVELENGTHS_NM[0]),
        "wavelength_max": float(WAVELENGTHS_NM[-1]),
        "values": ",".join(f"{v:.9g}" for v in values),
    }


def _hue(rgb: np.ndarray) -> np.ndarray:
    texture = mi.load_dict({"type": "rgb", "value": [float(c) for c in rgb]})
    if str(mi.variant()).startswith("scalar"):
        return np.array([_evaluate(texture, float(nm))[0] for nm in WAVELENGTHS_NM])
    return _evaluate(texture, mi.Float(WAVELENGTHS_NM.astype(np.float32)))


def _evaluate(texture: Any, nm: Any) -> np.ndarray:
    si: Any = dr.zeros(mi.SurfaceInteraction3f, dr.width(nm))
    si.wavelengths = mi.Spectrum(nm)
    return np.atleast_1d(np.array(texture.eval(si)[0]))


def emitters(model: mujoco.MjModel, data: mujoco.MjData, spectra: Spectra) -> tuple[list[Emitter], list[str]]:
    """All active lights, and what of them could not be mirrored, in words."""
    found, left_out = [], []
    for light in range(model.nlight):
        if not model.light_active[light]:
            continue
        name = model.light(light).name or f"light {light}"
        if np.any(model.light_ambient[light] > 0):
            left_out.append(f"ambient part of {name!r}")
        if model.light_type[light] == _TYPES.mjLIGHT_IMAGE:
            left_out.append(f"image-based {name!r}")
        elif np.any(model.light_diffuse[light] > 0):
            if model.light_type[light] != _TYPES.mjLIGHT_DIRECTIONAL:
                left_out.append(f"absent attenuation of {name!r} (mirrored with 1/r², equal at the model's center)")
            found.append(Emitter(f"light_{light}", light, _describe(model, data, light, spectra)))
    headlight = model.vis.headlight
    if headlight.active:
        if np.any(headlight.ambient > 0):
            left_out.append("ambient part of the headlight")
        if np.any(headlight.diffuse > 0):
            spectrum = emission(headlight.diffuse, math.pi, spectra.get(HEADLIGHT))
            found.append(Emitter(HEADLIGHT, -1, {"type": "directional", "irradiance": spectrum}))
    return found, left_out


def pose(data: mujoco.MjData, light: int) -> Any:
    """Mitsuba's to_world of a light: at its position, +z along its direction."""
    origin, direction = data.light_xpos[light], data.light_xdir[light]
    return aimed(origin, direction)


def aimed(origin: np.ndarray, direction: np.ndarray) -> Any:
    """to_world with +z along `direction`; the turn about it does not matter to a light."""
    z = direction / np.linalg.norm(direction)
    x = np.cross([1.0, 0, 0] if abs(z[0]) < 0.9 else [0, 1.0, 0], z)
    x /= np.linalg.norm(x)
    matrix = np.eye(4)
    matrix[:3] = np.column_stack([x, np.cross(z, x), z, origin])
    return mi.ScalarTransform4f(matrix.tolist())


def _describe(model: mujoco.MjModel, data: mujoco.MjData, light: int, spectra: Spectra) -> dict[str, Any]:
    diffuse, kind = model.light_diffuse[light], model.light_type[light]
    measured = spectra.get(model.light(light).name)
    if kind == _TYPES.mjLIGHT_DIRECTIONAL:
        spectrum = emission(diffuse, math.pi, measured)
        return {"type": "directional", "irradiance": spectrum, "to_world": pose(data, light)}
    distance = max(float(np.linalg.norm(data.light_xpos[light] - model.stat.center)), 1e-3)
    spectrum = emission(diffuse, math.pi * distance**2, measured)
    if kind == _TYPES.mjLIGHT_POINT or model.light_cutoff[light] >= 90:
        return {"type": "point", "intensity": spectrum, "to_world": pose(data, light)}
    cutoff = float(model.light_cutoff[light])
    return {
        "type": "spot",
        "intensity": spectrum,
        "to_world": pose(data, light),
        "cutoff_angle": cutoff,
        "beam_width": 0.95 * cutoff,
    }
