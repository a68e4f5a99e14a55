"""PSFs of several sources and wavelengths through one pupil, at coarse tolerances.

All PSFs are computed from the same samples of the pupil. The light behind the pupil is the product of two factors. The
first is the wave of the source, bent by the ideal lens and attenuated by aperture and mask. The second is the phase
factor of the relief and the wavefront. The wavefront and the height of the relief are computed once for all PSFs, and
the second factor once for each wavelength. The sums over the pupil are stacked matrix products (`window_sums`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from optics.elements.pupil import Pupil
from optics.elements.pupil_path import lens_path
from optics.elements.source import PointSource
from optics.methods.pixel_nodes import WindowSamples
from optics.methods.sampled_path import sampled_height, sampled_wavefront
from optics.methods.single_stack import single_stack
from optics.methods.slow_factor import Path
from optics.methods.stack_operation import is_single, stack_images
from optics.methods.window_check import window_errors
from optics.methods.window_crossings import WindowCrossings
from optics.methods.window_sampling import WindowSampling
from optics.methods.window_sums import intensity_of, window_field
from optics.numerics.array_library import library, like, turned
from optics.numerics.autodiff import Array, Scalar, carries_derivative, number
from optics.numerics.grid import Grid
from optics.numerics.kept_values import cached_arrays

__all__ = ["WindowStack"]

MOST_ENTRIES = 4e6  # choice, limited by memory: largest number of entries of a stack of matrices
MOST_BYTES = 64e6  # choice, limited by memory: all waves that are cached


@dataclass(frozen=True)
class WindowStack:
    """Light of several sources and wavelengths through a pupil to a window at one distance.

    The distance, the parameters of the sources, and all parameters of the pupil except its radius may be tensors of
    PyTorch that require a gradient.

    wavelengths: wavelengths [m] in vacuum.
    distance: distance [m] of the window behind the pupil.
    dtype: "float32" or "float64".
    convert: function that converts a NumPy array to the library that computes the PSFs, NumPy or PyTorch.
    """

    pupil: Pupil
    sources: tuple[PointSource, ...]
    wavelengths: tuple[float, ...]
    distance: Scalar
    window: Grid
    dtype: str
    convert: Callable[[np.ndarray], Array]

    def intensity(self, sampling: WindowSampling) -> Array:
        """Return the PSFs |U|² / (pupil area) [1/m²], (source, wavelength, y, x), with derivatives."""
        lights = zip(self._paths, self._factors(sampling.pupil), strict=True)
        images = [self._image(size, waves, sampling, path) for path, (size, waves) in lights]
        return library(images[0]).stack(images, 1) / self.pupil.area

    def errors(self, sampling: WindowSampling, images: Array, tolerance: float) -> Array:
        """Return the relative L2 error of each PSF over the window, see `window_errors`, (source, wavelength).

        images: result of `intensity` without derivatives, as an array of the library and on the device to which the
            function `convert` converts arrays.
        tolerance: tolerance of the PSFs.
        """
        seen, finer = (images * self.pupil.area).swapaxes(0, 1), single_stack(sampling.finer)
        crossings, count = WindowCrossings.from_images(seen.reshape(-1, *seen.shape[2:])), len(self.sources)
        found = []
        for place, (path, factors) in enumerate(zip(self._paths, self._factors(sampling.finer), strict=True)):
            own = crossings.part(slice(place * count, (place + 1) * count))
            arriving = _product(*factors, self.dtype) * self.convert(finer.to_middle(path.wavelength, self.dtype))
            found.append(window_errors(finer, path, arriving, own, tolerance))
        return library(images).stack(found, 1)

    @property
    def _paths(self) -> list[Path]:
        waves = [wavelength / self.pupil.index_behind(wavelength) for wavelength in self.wavelengths]
        return [Path(wave, number(self.distance), self.window) for wave in waves]

    def _factors(self, samples: WindowSamples) -> Iterator[tuple[Array, Array | None]]:
        """Yield two arrays for each wavelength, from which `_product` computes the light behind the pupil.

        The first array is the light that a pupil without relief and wavefront would pass, multiplied by the areas of
        the samples, (source, η, ξ). The second is the phase of relief and wavefront [waves], (η, ξ); None without
        these. η and ξ count the rows and columns of samples.
        """
        pupil = self.pupil
        height, ahead = (found(pupil, samples, self.convert) for found in (sampled_height, sampled_wavefront))
        if pupil.mask is not None:
            x, y, _ = samples.layout
            amplitude = pupil.amplitude(self.convert(x / pupil.radius), self.convert(y / pupil.radius))
        for wavelength in self.wavelengths:
            size = self._straight(samples, wavelength)
            path = None if height is None else like(height, pupil.index_step(wavelength)) * height
            if ahead is not None:
                path = -ahead if path is None else path - ahead
            size = size if pupil.mask is None else size * like(size.real, amplitude)
            yield size, None if path is None else path / wavelength

    def _straight(self, samples: WindowSamples, wavelength: float) -> Array:
        """Return the complex amplitudes of the waves behind the ideal lens, for unit amplitude at the pupil.

        Each amplitude is multiplied by the area of its sample and the transmittance of the aperture there. NumPy
        computes the waves, unless the focal length or a parameter of a source carries a derivative. The shape is
        (source, η, ξ), where η and ξ count rows and columns of samples.
        """
        pupil = self.pupil
        indices = pupil.index_before(wavelength), pupil.index_behind(wavelength)
        lens = _LensLight(pupil.thin_lens_focal_length, self.sources, indices, wavelength, self.dtype)
        if lens.carries_derivatives:
            return lens.waves(*map(self.convert, samples.layout))
        return self.convert(_fixed_waves(lens.plain, samples))

    def _image(self, size: Array, waves: Array | None, sampling: WindowSampling, path: Path) -> Array:
        """Return the intensity |U|² over the window, (source, y, x).

        size, waves: the two factors whose product is the light behind the pupil, see `_product`.
        """
        sums = sampling.sums(path, self.dtype)
        many = max(1, int(MOST_ENTRIES / sums.down.shape[-1] / sums.across.shape[-1]))
        if is_single(size, waves) and not carries_derivative(self.distance):
            return stack_images(size, waves, sums, self.dtype, many)
        light = _product(size, waves, self.dtype)
        kernel, down, across = (self.convert(part) for part in (sums.kernel, sums.down, sums.across))
        if carries_derivative(self.distance):
            kernel = kernel + (self.distance - number(self.distance)) * self.convert(sums.by_distance())
        parts = [light[first : first + many] for first in range(0, len(light), many)]
        images = [intensity_of(window_field(part, kernel, down, across)) for part in parts]
        return images[0] if len(images) == 1 else library(light).concatenate(images)


def _product(size: Array, waves: Array | None, dtype: str) -> Array:
    """Return the light from its factors: `size` times e^{2πi waves}."""
    return size if waves is None else size * turned(1.0, waves, dtype)


@dataclass(frozen=True)
class _LensLight:
    """Light of several sources at one wavelength [m] in vacuum, behind an ideal lens.

    focal_length: focal length [m] in vacuum; None without a lens.
    indices: refractive indices before and behind the pupil.
    """

    focal_length: Scalar | None
    sources: tuple[PointSource, ...]
    indices: tuple[float, float]
    wavelength: float
    dtype: str

    @property
    def carries_derivatives(self) -> bool:
        numbers = [number for source in self.sources for number in (source.distance, *source.angle)]
        return any(map(carries_derivative, [self.focal_length, *numbers]))

    @property
    def plain(self) -> _LensLight:
        """The same light with its parameters as floats without derivatives, so that it can be the key of a cache."""
        focal = None if self.focal_length is None else number(self.focal_length)
        return replace(self, focal_length=focal, sources=tuple(source.plain for source in self.sources))

    def waves(self, x: Array, y: Array, size: Array) -> Array:
        """Return the wave of each source at points (x, y) [m], array (source, y, x).

        size: amplitude of the waves.
        """
        before, behind = self.indices
        found = library(x).stack([source.path(x, y) for source in self.sources]) * (before / self.wavelength)
        if self.focal_length is not None:
            found = found - lens_path(self.focal_length, x, y) * (behind / self.wavelength)
        return turned(size, found, self.dtype)


@cached_arrays(MOST_BYTES, lambda waves: waves.nbytes)
def _fixed_waves(lens: _LensLight, samples: WindowSamples) -> np.ndarray:
    """Return the result of `_LensLight.waves` at the samples of a pupil, for light without derivatives.

    The result is cached, because successive pupils often have the same lens and sources.
    """
    found: np.ndarray = lens.waves(*samples.layout)
    return found
