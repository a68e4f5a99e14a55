"""Images of a camera: an eye whose receptors are the pixels of a sensor, and the conversion of light to numbers."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np

from optics.elements.pupil import Pupil
from optics.eye.depth_range import layers_for
from optics.eye.eye import Eye
from optics.eye.geometry import behind_pupil
from optics.eye.photoreceptor import photon_noise
from optics.numerics.arguments import in_range, of_kind, positive, reals, shape_2d, whole
from optics.numerics.autodiff import Array, Scalar, holds_arrays, is_differentiable, number, plain
from optics.numerics.number_types import is_boolean
from optics.point_spread.request import sensor_place
from optics.spectra.photon_budget import PhotonBudget
from optics.spectra.receptors import receptors_of
from optics.spectra.srgb import decode_srgb, ink_radiance

__all__ = ["Sensor", "camera_eye", "camera_image"]

BAYER = ((0, 1), (1, 2))  # rows of types: red, green; green, blue


@dataclass(frozen=True)
class Sensor:
    """An image sensor: its pixels, their colour filters, and the conversion of electrons to digital numbers.

    pixels: number of pixels (height, width).
    pitch: side [m] of a square pixel, whose whole area is sensitive.
    filters: colour filters of the pixels. "bayer": red and green pixels alternate in the first row, green and blue
        pixels in the second row, and both rows are repeated over the sensor. Any value of an Eye's argument `receptors`
        is also valid, such as the name of an animal's receptors, or `Receptors` that have measured quantum efficiencies
        or are arranged in a mosaic. Without a mosaic, every pixel has all types of filters. The filters of "bayer" and
        "rgb" have peaks at 600, 520 and 460 nm.
    photon_budget: illuminance of the scene, exposure time, and quantum efficiency at the filters' peaks.
    full_well: number of electrons at which a pixel saturates.
    read_noise: standard deviation [electrons] of the noise of reading a pixel.
    bits: bits of a digital number, 1 to 16. A pixel with `full_well` electrons has the largest number. If `bits` is
        None, the result is the number of electrons, which is not rounded.
    bands: number of spectral bands of the scene, 1 to 64.

    Raises:
        ValueError: an argument is outside its valid range, which the message states.
    """

    pixels: tuple[int, int]
    pitch: float
    filters: Any = "bayer"
    photon_budget: PhotonBudget = field(default_factory=lambda: PhotonBudget(1e4, integration_time=1e-3))
    full_well: float = 1e4
    read_noise: float = 2.0
    bits: int | None = 12
    bands: int = 8

    def __post_init__(self) -> None:
        object.__setattr__(self, "pixels", shape_2d("pixels", self.pixels))
        positive("pitch", self.pitch)
        bayer = isinstance(self.filters, str) and self.filters == "bayer"
        filters = receptors_of("rgb").arranged(BAYER) if bayer else receptors_of(self.filters)
        object.__setattr__(self, "filters", filters)
        of_kind("photon_budget", self.photon_budget, PhotonBudget, "PhotonBudget(1e4)")
        in_range("full_well", self.full_well, 1, 1e9)
        in_range("read_noise", self.read_noise, 0, 1e6)
        if self.bits is not None:
            whole("bits", self.bits, 1, 16)
        whole("bands", self.bands, 1, 64)


def camera_image(
    scene: Any,
    lens: Pupil | Eye,
    sensor: Sensor | None = None,
    *,
    depth: Any = math.inf,
    samples_per_pixel: int = 1,
    field_zones: int | str = 1,
    rng: np.random.Generator | None = None,
    sensor_distance: Scalar | None = None,
    tolerance: float = 1e-2,
) -> np.ndarray | Array:
    """Return the image (channel, y, x) that a camera or an eye forms of a scene.

    A camera is a pupil with a sensor behind it. The image of an eye consists of the signals of its receptors.

    Light is blurred by the PSF for its wavelength and for the distance of the surface that it comes from. Near surfaces
    hide far ones (see `Eye.see`). The blurred light is integrated over each pixel and weighted by the sensitivity of
    the pixel's colour filter. Electrons are counted with shot noise, up to the full well. Read noise is added, and the
    sum is rounded to digital numbers.

    scene: sRGB image (Y, X, 3) with values in [0, 1], as in image files, or radiance (band, Y, X). Radiance is
        given for the bands `camera_eye(lens, sensor).spectral_bands`, and is 1 for a white surface. An sRGB image
        becomes reflectances in daylight (`srgb_basis`). Each entry (Y, X) is a cell of the scene. A pixel corresponds
        to samples_per_pixel² cells. The scene may be larger than the sensor, by an even number of cells along each
        axis. It is upright: row 0 is the top, column 0 the left.
    lens: a pupil, or an eye, which has its own receptors and noise.
    sensor: the sensor behind a pupil; None for an eye.
    depth: distance [m] of the scene along the axis: a number, or a map with one distance per cell (Y, X).
    samples_per_pixel: cells of the scene per pixel along each axis. Accurate images of defocused edges require more
        than one cell per pixel.
    field_zones: number of PSFs along the longer side of the field, or "auto", see `Eye.sight`. 1: the PSF in the middle
        of the field is used everywhere.
    rng: random generator of the noise. None: no noise, and the mean number of electrons.
    sensor_distance: distance [m] of the sensor behind the pupil. None: the distance at which the pupil's ideal lens
        focuses an infinitely distant point, or 240 µm without a lens.
    tolerance: relative error of the PSF, see `Eye`.

    Returns digital numbers as uint16 or, if `sensor.bits` is None, electrons as float32. The image has one channel if
    the sensor has a mosaic, and otherwise one channel for each type of filter. If the pupil or `depth` carries
    derivatives, which requires bits=None, the result is a Dr.Jit tensor of electrons. For an eye, the result is that of
    `Eye.see`. For PyTorch, see `optics.torch.camera_image`.

    Raises:
        ValueError: an argument is invalid; the message names it with its value and valid range.
        AccuracyError: see `optics.psf`.
        BackendError: see `optics.psf`.
    """
    if rng is not None:
        of_kind("rng", rng, np.random.Generator, "np.random.default_rng(0), or None for no noise")
    eye = lens if isinstance(lens, Eye) else camera_eye(lens, sensor, sensor_distance, tolerance)
    if isinstance(lens, Eye) and (sensor is not None or sensor_distance is not None):
        raise ValueError("lens is an Eye, and sensor or sensor_distance is given: must be None, an Eye has its own")
    radiance = _radiance(scene, eye, samples_per_pixel)
    z = _distances(depth, radiance.shape[1:])
    on_axis = isinstance(field_zones, int) and not is_boolean(field_zones) and field_zones == 1
    sight = None if on_axis else eye.sight(samples_per_pixel, z, layers_for(z)[0], field_zones)
    if sensor is None:
        return eye.see(radiance, samples_per_pixel, rng, z, sight)
    return _read(eye.see(radiance, samples_per_pixel, None, z, sight), sensor, eye, rng)


def camera_eye(
    lens: Pupil, sensor: Sensor | None, sensor_distance: Scalar | None = None, tolerance: float = 1e-2
) -> Eye:
    """Return the eye that a pupil and a sensor form: its receptors are the pixels, and its only noise is shot noise.

    This eye has the kernels, PSFs and spectral bands with which `camera_image` computes images. The arguments are those
    of `camera_image`, except that `lens` must be a pupil, and `sensor` must not be None.

    Raises:
        ValueError: an argument is invalid, sensor_distance carries a derivative, or the lens forms no real image of
            parallel light.
    """
    of_kind("lens", lens, Pupil, "Pupil(1e-3, thin_lens_focal_length=5e-3), or an Eye")
    of_kind("sensor", sensor, Sensor, "Sensor((480, 640), 3e-6)")
    if sensor_distance is not None:
        positive("sensor_distance", sensor_distance)
    distance = number(sensor_place(lens, sensor_distance, math.inf))
    make = _camera_eye.__wrapped__ if holds_arrays(lens) else _camera_eye
    return make(lens, sensor, distance, in_range("tolerance", tolerance, 1e-6, 0.5))


@lru_cache(maxsize=4)
def _camera_eye(pupil: Pupil, sensor: Sensor, distance: float, tolerance: float) -> Eye:
    """Return the eye that a pupil and a sensor form.

    Recent eyes are cached, because each eye stores the kernels of its last image, which take long to compute.
    """
    width = sensor.pixels[1] * sensor.pitch
    focal = distance / number(behind_pupil(pupil, 1.0))
    return Eye(
        pupil,
        sensor.pixels,
        2 * math.degrees(math.atan(width / 2 / focal)),
        width,
        sensor.bands,
        noise_sigma=0.0,
        tolerance=tolerance,
        dtype="float64" if holds_arrays(pupil) else "float32",
        photon_budget=sensor.photon_budget,
        receptors=sensor.filters,
        full_aperture=2 * number(pupil.aperture_radius),
        most_seconds=60.0,
    )


def _radiance(scene: Any, eye: Eye, samples_per_pixel: int) -> np.ndarray:
    """Return the radiance (band, Y, X) of an sRGB image, or of a scene that is spectral already.

    Raises:
        ValueError: the scene has another shape, or values that are invalid.
    """
    values = reals("scene", scene)
    if values.ndim != 3 or (values.shape[2] != 3 and len(values) != eye.bands):
        raise ValueError(
            f"scene has shape {values.shape}: must be an sRGB image (Y, X, 3), or radiance (band, Y, X) with "
            f"{eye.bands} bands"
        )
    if not np.isfinite(values).all():
        raise ValueError("scene holds NaN or infinity: must be finite")
    if values.shape[2] == 3:
        if values.min(initial=0) < 0 or values.max(initial=0) > 1:
            raise ValueError("scene holds values outside [0, 1]: must be an sRGB image, so divide bytes by 255")
        values = np.einsum("yxc,bc->byx", decode_srgb(values), ink_radiance(eye.spectral_bands, eye.receptors))
    s = whole("samples_per_pixel", samples_per_pixel, 1, 64)
    least = tuple(n * s for n in eye.resolution)
    if any(n < m or (n - m) % 2 for n, m in zip(values.shape[1:], least, strict=True)):
        raise ValueError(
            f"scene has {values.shape[1]} x {values.shape[2]} cells: must have {least[0]} x {least[1]} (pixels x "
            "samples_per_pixel), or exceed this by even numbers"
        )
    return values


def _distances(depth: Any, shape: tuple[int, ...]) -> Any:
    """Return the distance, or the map of distances; ValueError unless they are positive and fit the scene's `shape`."""
    if is_differentiable(depth) or np.ndim(found := reals("depth", depth)) == 0:
        positive("depth", depth, infinite=True, carried=True)
        return depth
    if found.shape != shape:
        raise ValueError(f"depth has shape {found.shape}: must be one distance, or one per cell of the scene, {shape}")
    if np.isnan(found).any():
        raise ValueError("depth holds NaN: must be distances greater than 0, in m, or infinite")
    positive("depth", float(found.min()), infinite=True)
    return found


