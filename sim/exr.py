"""Images of eyes as OpenEXR files in the spectral layout of Fichet, Pacanowski and Wilkie (2021), "An OpenEXR Layout
for Spectral Images", JCGT 10(3).

A file has up to two parts for each eye. For an eye named "left", these are `left.spectral` (spectral radiance, channels
`S0.450,000000nm` ...) and `left.receptors` (photoreceptor signals, channels `receptor_0` ...). Each part also contains
a linear sRGB preview in the channels R, G and B, which ordinary image viewers show. Spectral parts precede receptor
parts, because programs that support only one part, such as colour-science, read the first one. Pixels are 32-bit floats
with ZIP compression.

A file is written completely or not at all. Each part stores a SHA-256 hash of its contents.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from optics.numerics.arguments import items, reals, shown
from sim.scene.color import preview

LAYOUT_VERSION = "1.0"
UNITS = "W.m^-2.sr^-1"
SCALE = "relative: a white Lambertian facing unit daylight has radiance D65, 1 at 560 nm"
# Default limit for the bytes of unpacked pixels in a file. Sixteen eyes of 128 x 128 receptors in 64 bands need a
# fifteenth of it.
MOST_BYTES = 2**30
_HELD = "rhabdom"  # name of the attribute that stores all values other than channels, as JSON
_HASH = "sha256"
_PREVIEW = ("R", "G", "B")


class ExrError(ValueError):
    """Error for a file that is incomplete, damaged, or not written by `write_exr`."""


@dataclass(frozen=True)
class View:
    """Image of one eye.

    name: name of the eye, such as "left"
    wavelengths_nm: wavelengths of the radiance's bands, (band,)
    radiance: spectral radiance, (band, y, x) float32; None: no spectral part
    receptors: signals of the receptors, (channel, y, x) float32; None: no receptor part
    rgb: linear sRGB preview of the radiance, (y, x, 3) float32; None: `write_exr` computes it
    attributes: further values that JSON can represent, such as seed, time step or position
    peaks_nm: wavelength of peak sensitivity of each receptor channel, (channel,). The preview shows the channel with
        the longest peak wavelength as red. None: channels are in descending order of their peak wavelengths.
    """

    name: str
    wavelengths_nm: np.ndarray = field(default_factory=lambda: np.empty(0))
    radiance: np.ndarray | None = None
    receptors: np.ndarray | None = None
    rgb: np.ndarray | None = None
    attributes: Mapping[str, Any] = field(default_factory=dict)
    peaks_nm: Sequence[float] | np.ndarray | None = None

    def __post_init__(self) -> None:
        where = f"View {shown(self.name)}"
        if not isinstance(self.name, str) or not self.name or not self.name.isprintable():
            raise ValueError(f"{where}: its name must be printable text, and not empty")
        if self.radiance is None and self.receptors is None:
            raise ValueError(f"{where}: has neither radiance nor receptors")
        for label, image in (("radiance", self.radiance), ("receptors", self.receptors)):
            if image is not None and (len(_shape(image)) != 3 or 0 in image.shape):
                raise ValueError(f"{where}: {label} {_kind(image)}: must be an array (band, y, x)")
        wavelengths = reals(f"{where}: wavelengths_nm", self.wavelengths_nm)
        if wavelengths.ndim != 1 or not np.all(np.isfinite(wavelengths)):
            raise ValueError(f"{where}: wavelengths_nm = {shown(self.wavelengths_nm)}: must be finite numbers (band,)")
        if self.radiance is not None:
            names = {_channel(nm) for nm in self.wavelengths_nm}
            if len(self.radiance) != len(self.wavelengths_nm) or len(names) != len(self.radiance):
                raise ValueError(f"{where}: needs one distinct wavelength per band of {self.radiance.shape}")
            if self.rgb is not None and _shape(self.rgb) != (*self.radiance.shape[1:], 3):
                raise ValueError(f"{where}: rgb {_kind(self.rgb)}: must be an array (y, x, 3) like the radiance")
        if self.peaks_nm is not None:
            peaks = reals(f"{where}: peaks_nm", self.peaks_nm)
            if self.receptors is None or peaks.shape != (len(self.receptors),) or not np.isfinite(peaks).all():
                raise ValueError(
                    f"{where}: peaks_nm = {shown(self.peaks_nm)}: must be a finite number for each channel of receptors"
                )


def _shape(image: Any) -> tuple[int, ...]:
    """Return the shape of an array of any library; () for other objects."""
    return tuple(getattr(image, "shape", ()))


def _kind(image: Any) -> str:
    """Return the shape or the value of an image, for messages."""
    return f"has shape {_shape(image)}" if hasattr(image, "shape") else f"is {shown(image)}"


def write_exr(path: str | os.PathLike[str], views: Sequence[View]) -> None:
    """Write views to an OpenEXR file, completely or not at all; an existing file is replaced.

    Raises:
        ValueError: there are no views, two views have the same name, or JSON cannot represent an attribute.
        OSError: the file cannot be written.
    """
    import OpenEXR

    views = items("views", views, View, "View('left', radiance=...)")
    names = [view.name for view in views]
    if not views or len(set(names)) != len(names):
        raise ValueError(f"write_exr: views = {names}: must be at least one, and no name twice")
    spectral = [_part(view, "spectral") for view in views if view.radiance is not None]
    receptors = [_part(view, "receptors") for view in views if view.receptors is not None]
    # OpenEXR requires the same display window in all parts, but images may differ in size, so the largest is used.
    shapes = [channels["R"].shape for _, channels, _ in spectral + receptors]
    corner = np.array([max(width for _, width in shapes) - 1, max(height for height, _ in shapes) - 1], np.int32)
    header = {
        "type": OpenEXR.scanlineimage,
        "compression": OpenEXR.ZIP_COMPRESSION,
        "displayWindow": (np.zeros(2, np.int32), corner),
    }
    parts = []
    for name, channels, attributes in spectral + receptors:
        attributes["parts"] = str(len(spectral) + len(receptors))
        attributes[_HASH] = _digest(name, channels, attributes)
        # OpenEXR silently writes wrong pixels if an array is not contiguous. _part makes all arrays contiguous.
        parts.append(OpenEXR.Part({**header, **attributes}, channels, name))
    encoded = io.BytesIO()  # OpenEXR cannot open files whose names are not UTF-8, so it writes to memory
    OpenEXR.File(parts).write(encoded)
    _write_whole(Path(path), encoded.getbuffer())


def read_exr(path: str | os.PathLike[str], most_bytes: int = MOST_BYTES) -> list[View]:
    """Read the views from a file that `write_exr` wrote.

    most_bytes: largest allowed size of the unpacked pixels [bytes]; the header of a small file can state any size

    Raises:
        ExrError: the file is truncated, damaged, altered, too large, or not written by `write_exr`. The message is one
            line.
        FileNotFoundError: the file does not exist.
    """
    import OpenEXR

    if not Path(path).is_file():
        raise FileNotFoundError(f"no such file: {path}")
    try:
        content = Path(path).read_bytes()
        headers = OpenEXR.File(io.BytesIO(content), header_only=True).parts
        expected = len(headers)
        if (unpacked := sum(_pixel_bytes(part.header) for part in headers)) > most_bytes:
            raise ExrError(f"unpacks to {unpacked:,} bytes: must be at most most_bytes = {most_bytes:,}")
        parts = OpenEXR.File(io.BytesIO(content), separate_channels=True).parts
        held = [_checked(part, expected) for part in parts]
    except ExrError as error:
        raise ExrError(f"{path}: {error}") from None
    except Exception as error:  # OpenEXR passes on C++ exceptions of any type
        raise ExrError(f"{path}: no readable OpenEXR file ({str(error).splitlines()[0]})") from None
    if len(parts) != expected:
        raise ExrError(f"{path}: truncated ({len(parts)} of {expected} parts are whole)")
    try:
        return _views(held)
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        reason = " ".join(str(error).split())[:200]
        raise ExrError(f"{path}: holds no views, though its hash is right ({type(error).__name__}: {reason})") from None


def _pixel_bytes(header: Mapping[str, Any]) -> int:
    """Return the memory of a part's pixels [bytes], computed from its header."""
    low, high = (np.asarray(corner, dtype=np.int64) for corner in header["dataWindow"])
    width, height = (int(side) for side in np.maximum(high - low + 1, 0))
    return width * height * len(header["channels"]) * 4


def _channel(nm: float) -> str:
    return f"S0.{nm:.6f}nm".replace(".", ",").replace("S0,", "S0.", 1)


def _part(view: View, kind: str) -> tuple[str, dict[str, np.ndarray], dict[str, str]]:
    """Return the name, channels and attributes of one part."""
    held: dict[str, Any] = {"attributes": dict(view.attributes)}
    attributes: dict[str, str] = {}
    if kind == "spectral":
        assert view.radiance is not None
        image, names = view.radiance, [_channel(nm) for nm in view.wavelengths_nm]
        held["wavelengths_nm"] = [float(nm) for nm in view.wavelengths_nm]
        rgb = preview(image, view.wavelengths_nm) if view.rgb is None else view.rgb
        attributes = {"spectralLayoutVersion": LAYOUT_VERSION, "emissiveUnits": UNITS, "radianceScale": SCALE}
    else:
        assert view.receptors is not None
        image, names = view.receptors, [f"receptor_{c}" for c in range(len(view.receptors))]
        if view.peaks_nm is not None:
            held["peaks_nm"] = [float(nm) for nm in view.peaks_nm]
        rgb = _false_colors(image, view.peaks_nm)
    try:
        attributes[_HELD] = json.dumps(held, sort_keys=True)
    except TypeError as error:
        raise ValueError(f"View {view.name!r}: attributes cannot be written as JSON ({error})") from None
    planes = dict(zip(names, image, strict=True)) | dict(zip(_PREVIEW, np.moveaxis(rgb, -1, 0), strict=True))
    channels = {name: np.ascontiguousarray(plane, dtype=np.float32) for name, plane in planes.items()}
    return f"{view.name}.{kind}", channels, attributes


