"""Images of eyes as OpenEXR files in the spectral layout.

This layout is defined by Fichet, Pacanowski and Wilkie (2021), "An OpenEXR Layout for Spectral Images", JCGT 10(3).

A file has up to two parts for each eye. For an eye named "left", these are `left.spectral` (spectral radiance, channels
`S0.450,000000nm` ..., and reflectance, channels `T.450,000000nm` ...) and `left.receptors` (photoreceptor signals,
channels `receptor_0` ..., and viewing directions, `direction_ahead` ...). Each part also contains a linear sRGB preview
in the channels R, G and B, which plain viewers show. Readers that support only one part, such as colour-science, read
the first part. Spectral parts precede receptor parts. Pixels are 32-bit floats with ZIP compression.

A file is written completely or not at all. Each part stores a SHA-256 hash of its contents. `read_exr` also reads files
of other programs, without a hash, if they have the spectral layout.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from optics.numerics.arguments import items, positive, shown
from sim.exr.previews import preview_of_receptors, preview_of_spectra
from sim.exr.spectral_layout import (
    PREVIEW,
    RADIANCE,
    REFLECTANCE,
    NoSpectra,
    channel,
    fields_of_views,
    require_nanometres,
)
from sim.exr.view import View

LAYOUT_VERSION = "1.0"
SCALE = "relative: a white Lambertian facing unit daylight has radiance D65, 1 at 560 nm"
# Default limit on the unpacked size of a file's pixels [bytes]. Sixteen eyes of 128 x 128 receptors in 64 bands need a
# fifteenth of it.
MOST_BYTES = 2**30
LARGEST_HEADER = 2**24  # largest size of a file's contents apart from pixels [bytes]
_HELD = "rhabdom"  # name of the attribute that stores all values other than channels, as JSON
_HASH = "sha256"
DIRECTIONS = ("direction_ahead", "direction_left", "direction_up")  # channels of viewing directions


class ExrError(ValueError):
    """A file that is incomplete, damaged, too large, or without the spectral layout."""


def file_path(name: str, value: Any) -> Path:
    """Return the path of a file; ValueError unless `value` is text or a path, such as pathlib.Path."""
    try:
        return Path(value)
    except TypeError:
        raise ValueError(f"{name} = {shown(value)}: must be the path of a file, such as 'view.exr'") from None


def write_exr(path: str | os.PathLike[str], views: Sequence[View], pixel_aspect: float = 1.0) -> None:
    """Write views to an OpenEXR file, completely or not at all; an existing file is replaced.

    views: views with different names, one or more
    pixel_aspect: width of a pixel divided by its height; viewers display the file with this ratio

    Raises:
        ValueError: `path` is no path, pixel_aspect is not positive and finite, there are no views, `views` contains
            anything other than views, two views have the same name, or JSON cannot represent an attribute.
        OSError: the file cannot be written.
    """
    import OpenEXR

    target = file_path("path", path)
    views = items("views", views, View, "View('left', radiance=...)")
    names = [view.name for view in views]
    if not views or len(set(names)) != len(names):
        raise ValueError(f"write_exr: views = {names}: must be at least one, and no name twice")
    spectral = [_part(view, "spectral") for view in views if view.spectral is not None]
    receptors = [_part(view, "receptors") for view in views if view.receptors is not None]
    # OpenEXR requires the same display window in all parts, but images may differ in size, so the largest is used.
    shapes = [channels["R"].shape for _, channels, _ in spectral + receptors]
    corner = np.array([max(width for _, width in shapes) - 1, max(height for height, _ in shapes) - 1], np.int32)
    header = {
        "type": OpenEXR.scanlineimage,
        "compression": OpenEXR.ZIP_COMPRESSION,
        "displayWindow": (np.zeros(2, np.int32), corner),
        "pixelAspectRatio": positive("pixel_aspect", pixel_aspect, "1"),
    }
    parts = []
    for name, channels, attributes in spectral + receptors:
        attributes["parts"] = str(len(spectral) + len(receptors))
        attributes[_HASH] = _digest(name, channels, attributes)
        # OpenEXR silently writes wrong pixels if an array is not contiguous. _part makes all arrays contiguous.
        parts.append(OpenEXR.Part({**header, **attributes}, channels, name))
    encoded = io.BytesIO()  # OpenEXR cannot open files whose names are not UTF-8, so it writes to memory
    OpenEXR.File(parts).write(encoded)
    _write_whole(target, encoded.getbuffer())


def read_exr(path: str | os.PathLike[str], most_bytes: int = MOST_BYTES) -> list[View]:
    """Read the views from a file that `write_exr` or another program wrote.

    A file of another program needs channels of the spectral layout: radiance (`S0.450,0nm` ...) or reflectance
    (`T.450,0nm` ...). Its views have the names of their parts, or of the file if a part has none. An ExrWarning names
    contents that are not read, such as polarisation.

    most_bytes: largest allowed size of the unpacked pixels [bytes], which may be infinite; the header of a small file
        can state any size

    Raises:
        ExrError: the file cannot be read, is truncated, damaged, altered or too large, or has no spectral channels.
            ExrError is a subclass of ValueError.
        ValueError: `path` is no path, or most_bytes is not positive.
        FileNotFoundError: the file does not exist, or is a folder.
    """
    import OpenEXR

    positive("most_bytes", most_bytes, "bytes", infinite=True)
    if not file_path("path", path).is_file():
        raise FileNotFoundError(f"no such file: {path}")
    try:
        if (size := Path(path).stat().st_size) > most_bytes + LARGEST_HEADER:  # larger than without compression
            raise ExrError(f"has {size:,} bytes: must be at most most_bytes = {most_bytes:,}")
        content = Path(path).read_bytes()
        headers = OpenEXR.File(io.BytesIO(content), header_only=True).parts
        expected = len(headers)
        if (unpacked := sum(_pixel_bytes(part.header) for part in headers)) > most_bytes:
            raise ExrError(f"unpacks to {unpacked:,} bytes: must be at most most_bytes = {most_bytes:,}")
        parts = OpenEXR.File(io.BytesIO(content), separate_channels=True).parts
        is_own = any(key in part.header for part in parts for key in (_HASH, _HELD))
        held = [_checked(part, expected) for part in parts] if is_own else []
    except ExrError as error:
        raise ExrError(f"{path}: {error}") from None
    except Exception as error:  # OpenEXR passes on C++ exceptions of any type
        raise ExrError(f"{path}: no readable OpenEXR file ({str(error).splitlines()[0]})") from None
    if len(parts) != expected:
        raise ExrError(f"{path}: truncated ({len(parts)} of {expected} parts are whole)")
    try:
        return _views(held) if is_own else [View(**view) for view in fields_of_views(parts, Path(path).stem)]
    except NoSpectra as error:
        raise ExrError(f"{path}: {error}") from None
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        reason = " ".join(str(error).split())[:200]
        why = ", though its hash is right" if is_own else ""
        raise ExrError(f"{path}: holds no views{why} ({type(error).__name__}: {reason})") from None


def _pixel_bytes(header: Mapping[str, Any]) -> int:
    """Return the memory that the pixels of one part of an OpenEXR file need [bytes], computed from its header."""
    low, high = (np.asarray(corner, dtype=np.int64) for corner in header["dataWindow"])
    width, height = (int(side) for side in np.maximum(high - low + 1, 0))
    return width * height * len(header["channels"]) * 4


def _part(view: View, kind: str) -> tuple[str, dict[str, np.ndarray], dict[str, str]]:
    """Return the name, channels and attributes of a view's part of this kind, "spectral" or "receptors".

    Raises:
        ValueError: JSON cannot represent an attribute of the view.
    """
    held: dict[str, Any] = {"attributes": dict(view.attributes)}
    attributes: dict[str, str] = {}
    if kind == "spectral":
        planes, nm = _spectral_planes(view), np.asarray(view.wavelengths_nm, float)
        held["wavelengths_nm"] = nm.tolist()
        rgb = preview_of_spectra(view.radiance, view.reflectance, nm) if view.rgb is None else view.rgb
        attributes = {"spectralLayoutVersion": LAYOUT_VERSION}
        if view.radiance is not None:
            attributes["radianceScale"] = SCALE
    else:
        assert view.receptors is not None
        planes = {f"receptor_{c}": plane for c, plane in enumerate(view.receptors)}
        if view.directions is not None:
            planes |= dict(zip(DIRECTIONS, view.directions, strict=True))
        if view.peaks_nm is not None:
            held["peaks_nm"] = [float(nm) for nm in view.peaks_nm]
        rgb = preview_of_receptors(view.receptors, view.peaks_nm)
    try:
        attributes[_HELD] = json.dumps(held, sort_keys=True)
    except TypeError as error:
        raise ValueError(f"View {view.name!r}: attributes cannot be written as JSON ({error})") from None
    planes |= dict(zip(PREVIEW, np.moveaxis(rgb, -1, 0), strict=True))
    channels = {name: np.ascontiguousarray(plane, dtype=np.float32) for name, plane in planes.items()}
    return f"{view.name}.{kind}", channels, attributes


def _spectral_planes(view: View) -> dict[str, np.ndarray]:
    """Return the channels of a view's radiance and reflectance, (y, x), by name."""
    quantities = ((RADIANCE, view.radiance), (REFLECTANCE, view.reflectance))
    return {
        channel(nm, quantity): plane
        for quantity, image in quantities
        if image is not None
        for nm, plane in zip(view.wavelengths_nm, image, strict=True)
    }


