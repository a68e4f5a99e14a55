"""PSFs of several sources and wavelengths through one pupil, from the same samples of the pupil, at coarse tolerances.

The light behind the pupil is the product of two factors: the wave of the source, bent by the ideal lens, and the phase
of relief and wavefront with the amplitude of aperture and mask. Heights are computed once for all PSFs, and the second
factor once for each wavelength. The sums over the pupil are stacked matrix products (`window_sums`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from optics.elements.pupil import Pupil
from optics.elements.pupil_path import lens_path, relief_height, wavefront_ahead
from optics.elements.source import PointSource
from optics.methods.sine_samples import SineSamples
from optics.methods.sine_stack import single_stack
from optics.methods.slow_factor import Path
from optics.methods.window_check import window_errors
from optics.methods.window_sampling import WindowSampling
from optics.methods.window_sums import intensity_of, window_field
from optics.numerics.array_library import library, like, turned
from optics.numerics.autodiff import Array, Scalar, carries_derivative, number
from optics.numerics.grid import Grid

__all__ = ["WindowStack"]

MOST_ENTRIES = 4e6  # choice, limited by memory: largest number of entries of a stack of matrices


@dataclass(frozen=True)
class WindowStack:
    """Light of several sources and wavelengths through a pupil to a window at one distance.

    The distance, the numbers of the sources and those of the pupil, except its radius, may carry derivatives of
    PyTorch.

    wavelengths: wavelengths [m] in vacuum.
    distance: distance [m] of the window behind the pupil.
    dtype: "float32" or "float64".
    convert: function that converts a NumPy array to the library of the computation, NumPy or PyTorch.
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
        lights = zip(self._paths, self._light(sampling.pupil), strict=True)
        images = [self._image(light, sampling, path) for path, light in lights]
        return library(images[0]).stack(images, 1) / self.pupil.area

    def errors(self, sampling: WindowSampling, images: np.ndarray, tolerance: float) -> np.ndarray:
        """Return the relative L2 error of each PSF over the window, see `window_errors`, (source, wavelength).

        images: result of `intensity` as a NumPy array. The stack carries no derivatives.
        tolerance: tolerance of the PSFs.
        """
        seen, finer = np.moveaxis(images * self.pupil.area, 1, 0), single_stack(sampling.finer)
        found = [
            window_errors(finer, path, light * finer.to_middle(path.wavelength, self.dtype), own, tolerance)
            for path, light, own in zip(self._paths, self._light(sampling.finer), seen, strict=True)
        ]
        return np.stack(found, 1)

    @property
    def _paths(self) -> list[Path]:
        waves = [wavelength / self.pupil.index_behind(wavelength) for wavelength in self.wavelengths]
        return [Path(wave, number(self.distance), self.window) for wave in waves]

    def _light(self, samples: SineSamples) -> Iterator[Array]:
        """Yield the light behind the pupil times the areas of the samples, (source, η, ξ), for each wavelength."""
        pupil, (x, y, size) = self.pupil, map(self.convert, samples.layout)
        height, ahead = relief_height(pupil, x, y), wavefront_ahead(pupil, x, y)
        if pupil.mask is not None:
            size = size * pupil.amplitude(x / pupil.radius, y / pupil.radius)
        straight = self._straight(samples)
        for wavelength in self.wavelengths:
            path = like(x, 0.0) * x
            if height is not None:
                path = path + like(x, pupil.index_step(wavelength)) * height
            if ahead is not None:
                path = path - ahead
            yield straight(wavelength) * turned(size, path / wavelength, self.dtype)

    def _straight(self, samples: SineSamples) -> Callable[[float], Array]:
        """Return a function that returns, for a wavelength, the waves behind the ideal lens, (source, η, ξ).

        If no number of lens and sources carries a derivative, NumPy computes the waves.
        """
        pupil, (x, y, _) = self.pupil, samples.layout
        numbers = [number for source in self.sources for number in (source.distance, *source.angle)]
        carried = any(map(carries_derivative, [pupil.thin_lens_focal_length, *numbers]))
        if carried:
            x, y = self.convert(x), self.convert(y)
        shorter, paths = lens_path(pupil, x, y), [source.path(x, y) for source in self.sources]
        path = library(x).stack(paths)

        def wave(wavelength: float) -> Array:
            whole = path * (pupil.index_before(wavelength) / wavelength)
            if shorter is not None:
                whole = whole - shorter * (pupil.index_behind(wavelength) / wavelength)
            found = turned(1.0, whole, self.dtype)
            return found if carried else self.convert(found)

        return wave

    def _image(self, light: Array, sampling: WindowSampling, path: Path) -> Array:
        """Return |U|² over the window, (source, y, x), from the light behind the pupil."""
        sums = sampling.sums(path, self.dtype)
        kernel, down, across = (self.convert(part) for part in (sums.kernel, sums.down, sums.across))
        if carries_derivative(self.distance):
            kernel = kernel + (self.distance - number(self.distance)) * self.convert(sums.by_distance())
        many = max(1, int(MOST_ENTRIES / down.shape[-1] / across.shape[-1]))
        parts = [light[first : first + many] for first in range(0, len(light), many)]
        images = [intensity_of(window_field(part, kernel, down, across)) for part in parts]
        return images[0] if len(images) == 1 else library(light).concatenate(images)
