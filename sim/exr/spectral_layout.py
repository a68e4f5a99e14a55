"""Channels of the spectral layout for OpenEXR files.

Source: Fichet, Pacanowski and Wilkie (2021), "An OpenEXR Layout for Spectral Images", JCGT 10(3), section 3.

A channel's name consists of its quantity and its wavelength or frequency, with a comma as decimal sign:

S0.450,000000nm   radiance, the first Stokes component; S1 to S3 are the other components
T.450,000000nm    reflectance or transmittance; files of early versions write M00, a component of a Mueller matrix
T.400,0nm.500,0nm   reradiation of a fluorescent surface, from the first wavelength to the second
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from optics.numerics.arguments import reals, shown
from optics.spectra.spectrum import SHORTEST_NM

PREVIEW = ("R", "G", "B")
RADIANCE, REFLECTANCE = "S0", "T"
LIGHT_SPEED = 299_792_458.0  # [m/s]
_PREFIXES = {"": 1, "da": 1e1, "h": 1e2, "k": 1e3, "M": 1e6, "G": 1e9, "T": 1e12, "P": 1e15, "E": 1e18, "Z": 1e21}
_PREFIXES |= {"Y": 1e24, "d": 1e-1, "c": 1e-2, "m": 1e-3, "u": 1e-6, "n": 1e-9, "p": 1e-12}
_VALUE = r"(\d+[.,]?\d*(?:[Ee][+-]?\d+)?|[.,]\d+(?:[Ee][+-]?\d+)?)(Y|Z|E|P|T|G|M|k|h|da|d|c|m|u|n|p)?(m|Hz)"
_CHANNEL = re.compile(rf"(S[0-3]|M[0-3][0-3]|T)\.{_VALUE}(\.{_VALUE})?")
_QUANTITIES = {"S0": "radiance", "T": "reflectance", "M00": "reflectance"}
# Entries of a header that describe how pixels are stored.
_OF_STORAGE = ("pixelAspectRatio", "screenWindowWidth", "chunkCount", "name", "version", "maxSamplesPerPixel")


class ExrWarning(UserWarning):
    """Warning about contents of an OpenEXR file that are not read; its message names these contents."""


def channel(nm: float, quantity: str = RADIANCE) -> str:
    """Return the name of the channel of a quantity at a wavelength [nm]."""
    return f"{quantity}.{f'{nm:.6f}'.replace('.', ',')}nm"


def require_nanometres(name: str, values: Any) -> np.ndarray:
    """Return wavelengths [nm], (band,), after checking that they are not in metres.

    Raises:
        ValueError: the wavelengths are not a one-dimensional array of finite numbers of at least SHORTEST_NM.
    """
    nm = reals(name, values)
    if nm.ndim != 1 or not np.isfinite(nm).all() or (nm < SHORTEST_NM).any():
        raise ValueError(f"{name} = {shown(values)}: must be finite numbers in nanometres (550, not 550e-9), (band,)")
    return nm


class NoSpectra(ValueError):
    """A file without spectral channels."""


def fields_of_views(parts: Sequence[Any], stem: str) -> list[dict[str, Any]]:
    """Return the fields of `View` for each part (`OpenEXR.Part`) with spectral channels.

    stem: name that the view gets if its part has no name

    An ExrWarning names contents that are not read: polarisation, fluorescence, and parts without spectral channels.

    Raises:
        NoSpectra: no part has spectral channels.
        ValueError: see `_fields_of_view`.
    """
    views, others = [], []
    for part in parts:
        channels, where = {key: plane.pixels for key, plane in part.channels.items()}, f"part {part.name()!r}"
        if found := _fields_of_view(channels, part.header, where):
            views.append({"name": part.name() or stem, **found})
        else:
            others.append(where)
    if not views:
        raise NoSpectra(f"{others[0]} was not written by rhabdom and has no spectral channels (S0.450,0nm, T.450,0nm)")
    if others:
        warnings.warn(f"not read: {', '.join(others)}, without spectral channels", ExrWarning, stacklevel=3)
    return views


def _fields_of_view(channels: Mapping[str, np.ndarray], header: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Return arguments for the constructor of `View`, by name, from one part (sub-image) of an OpenEXR file.

    The result is {} if no channel is spectral.

    Spectral channels of quantities other than radiance and reflectance are left out with an `ExrWarning`.

    channels: image in each channel, (y, x), by name of the channel

    Raises:
        ValueError: two channels of a quantity have the same wavelength, or radiance and reflectance have different
            wavelengths.
    """
    planes: dict[str, dict[float, np.ndarray]] = {}
    left_out = set[str]()
    for name, plane in channels.items():
        if (match := _CHANNEL.fullmatch(name)) is None:
            continue
        quantity = _QUANTITIES.get(match[1])
        if quantity is None or match[5]:
            left_out.add(f"reradiation {match[1]}" if match[5] else match[1])
            continue
        nm, found = _nanometres(*match.group(2, 3, 4)), planes.setdefault(quantity, {})
        if nm in found:
            raise ValueError(f"{where} has two channels of {quantity} at {nm:g} nm: must be one")
        found[nm] = plane
    if left_out:
        warnings.warn(f"not read: channels {', '.join(sorted(left_out))} of {where}", ExrWarning, stacklevel=4)
    if not planes:
        return {}
    first, *others = (sorted(found) for found in planes.values())
    if others and others[0] != first:
        raise ValueError(f"{where} has radiance and reflectance at different wavelengths: must be the same")
    images = {quantity: np.stack([_float32(found[nm]) for nm in first]) for quantity, found in planes.items()}
    return {"wavelengths_nm": np.array(first), "attributes": _attributes(header), **images, **_preview(channels)}


def _nanometres(value: str, prefix: str | None, unit: str) -> float:
    """Return the vacuum wavelength [nm] of a channel, whose name states a wavelength or a frequency.

    value: the number, with a comma or a point as decimal sign
    prefix: SI prefix of the unit; None or "": none
    unit: "m" for a wavelength, otherwise hertz
    """
    number = float(value.replace(",", "."))
    if unit == "m":
        # One division or multiplication, so that 450 nm is exactly 450.
        return number if prefix == "n" else round(number * _PREFIXES[prefix or ""] * 1e9, 9)
    return LIGHT_SPEED / (number * _PREFIXES[prefix or ""]) * 1e9


def _float32(plane: np.ndarray) -> np.ndarray:
    return np.asarray(plane, dtype=np.float32)


def _attributes(header: Mapping[str, Any]) -> dict[str, Any]:
    """Return the entries of an OpenEXR header that are text or numbers and do not describe how pixels are stored."""
    return {key: value for key, value in header.items() if key not in _OF_STORAGE and type(value) in (str, int, float)}


def _preview(channels: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return {"rgb": preview image (y, x, 3)} for a `View`, or {} if the channel R, G or B is missing."""
    if not all(name in channels for name in PREVIEW):
        return {}
    return {"rgb": np.stack([_float32(channels[name]) for name in PREVIEW], axis=-1)}