def _digest(name: str, channels: Mapping[str, np.ndarray], attributes: Mapping[str, str]) -> str:
    digest = hashlib.sha256(name.encode())
    for key in sorted(attributes):
        digest.update(f"{key}={attributes[key]}\n".encode())
    for key in sorted(channels):
        digest.update(f"{key}:{channels[key].shape}\n".encode())
        digest.update(np.ascontiguousarray(channels[key], dtype=np.float32).tobytes())
    return digest.hexdigest()


# Older files have the attribute emissiveUnits, too, which contradicts their scale.
_OWN_ATTRIBUTES = ("spectralLayoutVersion", "emissiveUnits", "radianceScale", _HELD, "parts")


def _checked(part: Any, expected: int) -> tuple[str, dict[str, np.ndarray], dict[str, Any]]:
    """Return the name, channels and stored values of one part of an OpenEXR file, after checking its hash."""
    name, header = part.name(), part.header
    if _HASH not in header or _HELD not in header:
        raise ExrError(f"part {name!r} was not written by rhabdom")
    channels = {key: channel.pixels for key, channel in part.channels.items()}
    attributes = {key: header[key] for key in _OWN_ATTRIBUTES if key in header}
    if header[_HASH] != _digest(name, channels, attributes):
        raise ExrError(f"part {name!r} is damaged (its SHA-256 does not match)")
    if attributes.get("parts") != str(expected):
        raise ExrError(f"parts are missing ({expected} of {attributes.get('parts')})")
    return name, channels, json.loads(header[_HELD])


