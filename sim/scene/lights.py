"""MuJoCo's lights as Mitsuba emitters with the spectrum of daylight, or with measured spectra.

Units: a light of diffuse 1 gives the irradiance π · daylight(λ) on a surface that faces it. A white Lambertian surface
there has the radiance daylight(λ), which is the spectrum D65, scaled to 1 at 560 nm. Mitsuba's own `d65` is scaled
differently (1.0101 at 560 nm), and its `rgb` emitters inherit this scale. This module therefore uses the tables of
`optics`.

A light has a single colour: its diffuse colour also makes the highlights, and its specular colour is ignored. Light
from a point decreases with the square of the distance. If a light of the model has another attenuation, its irradiance
is the same as in MuJoCo only at the initial distance between the light and the model's centre.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import mujoco
import numpy as np

from optics.numerics.autodiff import Array
from optics.spectra.spectrum import Spectrum, daylight
from sim.scene import sky, surfaces
from sim.scene.color import decode_srgb
from sim.scene.shadowless import INNER, shadowless
from sim.scene.spectra import HEADLIGHT, Spectra, described, in_daylight
from sim.scene.variant import Description, MitsubaObject

WAVELENGTHS_NM = np.arange(300.0, 781.0, 5.0)
_TYPES = mujoco.mjtLightType
_PROFILE = 513  # pixels across the image of a spot's cone
_WIDEST_DEG = 88.0  # widest cone over which an image can be projected
# Fields that only MuJoCo's other renderer reads, with the values that mean unset.
_UNMIRRORED = {"intensity": 0.0, "bulbradius": 0.02, "range": 10.0, "softness": 0.2}


@dataclass(frozen=True)
class Emitter:
    """A light of a scene. If it is one of the model's lights, its position and direction follow mjData.

    name: name in Mitsuba's scene
    light: id in the model; -1: not one of the model's lights (the camera's headlight, the sky)
    description: Mitsuba's description of the light as if it cast shadows, whatever `casts_shadow` is
    casts_shadow: the model's setting; False for the headlight, as in MuJoCo
    """

    name: str
    light: int
    description: Description
    casts_shadow: bool = True

    @property
    def described(self) -> Description:
        """Mitsuba's description of the light, for Mitsuba's active variant; without shadows if the light casts none."""
        return self.description if self.casts_shadow else shadowless(self.description)

    @property
    def parameters(self) -> str:
        """Name under which the parameters of a Mitsuba scene (`mi.traverse`) list the light."""
        return self.name if self.casts_shadow else f"{self.name}.{INNER}"


def emission(rgb: np.ndarray, scale: float, measured: Spectrum | None = None) -> Description:
    """Return the spectrum of a light, scale · max(rgb) · daylight(λ) on 300-780 nm, as a Mitsuba texture.

    If `rgb` (3,) is not grey, the spectrum is also multiplied by the reflectance spectrum of its hue (Jakob and Hanika
    2019). `measured` replaces daylight and hue.
    """
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


def glow(model: mujoco.MjModel, geom: int, to_uv: np.ndarray | None, measured: Spectrum | None) -> Description | None:
    """Return the radiance of a geom with an emissive material; None if the geom does not glow.

    The radiance is the material's emission times the radiance that the geom would have in full daylight.

    to_uv, measured: see `sim.scene.bsdfs.bsdf`
    """
    material = model.geom_matid[geom]
    if material < 0 or model.mat_emission[material] <= 0:
        return None
    level = float(model.mat_emission[material])
    if measured is not None:
        return emission(np.ones(3), level, in_daylight(measured))
    texture = surfaces.texture_id(model, geom)
    if texture >= 0 and surfaces.is_mirrored(model, geom, texture):
        return {"type": "d65", "nested": surfaces.reflectance_texture(model, geom, to_uv), "scale": level * white()}
    return emission(decode_srgb(surfaces.rgba(model, geom)[:3]), level)


def white() -> float:
    """Return the factor by which the radiance of Mitsuba's `d65` is multiplied to give that of a white surface.

    The surface faces a MuJoCo light whose `diffuse` is 1.
    """
    return float(daylight(np.array([560e-9]))[0]) / float(_evaluate(mi.load_dict({"type": "d65"}), 560.0)[0])


def _hue(rgb: np.ndarray) -> np.ndarray:
    texture = mi.load_dict({"type": "rgb", "value": [float(c) for c in rgb]})
    if str(mi.variant()).startswith("scalar"):
        return np.array([_evaluate(texture, float(nm))[0] for nm in WAVELENGTHS_NM])
    return _evaluate(texture, mi.Float(WAVELENGTHS_NM.astype(np.float32)))


def _evaluate(texture: MitsubaObject, nm: Array) -> np.ndarray:
    si: Array = dr.zeros(mi.SurfaceInteraction3f, dr.width(nm))
    si.wavelengths = mi.Spectrum(nm)
    return np.atleast_1d(np.array(texture.eval(si)[0]))


def emitters(model: mujoco.MjModel, data: mujoco.MjData, spectra: Spectra) -> tuple[list[Emitter], list[str]]:
    """Return emitters for active lights, the headlight and the sky, and messages about features they do not show."""
    found, left_out = [], []
    for light in range(model.nlight):
        if not model.light_active[light]:
            continue
        left_out += _left_out(model, light)
        if model.light_type[light] != _TYPES.mjLIGHT_IMAGE and np.any(model.light_diffuse[light] > 0):
            shadow = bool(model.light_castshadow[light])
            found.append(Emitter(f"light_{light}", light, _describe(model, data, light, spectra), shadow))
    headlight = model.vis.headlight
    if headlight.active:
        if np.any(headlight.ambient > 0):
            left_out.append("ambient part of the headlight")
        if np.any(headlight.diffuse > 0):
            spectrum = emission(headlight.diffuse, math.pi, spectra.get(HEADLIGHT))
            lamp = {"type": "directional", "irradiance": spectrum}
            found.append(Emitter(HEADLIGHT, -1, lamp, casts_shadow=False))
    heaven = sky.description(model, white())
    if heaven is not None:
        found.append(Emitter("sky", -1, heaven))
    return found, left_out


def pose(data: mujoco.MjData, light: int) -> MitsubaObject:
    """Return Mitsuba's `to_world` of a light: the origin is the light's position, and +z points along its direction."""
    origin, direction = data.light_xpos[light], data.light_xdir[light]
    return aimed(origin, direction)


def aimed(origin: np.ndarray, direction: np.ndarray) -> MitsubaObject:
    """Return a `to_world` for Mitsuba with +z along `direction`; the rotation about this axis is arbitrary.

    origin: position of the light [m], (3,)
    direction: direction in which the light shines, of any length, (3,)
    """
    z = direction / np.linalg.norm(direction)
    x = np.cross([1.0, 0, 0] if abs(z[0]) < 0.9 else [0, 1.0, 0], z)
    x /= np.linalg.norm(x)
    matrix = np.eye(4)
    matrix[:3] = np.column_stack([x, np.cross(z, x), z, origin])
    return mi.ScalarTransform4f(matrix.tolist())


def _left_out(model: mujoco.MjModel, light: int) -> list[str]:
    name, words = model.light(light).name or f"light {light}", []
    if model.light_type[light] == _TYPES.mjLIGHT_IMAGE:
        return [f"image-based {name!r}"]
    if np.any(model.light_ambient[light] > 0):
        words.append(f"ambient part of {name!r}")
    if not np.any(model.light_diffuse[light] > 0) and np.any(model.light_specular[light] > 0):
        words.append(f"{name!r}, which makes highlights only")
    if model.light_type[light] != _TYPES.mjLIGHT_DIRECTIONAL and np.any(model.light_attenuation[light, :2] > 0):
        words.append(f"attenuation of {name!r} (mirrored with 1/r², equal at the model's center)")
    for field, unset in _UNMIRRORED.items():
        value = float(np.ravel(getattr(model, f"light_{field}")[light])[0])
        if not math.isclose(value, unset, rel_tol=1e-6, abs_tol=1e-9):
            words.append(f"{field} = {value:g} of {name!r}")
    return words


def _describe(model: mujoco.MjModel, data: mujoco.MjData, light: int, spectra: Spectra) -> Description:
    diffuse, kind = model.light_diffuse[light], model.light_type[light]
    measured = spectra.get(model.light(light).name)
    if kind == _TYPES.mjLIGHT_DIRECTIONAL:
        spectrum = emission(diffuse, math.pi, measured)
        return {"type": "directional", "irradiance": spectrum, "to_world": pose(data, light)}
    distance = max(float(np.linalg.norm(data.light_xpos[light] - model.stat.center)), 1e-3)
    constant, linear, square = model.light_attenuation[light]
    falloff = max(float(constant + linear * distance + square * distance**2), 1e-9)
    spectrum = emission(diffuse, math.pi * distance**2 / falloff, measured)
    cutoff, exponent = float(model.light_cutoff[light]), float(model.light_exponent[light])
    if kind == _TYPES.mjLIGHT_POINT or (cutoff >= 90 and exponent == 0):
        return {"type": "point", "intensity": spectrum, "to_world": pose(data, light)}
    # Mitsuba's beam has to be narrower than its cone.
    cutoff = min(cutoff, _WIDEST_DEG)
    spot = {"type": "spot", "intensity": spectrum, "to_world": pose(data, light), "cutoff_angle": cutoff}
    return spot | {"beam_width": 0.999 * cutoff, "texture": _profile(cutoff, exponent)}


def _profile(cutoff_deg: float, exponent: float) -> Description:
    """Return the image that a spotlight projects: it has the value cos(θ)**exponent at the angle θ to the cone's axis.

    cutoff_deg: angle between the cone's axis and its side [degrees]
    """
    tangent = np.tan(np.radians(cutoff_deg)) * (2 * (np.arange(_PROFILE) + 0.5) / _PROFILE - 1)
    cosine = 1 / np.sqrt(1 + tangent[:, None] ** 2 + tangent[None, :] ** 2)
    bitmap = mi.Bitmap(np.ascontiguousarray(cosine**exponent, dtype=np.float32)[..., None])
    return {"type": "bitmap", "bitmap": bitmap, "raw": True, "wrap_mode": "clamp"}
