"""Measured spectra that replace colours: reflectances of materials and emission of lights, by their names in the model.

A material's spectrum replaces its rgba. A texture, which must be grey, still multiplies it. A light's spectrum replaces
daylight and the light's colour. The strength of the light is still the largest component of its diffuse colour. The
glow of an emissive material has the spectrum that the material reflects in daylight.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np

from optics.numerics.arguments import did_you_mean, of_kind
from optics.spectra.spectrum import LIMITS_NM, Spectrum, daylight, illuminant, reflectance
from sim.scene.variant import Description

HEADLIGHT = "headlight"
Spectra = Mapping[str, Spectrum]


def resolve(model: mujoco.MjModel, spectra: Mapping[str, Spectrum | str] | None) -> Spectra:
    """Return the spectra by the names of materials and lights.

    A value that is the name of a tabulated spectrum (`optics.REFLECTANCES`, `optics.ILLUMINANTS`) is replaced by this
    spectrum.

    Raises:
        ValueError: a name is neither a material nor a light of the model, or is both; a value is not a spectrum; or a
            reflectance is above 1.
    """
    if spectra is not None:
        of_kind("spectra", spectra, Mapping, "{'wall': 'foliage'}")
    materials = [model.material(i).name for i in range(model.nmat)]
    lights = [*(model.light(i).name for i in range(model.nlight)), HEADLIGHT]
    return {name: _resolved(name, value, materials, lights) for name, value in (spectra or {}).items()}


def _resolved(name: str, value: Any, materials: list[str], lights: list[str]) -> Spectrum:
    known = [known for known in (*materials, *lights) if known]
    if name not in known:
        hint = did_you_mean(name, known) or f"; it has {', '.join(map(repr, known))}"
        raise ValueError(f"spectra: the model has no material or light {name!r}{hint}")
    if name in materials and name in lights:
        raise ValueError(f"spectra: {name!r} is a material and a light: rename one of them")
    if isinstance(value, str):
        value = (reflectance if name in materials else illuminant)(value)
    if not isinstance(value, Spectrum):
        raise ValueError(f"spectra: {name!r} has {value!r}: must be an optics.Spectrum or the name of one")
    if name in materials and max(value.values) > 1:
        raise ValueError(f"spectra: material {name!r} reflects {max(value.values):g}: must lie in [0, 1]")
    return value


def of_geom(model: mujoco.MjModel, geom: int, spectra: Spectra) -> Spectrum | None:
    """Return the reflectance of a geom's material; None if it has no material, or one that is not in `spectra`."""
    material = int(model.geom_matid[geom])
    return spectra.get(model.material(material).name) if material >= 0 else None


def in_daylight(reflectance: Spectrum) -> Spectrum:
    """Return the spectrum that a surface with this reflectance reflects in daylight (D65, scaled to 1 at 560 nm).

    It is tabulated every 5 nm from 300 to 780 nm, and at the wavelengths of the reflectance's table in this range.
    """
    entries = {*np.arange(LIMITS_NM[0], LIMITS_NM[1] + 1, 5.0), *reflectance.wavelengths_nm}
    nm = np.array([x for x in sorted(entries) if LIMITS_NM[0] <= x <= LIMITS_NM[1]])
    return Spectrum(tuple(nm), tuple(reflectance.at(nm * 1e-9) * daylight(nm * 1e-9)))


def described(spectrum: Spectrum, scale: float = 1.0) -> Description:
    """Return Mitsuba's description of scale · spectrum on 300-780 nm.

    Mitsuba's `rgb` and `d65` are not used, because they are dark in the ultraviolet.
    """
    inside = [nm for nm in spectrum.wavelengths_nm if LIMITS_NM[0] < nm < LIMITS_NM[1]]
    nm = np.array([LIMITS_NM[0], *inside, LIMITS_NM[1]])
    return {
        "type": "irregular",
        "wavelengths": ",".join(f"{x:.9g}" for x in nm),
        "values": ",".join(f"{scale * v:.9g}" for v in spectrum.at(nm * 1e-9)),
    }