def _views(parts: list[tuple[str, dict[str, np.ndarray], dict[str, Any]]]) -> list[View]:
    fields: dict[str, dict[str, Any]] = {}
    for part_name, channels, held in parts:
        name, _, kind = part_name.rpartition(".")
        if kind not in ("spectral", "receptors") or not isinstance(held["attributes"], dict):
            raise ValueError(f"part {part_name!r}: must be spectral or receptors, with attributes")
        view = fields.setdefault(name, {"name": name, "attributes": held["attributes"]})
        if kind == "spectral":
            view["wavelengths_nm"] = nm = require_nanometres("wavelengths_nm", held["wavelengths_nm"])
            for field_name, quantity in (("radiance", RADIANCE), ("reflectance", REFLECTANCE)):
                if any(name.startswith(f"{quantity}.") for name in channels):
                    view[field_name] = np.stack([channels[channel(x, quantity)] for x in nm])
            view["rgb"] = np.stack([channels[c] for c in PREVIEW], axis=-1)
        else:
            count = sum(c.startswith("receptor_") for c in channels)
            view["receptors"] = np.stack([channels[f"receptor_{c}"] for c in range(count)])
            view["peaks_nm"] = held.get("peaks_nm")
            if DIRECTIONS[0] in channels:
                view["directions"] = np.stack([channels[name] for name in DIRECTIONS])
    return [View(**view) for view in fields.values()]


def _write_whole(path: Path, content: memoryview) -> None:
    """Write a temporary file in the same folder, flush it to the disk, and rename it to `path`."""
    # The module tempfile is not used, because only the owner may read the files that it creates.
    temporary = str(path.with_name(f".{path.name}.{os.getpid()}.tmp"))
    try:
        Path(temporary).unlink(missing_ok=True)  # an existing entry might be a link to another file
        with os.fdopen(os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666), "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise
