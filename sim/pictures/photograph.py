"""A photograph seen through an animal's eye: from sRGB to a spectral scene, and to the signals of receptors."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

import optics
from optics import animals
from optics.numerics.arguments import in_range, one_of, reals, shown
from optics.spectra.bands import SpectralBands
from optics.spectra.receptors import receptors_of
from optics.spectra.srgb import decode_srgb, ink_radiance
from sim.exr.files import file_path
from sim.pictures.receptor_mosaic import ReceptorMosaic
from sim.scene.color import srgb_image

__all__ = ["ANIMALS", "read_depth", "read_photograph", "see_photograph"]

CAMERA = ("eagle", "goldfish", "human", "jumping_spider", "mouse")
ANIMALS = (*sorted(animals.COMPOUND), *CAMERA)
BANDS = 5  # choice: spectral bands
TOGETHER = 1_000_000  # choice, limited by memory: rays of ommatidia that are computed at once
MOST_RECEPTORS = 40_000  # choice, limited by time
CELLS = 2  # choice: cells of the scene per receptor, along each axis
MARGIN = 16  # choice: cells that continue the photograph beyond its edges
SMALLEST = 8  # pixels along the shorter side
Progress = Callable[[float], None]


def read_photograph(path: str | Path) -> np.ndarray:
    """Read an image file as sRGB values (y, x, 3) in [0, 1], rotated according to its EXIF orientation.

    Raises:
        ValueError: `path` is not a path; or the file is not an image, is damaged or too large, has transparency, or has
            neither three channels of 8 bits nor a palette.
        OSError: the file cannot be read.
    """
    from PIL import Image, ImageOps, UnidentifiedImageError

    try:
        with Image.open(file_path("path", path)) as image:
            mode, clear = image.mode, "transparency" in image.info
            upright = ImageOps.exif_transpose(image)
            pixels = np.asarray(upright.convert("RGB") if mode == "P" else upright)
    except UnidentifiedImageError:
        raise ValueError(f"{path}: must be an image, such as a PNG or JPEG file") from None
    except Image.DecompressionBombError:
        raise ValueError(f"{path}: has more than {2 * (Image.MAX_IMAGE_PIXELS or 0)} pixels: must have fewer") from None
    except (OSError, SyntaxError) as error:  # Pillow raises a SyntaxError for some damaged PNG files
        if isinstance(error, OSError) and error.filename is not None:
            raise
        raise ValueError(f"{path}: {error}: must be an undamaged image") from None
    if clear or mode in ("RGBA", "LA", "PA"):
        raise ValueError(f"{path}: has transparency (mode {mode}): must be opaque; save it without an alpha channel")
    if mode not in ("RGB", "P"):
        raise ValueError(f"{path}: has the mode {mode}: must have three channels, red, green and blue, of 8 bits")
    return pixels / 255.0


def read_depth(text: str) -> Any:
    """Return the distance [m] that a text states, as a float, or the array in the .npy file that the text names.

    Raises:
        ValueError: the text is neither a number nor a name that ends with ".npy", or the file contains no array.
        OSError: the file cannot be read.
    """
    try:
        return float(text)
    except ValueError:
        if not text.endswith(".npy"):
            raise ValueError(f"depth = {text}: must be a distance [m], or a .npy file of distances") from None
    try:
        return np.load(text, mmap_mode="r", allow_pickle=False)
    except (ValueError, EOFError) as error:
        raise ValueError(f"{text}: {error}: must be an undamaged .npy file of distances [m]") from None


def see_photograph(
    photograph: Any,
    animal: str,
    width_deg: float,
    uv: float = 1.0,
    depth: Any = None,
    progress: Progress | None = None,
) -> ReceptorMosaic:
    """Return the signals of an animal's receptors for a photograph, which covers a part of its visual field.

    Each colour is converted to one of the many reflectances that have this colour
    (`optics.spectra.spectrum.srgb_basis`). Daylight illuminates these reflectances. The reflected light passes the
    optics of the animal's eye (`optics.animals`) and excites its receptors. If `uv` is 1, a white surface gives a
    signal of 1; a smaller `uv` reduces the signals of receptors that are sensitive to ultraviolet.

    In eyes with a single lens, receptors that are finer than the photograph's pixels are replaced by one receptor for
    each pixel. If more than 40,000 would remain, about 40,000 coarser receptors replace them. Ommatidia are never
    replaced.

    photograph: sRGB values in [0, 1], (y, x, 3), at least 8 x 8 pixels, of a camera that maps straight lines to
        straight lines.
    animal: an animal with compound eyes, "blowfly", "dragonfly", "fruit_fly", "honeybee" or "megalopta"; or one with
        single-lens eyes, "eagle", "goldfish", "human", "jumping_spider" or "mouse".
    width_deg: angular width of the photograph [degrees], in [0.1, 120].
    uv: fraction of ultraviolet light, in [0, 1], that a white surface reflects. A photograph does not contain this
        information. Below 400 nm, the reflectances of `srgb_basis` are multiplied by `uv`.
    depth: distance [m] of the scene along the axis, above 0, a single number or an array (y, x). Eyes are focused at
        infinity, so near surfaces are blurred, and they hide parts of far ones (`optics.Eye.see`). None: infinity.
        Compound eyes accept None only, because their small facets are in focus at all distances.
    progress: function that is called with the completed fraction, above 0 and at most 1. None: no calls.

    Raises:
        ValueError: an argument is outside its range, the image or `depth` has the wrong shape, the field has more than
            40,000 ommatidia, or `depth` is given for a compound eye.
        optics.AccuracyError: the depth varies so much, or the scene is so near, that its blur cannot be computed
            accurately enough; see `optics.Eye.see`.
        optics.BackendError: Dr.Jit finds no usable LLVM library or GPU.
    """
    one_of("animal", animal, ANIMALS)
    width = in_range("width_deg", width_deg, 0.1, 120.0)
    linear = decode_srgb(srgb_image("photograph", photograph, SMALLEST))
    z = _checked_depth(depth, linear.shape[:2], animal)
    in_range("uv", uv, 0.0, 1.0)
    if progress is not None and not callable(progress):
        raise ValueError(f"progress = {shown(progress)}: must be a function of the completed fraction, or None")
    report = progress or (lambda share: None)
    if animal in animals.COMPOUND:
        return _compound(linear, animal, width, uv, report)
    return _camera(linear, z, animal, width, uv, report)


def _checked_depth(depth: Any, shape: tuple[int, ...], animal: str) -> np.ndarray:
    """Return the distance of the scene along the eye's axis [m] at each pixel of a photograph, (y, x).

    depth: argument of `see_photograph`: distance of each pixel, or one distance for all; None: all are infinite
    shape: height and width of the photograph
    animal: name of the animal

    Raises:
        ValueError: the eye is a compound eye and `depth` is not None, or `depth` has another shape, or a distance is
            not positive.
    """
    if depth is None:
        return np.full(shape, math.inf)
    if animal in animals.COMPOUND:
        raise ValueError(f"depth: the facets of a {animal} are in focus at all distances, so depth must be None")
    found = reals("depth", depth)
    if found.ndim and found.shape != shape:
        raise ValueError(f"depth has shape {found.shape}: must be that of the photograph, {shape}, or a single number")
    if not (found > 0).all():
        raise ValueError("depth: must hold positive distances [m], or infinity")
    return np.broadcast_to(found, shape)


def _height_deg(linear: np.ndarray, width_deg: float) -> float:
    ratio = linear.shape[0] / linear.shape[1]
    return 2 * math.degrees(math.atan(ratio * math.tan(math.radians(width_deg) / 2)))


def _compound(linear: np.ndarray, animal: str, width_deg: float, uv: float, report: Progress) -> ReceptorMosaic:
    receptors = receptors_of(animals.COMPOUND[animal])
    bands = SpectralBands.uniform(BANDS, receptors)
    apart = math.radians(getattr(animals, animal)(rings=0).interommatidial_deg)
    tall = math.radians(_height_deg(linear, width_deg))
    columns = max(2, int(math.radians(width_deg) / apart))
    rows = max(2, int(tall / (apart * math.sqrt(3) / 2)))
    if rows * columns > MOST_RECEPTORS:
        raise ValueError(
            f"width_deg = {width_deg:g}: {rows * columns} ommatidia of a {animal}, must be at most {MOST_RECEPTORS}, "
            "so choose a smaller part of the field"
        )
    shifts = np.where(np.arange(rows) % 2 == 1, 0.25, -0.25)[:, None]
    x = apart * (np.arange(columns) - (columns - 1) / 2 + shifts)
    y = -apart * math.sqrt(3) / 2 * (np.arange(rows) - (rows - 1) / 2)[:, None] + np.zeros_like(x)
    directions, inks = np.column_stack([x.ravel(), y.ravel()]), ink_radiance(bands, receptors, uv)
    found = np.empty((len(inks), len(directions)))
    for band, wavelength in enumerate(bands.wavelengths):
        around_x, around_y, weights = _field(animal, float(wavelength))
        scene = _by_angle(linear @ inks[band], math.radians(width_deg))
        step = max(1, TOGETHER // len(weights))
        for start in range(0, len(directions), step):
            part = directions[start : start + step]
            found[band, start : start + step] = scene(part[:, :1] + around_x, part[:, 1:] + around_y) @ weights
            report((band + min(1.0, (start + step) / len(directions))) / len(inks))
    signals = (bands.weights @ found).reshape(-1, rows, columns)
    return ReceptorMosaic(animal, signals, _peaks(receptors), width_deg, hexagons=True)


@lru_cache(maxsize=64)
def _field(animal: str, wavelength: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    eye: optics.AppositionEye = getattr(animals, animal)(rings=0)
    return eye.field(wavelength)


def _by_angle(plane: np.ndarray, width: float) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    """Return a function that interpolates the radiance `plane` (y, x) at angles [rad] to the right and up.

    Outside the photograph, it returns the values at the edges.

    width: angular width of the photograph [rad]
    """
    from scipy.ndimage import map_coordinates

    per_tangent = plane.shape[1] / (2 * math.tan(width / 2))
    middle_y, middle_x = ((side - 1) / 2 for side in plane.shape)

    def radiance(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        limit = math.radians(89)
        tx, ty = (np.tan(np.clip(angle, -limit, limit)) for angle in (x, y))
        at = np.stack([middle_y - per_tangent * ty, middle_x + per_tangent * tx])
        return np.asarray(map_coordinates(plane, at, order=1, mode="nearest"))

    return radiance


def _camera(
    linear: np.ndarray, depth: np.ndarray, animal: str, width_deg: float, uv: float, report: Progress
) -> ReceptorMosaic:
    patch: optics.Eye = getattr(animals, animal)()
    nodal = float(patch.sensor_distance)
    sensor_width = 2 * nodal * math.tan(math.radians(width_deg) / 2)
    most = math.sqrt(MOST_RECEPTORS * linear.shape[1] / linear.shape[0])
    columns = max(2, int(min(sensor_width / patch.receptor_pitch, linear.shape[1], most)))
    rows = max(2, round(columns * linear.shape[0] / linear.shape[1]))
    eye = replace(patch, resolution=(rows, columns), fov_deg=width_deg, sensor_width=sensor_width, bands=BANDS)
    cells = _resized(linear, (rows * CELLS, columns * CELLS))
    scene = np.einsum("yxc,bc->byx", cells, ink_radiance(eye.spectral_bands, eye.receptors, uv))
    report(0.1)
    padded = np.pad(scene, ((0, 0), (MARGIN, MARGIN), (MARGIN, MARGIN)), mode="edge")
    z = np.pad(_nearest(depth, (rows * CELLS, columns * CELLS)), MARGIN, mode="edge")
    distances: Any = z if np.ptp(1 / z) else float(z[0, 0])
    signals = np.asarray(eye.see(padded, CELLS, z=distances)) / float(eye.white_signal)
    report(1.0)
    return ReceptorMosaic(animal, signals, _peaks(eye.receptors), width_deg, hexagons=False)


def _resized(linear: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """Return the means of a photograph (y, x, 3) over the cells of a grid of this size (rows, columns)."""
    from PIL import Image

    planes = [Image.fromarray(plane.astype(np.float32)) for plane in np.moveaxis(linear, -1, 0)]
    return np.stack([np.asarray(plane.resize(size[::-1], Image.Resampling.BOX)) for plane in planes], axis=-1)


def _nearest(depth: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """Return the distance of the scene in the middle of each cell of a grid of this size (rows, columns).

    Means over cells are not used: in a cell that shows two surfaces, the mean lies between their distances.

    depth: distance of the scene at each pixel, (y, x)
    """
    rows, columns = (
        ((np.arange(wanted) + 0.5) * known / wanted).astype(int)
        for wanted, known in zip(size, depth.shape, strict=True)
    )
    found: np.ndarray = depth[np.ix_(rows, columns)]
    return found


def _peaks(receptors: optics.Receptors) -> tuple[float, ...]:
    return tuple(float(kind.peak_nm) for kind in receptors.types)
