"""An eye: a pupil in front of a flat retina of photoreceptors."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from optics.eye.depth_range import MOST_DISTINCT, layers_for
from optics.eye.eye_spec import EyeSpec
from optics.eye.geometry import direction, tangents
from optics.eye.kernel_bank import KernelBank, prepare
from optics.eye.kernel_interpolation import NodeError
from optics.eye.patch import receptor_in, spacing_range
from optics.eye.polarization import taken_by
from optics.eye.receptor_kernel import CELLS_FOR_BANDS, bands_for, receptor_kernel, white_share
from optics.eye.retina import Retina
from optics.eye.retinal_image import centred, with_centre
from optics.eye.signals import signals, with_noise
from optics.eye.summary import Description, describe
from optics.eye.visual_kernel import perfect_psf, retinal_psf
from optics.numerics.accuracy import AccuracyError
from optics.numerics.arguments import in_range, of_kind, one_of, positive, radiance_cube, whole
from optics.numerics.autodiff import Array, Scalar, holds_arrays, number, plain, to_user
from optics.point_spread.psf_result import PSFResult
from optics.spectra.bands import SpectralBands

__all__ = ["Eye"]

LAST = "_kept_sight"  # attribute that stores the last kernels of `see`
LIGHT_FROM = ("cells", "centres")  # positions within scene cells from which light comes


@dataclass(frozen=True)
class Eye(EyeSpec):
    """An eye: a pupil, a retina of receptors, and noise.

    Pupil and retina have the axes of the OSA and of ANSI Z80.28, as seen by an observer in front of the eye: x to the
    right, which is the owner's left, and y up. In all arrays, rows are numbered along y and columns along x. Because
    the image is inverted, row 0 sees the top of the visual field, and column 0 its left.

    pupil: a Pupil. None is a perfect lens without blur and with a throughput of 1.
    resolution: number of receptors (height, width). Receptors are square with the side sensor_width / width, unless
        `vertical_fov_deg` is given.
    fov_deg: horizontal field of view in front of the eye, in [1e-3, 170]. The retina lies at f = L / (2 tan(fov/2))
        behind the pupil. If the indices n behind and n₀ in front of the pupil differ, it lies at f n/n₀.
    sensor_width: L, width [m] of the retina or of the modelled patch of it.
    full_aperture: diameter [m] of the eye's widest pupil, whose throughput is 1 by definition (None: L).
    eccentricity_deg: (right, up), viewing direction of the middle of the patch in the visual field.
    bands: number of spectral bands, 1 to 64. "auto": the smallest power of two, up to 32, for which the predicted error
        of a receptor's signal is within the tolerance. The choice requires PSFs at many wavelengths. It is worthwhile
        for an eye that is used often. This field then contains the chosen number.
    noise_sigma: standard deviation of a receptor's Gaussian noise, in units of the signal.
    photon_budget: light level. Shot noise is added before the Gaussian noise (None: no shot noise).
    receptors: types of receptor: "rgb" (three channels: red, green, blue), "lms" (human cones), "honeybee", "goldfish",
        "mouse", "fruit_fly", "blowfly", "dragonfly", "jumping_spider", peak wavelengths of pigments [nm], or
        `Receptors`, which can be a mosaic. This field then contains `Receptors`.
    waveguide: rhabdom of each receptor. It stands in the middle of the receptor, points at the pupil's centre, and
        accepts light in its guided modes (None: receptors absorb all light on their area).
    microvilli: directions and dichroic ratios of the receptors' microvilli: one `Microvilli` for all receptors, or rows
        of `Microvilli`, repeated over the retina from its top left corner. Azimuths are measured in the visual field,
        from right towards up, in the plane perpendicular to the ray through the pupil's centre. Microvilli affect only
        polarised scenes (None: receptors are insensitive to polarisation).
    pupil_turned: True if the pupil is rotated by 180° about the axis. The axes of `psf` are then those of the pupil.
    vertical_fov_deg: vertical field of view [degrees], 0.001 to 170, which determines the height of the receptors.
        None: receptors are square, and the height of the retina follows from the number of rows.
    most_seconds: longest predicted time [s] that the PSF of a band may take. Pupils that need more are refused.
    dynamics: time course of the receptors' responses. Only environments use it. The methods of `Eye` return the signals
        for constant light. None: receptors respond without delay.
    density: receptors per area of the retina, up to a constant factor. It is a function of the angles (right, up)
        [degrees] from the eye's axis (a `Fovea` or `VisualStreak`), an array (row, column) over the whole field, from
        its top left, or the `lattice` of an eye. Receptors are rectangles in rows. A signal is the mean over a
        receptor, and large receptors have less shot noise (None: all receptors are alike).
    tolerance: relative L2 error of the PSF. It is also the largest error that each automatic choice, of bands or of
        kernels, may cause in a receptor's signal, relative to the signal that a white surface gives.
    dtype: "float32" or "float64", the type of PSF, kernel and signals.

    The pupil (see `Pupil`), fov_deg and distances z may contain Dr.Jit arrays that carry derivatives. Results that
    depend on such arrays are Dr.Jit tensors. All other results are NumPy arrays.

    Raises:
        ValueError: an argument is outside its valid range, which the message states.
        AccuracyError: rays are too steep for accurate signals of microvilli; with bands="auto", see also `psf`.
    """

    @property
    def white_signal(self) -> Scalar:
        """Signal of a receptor that sees white everywhere, averaged over receptor types.

        It is `throughput`. With waveguides, it is the light that they absorb, divided by that on the widest pupil.
        """
        if self.waveguide is None:
            return self.throughput
        return number(self.aperture_throughput) * self._guided_share

    @cached_property
    def _guided_share(self) -> float:
        return white_share(plain(self.kernel(1)), self.spectral_bands)

    def psf(self, z: Scalar = math.inf) -> PSFResult:
        """Return the PSF on the retina for a point in direction `eccentricity_deg`.

        The point's distance along the axis is z [m]. Its image is at the retina's middle. The PSF's window loses less
        than the fraction `tolerance` of light (exceptions: see `kernel`). A perfect lens has one sample with all power.

        Raises:
            ValueError: z is not positive.
            AccuracyError: see `optics.psf`.
        """
        positive("z", z, infinite=True, carried=True)
        if self.pupil is None:
            return perfect_psf(self._retina(1), self.widest_pupil / 2)
        return retinal_psf(self.pupil, self._retina(4), z, tangents(self.eccentricity_deg))

    def kernel(
        self, samples_per_receptor: int, z: Scalar = math.inf, direction_deg: tuple[float, float] | None = None
    ) -> np.ndarray | Array:
        """Return the receptive kernel (band, ky, kx) in the orientation of the visual field.

        It is the PSF, integrated over cells, the samples_per_receptor² equal parts of a receptor; ky and kx are odd.

        z: distance [m] of the scene along the axis, positive or infinite.
        direction_deg: angles (right, up) from the axis to a point source, -80 to 80 (None: `eccentricity_deg`). The
            kernel's centre cell lies around the geometric image of this source.

        The kernel's sum is the fraction of the pupil's power that lands in its window. The window loses less than the
        fraction `tolerance` of it, except for light at more than 50° from the receptor's direction. Light that a steep
        pupil relief deflects by more than the retina's side may count as blocked. A perfect lens has the kernel 1, a
        single cell. A cell of the scene is imaged on a receptor's cell. The kernel is for light from its centre, but by
        default, `see` assumes light from all its points (see `sight`). Signals are then `aperture_throughput` Σ_b
        `spectral_bands.weights[c, b]` (kernel_b ⊗ radiance_b), averaged over each receptor's cells.

        With waveguides, the kernel is the fraction of light that a receptor accepts from each cell of the scene near
        its direction, averaged over the cell. Signals are not averaged over the receptor. ky and kx are even if
        samples_per_receptor is even. If receptors absorbed all light, without a mask in the pupil, the sum would be 1.

        Raises:
            ValueError: an argument is invalid, a waveguide has no mode, or waveguides are combined with derivatives.
            AccuracyError: see `optics.psf`.
        """
        positive("z", z, infinite=True, carried=True)
        asked = self.eccentricity_deg if direction_deg is None else direction("direction_deg", direction_deg)
        retina = self._retina(whole("samples_per_receptor", samples_per_receptor, 1, 64))
        return to_user(receptor_kernel(self, retina, z, tangents(asked), self.waveguide is not None))

    def _retina(self, samples_per_receptor: int) -> Retina:
        return self._retina_of(self.spectral_bands.wavelengths, self.receptor_size, samples_per_receptor)

    def _retina_of(self, wavelengths: np.ndarray, receptor: tuple[float, float], samples: int) -> Retina:
        size = self.resolution[0] * self.receptor_size[0], self.resolution[1] * self.receptor_size[1]
        settings = size, samples, self.dtype, self.pupil_turned, self.most_seconds
        cell = receptor[0] / samples, receptor[1] / samples
        return Retina(self.retina_distance, wavelengths, cell, self.tolerance, *settings)

    def chosen_bands(self) -> SpectralBands:
        """Return the fewest bands that meet the tolerance. For errors, see `choose_bands` and `psf`."""
        retina = self._retina_of(np.empty(0), self.smallest_receptor, CELLS_FOR_BANDS)
        return bands_for(self, retina, tangents(self.eccentricity_deg))

    def sight(
        self,
        samples_per_receptor: int,
        z: Scalar = math.inf,
        depth_layers: int | str = "auto",
        field_zones: int | str = 1,
        tolerance: float | None = None,
        light_from: str = "cells",
    ) -> KernelBank:
        """Return the kernels for a scene with a range of distances and directions.

        The result, if printed, shows the chosen numbers of kernels with reasons.

        z: distances [m] in the scene, a number or an array. Only the nearest and the farthest distance matter, unless
            depth_layers="distinct".
        depth_layers: number of kernels between the nearest and the farthest distance, evenly spaced in 1/z. "auto": the
            first of 1, 3, 5, 9, 17 and 33 that meets the tolerance. "distinct": one kernel for each different distance
            in z, at most 64.
        field_zones: number of kernels along the longer side of the field, or "auto" for the first of 1, 3, 5 and 9 that
            meets the tolerance. 1: the kernel in the middle of the field is used for the whole retina.
        tolerance: largest error of a receptor's signal, relative to the signal of a white surface, in all scenes that
            are nowhere brighter than white (None: the eye's tolerance).
        light_from: "cells" is exact if radiance is constant within each cell of the scene. "centres" treats all light
            of a cell as coming from its centre. It suits cells whose radiance is the mean of finer detail, as in
            rendered images. For them, the error of "cells", O(samples_per_receptor^-2), is more than twice as large.

        Raises:
            ValueError: an argument is outside its valid range, which the message states.
            AccuracyError: see `optics.psf`, or the tolerance requires more kernels than the maximum of "auto".
        """
        within = self.tolerance if tolerance is None else in_range("tolerance", tolerance, 1e-6, 0.5)
        s = whole("samples_per_receptor", samples_per_receptor, 1, 64)
        from_cell = one_of("light_from", light_from, LIGHT_FROM) == LIGHT_FROM[0]
        counts, half_width = (depth_layers, field_zones), self.sensor_width / 2
        half_height = self.resolution[0] / 2 * self.receptor_size[0]
        high, wide = (half / number(self.sensor_distance) for half in (half_height, half_width))
        aside, below = tangents(self.eccentricity_deg)

        def kernel_at(distance: Scalar, right: float, down: float) -> Array:
            place = aside + right * wide, below + down * high
            return with_centre(receptor_kernel(self, self._retina(s), distance, place, from_cell))

        def white() -> float:
            return number(self.white_signal) / number(self.aperture_throughput)

        mean = 1 if self.waveguide is not None else max(1, int(s * self.smallest_share))
        bank = prepare(kernel_at, self.resolution, s, z, counts, within, mean=mean, white=white)
        return replace(bank, averaged=self.waveguide is None, parallax=self.parallax * s)

    def see(
        self,
        radiance: np.ndarray,
        samples_per_receptor: int,
        rng: np.random.Generator | None = None,
        z: Scalar = math.inf,
        sight: KernelBank | None = None,
        polarization: Any = None,
    ) -> np.ndarray | Array:
        """Return the signals (channel, h, w) for a scene in the tangent plane, by convolution.

        The signals that renderers compute are compared with the result of this method.

        radiance: radiance (band, Y, X) of the scene's cells. Each receptor is divided into s x s equal cells, with s =
            samples_per_receptor. Radiance is constant within a cell, unless `sight` has light_from="centres". The scene
            is centred on the field, and dark outside. It has at least h s x w s cells. A larger scene must exceed this
            height and this width by even numbers.
        rng: random generator of the noise; None for signals without noise. Noise carries no derivative.
        z: distance [m] of the scene along the axis, a number or a map with one per cell (Y, X). In a map, near surfaces
            hide far ones at jumps of depth (see `optics.eye.occlusion`). A hidden cell of a far surface is replaced by
            the nearest visible cell of this surface. Up to 17 different distances have one kernel each. If there are
            more, kernels are interpolated between fewer distances, within the eye's tolerance.
        sight: kernels from `Eye.sight` with the same samples_per_receptor; None computes them. An object beyond the
            kernels' range of distances is rendered with the kernel at the end of this range. The kernels of the last
            call are cached. With `dataclasses.replace(sight, parallax=0)` no surface hides another one.
        polarization: (degree, angle_deg) of the light, for an eye with microvilli. These are the degree of linear
            polarisation in [0, 1], and the angle of the electric field, from right towards up. Each is a number or an
            array (band,), (Y, X) or (band, Y, X). None: unpolarised or circularly polarised light, which microvilli do
            not distinguish.

        Raises:
            ValueError: radiance has another shape or is not finite; z has another shape, is not positive or holds NaN;
                sight is for another eye; or the light is polarised and receptors have no microvilli.
            AccuracyError: see `optics.psf`, or z has so wide a range that the tolerance requires too many kernels.
        """
        s = whole("samples_per_receptor", samples_per_receptor, 1, 64)
        if rng is not None:
            of_kind("rng", rng, np.random.Generator, "np.random.default_rng(0), or None for no noise")
        shape = self.resolution[0] * s, self.resolution[1] * s
        scene = radiance_cube(radiance, self.bands, shape)
        centred(scene, shape)
        parts = taken_by(self.microvilli, self.resolution, scene, polarization)
        bank = self._last_sight(s, z) if sight is None else of_kind("sight", sight, KernelBank, "eye.sight(4)")
        bank.check(shape, self.bands, averaged=self.waveguide is None)
        found = signals(self, parts, bank, s, z)
        return to_user(found if rng is None else with_noise(self, found, rng))

    def _last_sight(self, samples_per_receptor: int, z: Any) -> KernelBank:
        """Return the kernels for scene distances z [m], from the cache if the last call of `see` used the same kernels.

        Kernels that depend on Dr.Jit arrays are computed again, because the arrays may carry derivatives.
        """
        layers, distances = layers_for(z)
        if holds_arrays(z) or holds_arrays(self):
            return self._sight_for(samples_per_receptor, z, layers)
        key = samples_per_receptor, distances
        known, bank = vars(self).get(LAST, (None, None))
        if known != key:
            bank = self._sight_for(samples_per_receptor, z, layers)
            vars(self)[LAST] = key, bank
        return bank

    def _sight_for(self, samples_per_receptor: int, z: Any, layers: str) -> KernelBank:
        try:
            return self.sight(samples_per_receptor, z, layers)
        except NodeError:
            raise AccuracyError(
                f"z from {np.min(z):.3g} to {np.max(z):.3g} m needs more kernels than the limit at the eye's tolerance "
                f"of {self.tolerance:g}: must span less, or hold at most {MOST_DISTINCT} different distances, or pass "
                "sight=eye.sight(..., depth_layers=64)"
            ) from None

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name != LAST}

    def describe(self, z: Scalar = math.inf, direction_deg: tuple[float, float] | None = None) -> Description:
        """Return a table of the eye's limits: see `summary.Description`.

        z: distance [m] of the scene.
        direction_deg: angles (right, up) [degrees] from the eye's axis. The table describes the receptor that faces in
            this direction. None: the middle of the field.

        Raises:
            ValueError: the direction is outside the field, or z is not positive.
            AccuracyError: see `optics.psf`.
        """
        own = self if self.lattice is None and direction_deg is None else receptor_in(self, direction_deg)
        found = describe(own, number(own.white_signal), own.psf(z), partial(own.kernel, z=z))
        return found if self.lattice is None else replace(found, interommatidial_range_deg=spacing_range(self))