def _read(signals: np.ndarray | Array, sensor: Sensor, eye: Eye, rng: np.random.Generator | None) -> np.ndarray | Array:
    """Return the digital numbers for the signals of pixels, or the numbers of electrons if `sensor.bits` is None.

    Raises:
        ValueError: the signals carry derivatives, and `sensor.bits` is not None.
    """
    per_signal = eye.receptor_photons
    assert per_signal is not None
    mean = np.maximum(plain(signals), 0) * per_signal
    noise = np.zeros_like(mean) if rng is None else photon_noise(mean, 1.0, rng) - mean
    read = 0.0 if rng is None else sensor.read_noise * rng.standard_normal(mean.shape)
    if is_differentiable(signals):
        import drjit as dr

        if sensor.bits is not None:
            raise ValueError(f"bits = {sensor.bits} and the pupil carries derivatives: must be None, for derivatives")
        tensor: Any = type(signals)
        return dr.clip(signals * tensor(per_signal + 0 * mean) + tensor(noise), 0, sensor.full_well) + tensor(read)
    electrons = np.minimum(mean + noise, sensor.full_well) + read
    if sensor.bits is None:
        return electrons.astype(np.float32)
    largest = 2**sensor.bits - 1
    return np.clip(np.rint(electrons * (largest / sensor.full_well)), 0, largest).astype(np.uint16)