def _false_colors(receptors: np.ndarray, peaks_nm: Sequence[float] | np.ndarray | None) -> np.ndarray:
    """Return a false-colour image (y, x, 3) of the receptor signals.

    The channel with the longest peak wavelength is shown as red, the next as green, and the next as blue. A single
    channel is shown as grey.
    """
    count = len(receptors)
    order = np.arange(count) if peaks_nm is None else np.argsort(-np.asarray(peaks_nm, float), kind="stable")
    return np.moveaxis(np.asarray(receptors)[order[np.minimum(range(3), count - 1)]], 0, -1)


def _digest(name: str, channels: Mapping[str, np.ndarray], attributes: Mapping[str, str]) -> str:
    digest = hashlib.sha256(name.encode())
    for key in sorted(attributes):
        digest.update(f"{key}={attributes[key]}\n".encode())
    for key in sorted(channels):
        digest.update(f"{key}:{channels[key].shape}\n".encode())
        digest.update(np.ascontiguousarray(channels[key], dtype=np.float32).tobytes())
    return digest.hexdigest()


_OWN_ATTRIBUTES = ("spectralLayoutVersion", "emissiveUnits", "radianceScale", _HELD, "parts")


def _checked(part: Any, expected: int) -> tuple[str, dict[str, np.ndarray], dict[str, Any]]:
    """Return a part's name, channels and stored values after checking its hash."""
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
            nm = np.array(held["wavelengths_nm"], dtype=np.float64)
            if nm.ndim != 1 or not np.all(np.isfinite(nm)):
                raise ValueError("wavelengths_nm: must be finite numbers")
            view["wavelengths_nm"] = nm
            view["radiance"] = np.stack([channels[_channel(x)] for x in nm])
            view["rgb"] = np.stack([channels[c] for c in _PREVIEW], axis=-1)
        else:
            count = sum(c.startswith("receptor_") for c in channels)
            view["receptors"] = np.stack([channels[f"receptor_{c}"] for c in range(count)])
            view["peaks_nm"] = held.get("peaks_nm")
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
