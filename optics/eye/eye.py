"""An eye: a pupil in front of a flat retina of photoreceptors."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np

from optics.eye.eye_spec import EyeSpec
from optics.eye.geometry import direction, tangents
from optics.eye.kernel_bank import KernelBank, prepare
from optics.eye.polarization import taken_by
from optics.eye.receptive_field import Retina, perfect_psf, retinal_psf
from optics.eye.receptor_kernel import CELLS_FOR_BANDS, bands_for, receptor_kernel, white_share
from optics.eye.retinal_image import centred, with_centre
from optics.eye.signals import signals, with_noise
from optics.eye.summary import Description, describe
from optics.numerics.arguments import in_range, of_kind, one_of, positive, radiance_cube, whole
from optics.numerics.autodiff import Array, Scalar, number, plain, to_user
from optics.point_spread.psf_result import PSFResult
from optics.spectra.bands import SpectralBands

__all__ = ["Eye"]

LIGHT_FROM = ("cells", "centres")  # origin of the light within scene cells


@dataclass(frozen=True)
class Eye(EyeSpec):
    """Pupil, retina and noise. Arrays are in visual-field orientation, row 0 at the top, column 0 on the left.

    pupil: a Pupil. None is the perfect lens: no blur, full throughput.
    resolution: receptors (height, width); square, pitch = sensor_width / width.
    fov_deg: horizontal field of view in front of the eye, in [1e-3, 170]. The retina lies at f = L / (2 tan(fov/2)), or
        n/n₀ times as far behind a pupil between two media.
    sensor_width: L [m], width of the retina or of a patch of it.
    full_aperture: diameter [m] of the pupil with a throughput of 1; None: L.
    eccentricity_deg: (right, up), viewing direction of the middle of the patch in the visual field.
    bands: spectral bands, 1 to 64, or "auto": the fewest that keep a receptor's predicted error within the tolerance.
        "auto" computes PSFs of many bands, which pays off for an eye that is used often. The field then contains the
        choice.
    noise_sigma: standard deviation of a receptor's Gaussian noise, in signal units.
    photon_budget: illumination. Its shot noise precedes the Gaussian noise (None: no shot noise).
    receptors: types of receptor: "rgb" (three channels, red, green, blue), "lms" (human cones), "honeybee", "goldfish",
        wavelengths of the pigments' peaks [nm], or `Receptors`, which can be a mosaic. The field then contains
        `Receptors`.
    waveguide: rhabdom of each receptor, in the middle of its square and pointing at the pupil's centre. It accepts
        light in modes (None: receptors absorb all light on their square).
    microvilli: directions and dichroic ratios of the receptors' microvilli: one `Microvilli` for all, or rows of them,
        repeated over the retina from its top left corner. Azimuths are in the visual field, from right upwards,
        perpendicular to the ray through the pupil's centre. Microvilli affect only polarised scenes (None: receptors
        are insensitive to polarisation).
    tolerance: relative L2 error of the PSF, and signal error, relative to white's, of all other automatic choices.
    dtype: "float32" or "float64", of PSF, kernel and signals.

    All parameters of the pupil, fov_deg and distances z may be Dr.Jit arrays that carry derivatives. Results that
    depend on them are Dr.Jit tensors; all others are NumPy arrays.

    Raises:
        ValueError: names argument, value and valid range.
        AccuracyError: microvilli behind a pupil whose rays are too steep for the tolerance.
    """

    @property
    def white_signal(self) -> Scalar:
        """Signal of a receptor that sees white everywhere, mean over types: the throughput or the waveguides' share."""
        if self.waveguide is None:
            return self.throughput
        return number(self.aperture_throughput) * self._guided_share

    @cached_property
    def _guided_share(self) -> float:
        return white_share(plain(self.kernel(1)), self.spectral_bands)

    def psf(self, z: Scalar = math.inf) -> PSFResult:
        """Return the PSF on the retina (sensor orientation) of a point at distance z [m] along the axis.

        The point lies in the viewing direction of the patch, and the PSF covers the kernel's window. The perfect lens
        has one sample with all power.

        Raises:
            AccuracyError: see `optics.psf`.
        """
        positive("z", z, infinite=True, carried=True)
        if self.pupil is None:
            return perfect_psf(self._retina(1), self.widest_pupil / 2)
        return retinal_psf(self.pupil, self._retina(4), z, tangents(self.eccentricity_deg))

    def kernel(
        self, samples_per_receptor: int, z: Scalar = math.inf, direction_deg: tuple[float, float] | None = None
    ) -> np.ndarray | Array:
        """Return the receptive kernel (band, ky, kx), in visual-field orientation, ky and kx odd.

        It is the PSF integrated over square cells of pitch / samples_per_receptor and turned by 180°.

        z: distance of the scene along the axis [m].
        direction_deg: direction (right, up) of the light from the axis (None: the patch's eccentricity). The centre
            cell is its geometric image.

        The sum is the fraction of the pupil's power that lands inside. The window is wide enough to lose less than the
        tolerance (limits: see `receptive_field`). The perfect lens has the 1 x 1 kernel 1. If light comes from the
        cells' centres, signals are a² Σ_b weights[c, b] (kernel_b ⊗ radiance_b), averaged over receptors. `see` takes
        it from all over the cells (see `sight`).

        With waveguides the kernel is the share that a receptor accepts from all over each cell around its direction. It
        is not averaged over the receptor; ky and kx are even if samples_per_receptor is. The sum is relative to a
        square that absorbs all light.

        Raises:
            AccuracyError: see `optics.psf`.
        """
        positive("z", z, infinite=True, carried=True)
        asked = self.eccentricity_deg if direction_deg is None else direction("direction_deg", direction_deg)
        retina = self._retina(whole("samples_per_receptor", samples_per_receptor, 1, 64))
        return to_user(receptor_kernel(self, retina, z, tangents(asked), self.waveguide is not None))

    def _retina(self, samples_per_receptor: int) -> Retina:
        cell = self.receptor_pitch / samples_per_receptor
        return Retina(self.retina_distance, self.spectral_bands.wavelengths, cell, self.tolerance, self.dtype)

    def chosen_bands(self) -> SpectralBands:
        """Return the fewest bands that keep a receptor's predicted error within the tolerance."""
        large = self.receptor_pitch / CELLS_FOR_BANDS
        retina = Retina(self.retina_distance, np.empty(0), large, self.tolerance, self.dtype)
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
        """Compute the kernels for a scene in depth and over the field of view.

        Printing them shows the choices with reasons.

        z: distances [m] that occur: one, or an array, whose nearest and farthest count.
        depth_layers: number of kernels between nearest and farthest, evenly spaced in 1/z, or "auto": the fewest within
            the tolerance.
        field_zones: number of kernels across the field's width, or "auto". With 1 the kernel on the axis serves the
            whole retina.
        tolerance: error of a receptor's signal, in units of white's, for any scene at most as bright as white (None:
            the eye's).
        light_from: "cells" is exact for images whose radiance is constant within each cell. "centres" suits cells that
            contain means of finer detail, such as rendered ones: all light of a cell comes from its centre. Its error
            is then less than half as large, O(samples_per_receptor^-2).

        Raises:
            ValueError: names argument, value and valid range.
            AccuracyError: see `optics.psf`, or the tolerance needs more kernels than the limit.
        """
        within = self.tolerance if tolerance is None else in_range("tolerance", tolerance, 1e-6, 0.5)
        s = whole("samples_per_receptor", samples_per_receptor, 1, 64)
        from_cell = one_of("light_from", light_from, LIGHT_FROM) == LIGHT_FROM[0]
        wide, counts = self.sensor_width / (2 * number(self.sensor_distance)), (depth_layers, field_zones)
        (aside, below), high = tangents(self.eccentricity_deg), wide * self.resolution[0] / self.resolution[1]

        def kernel_at(distance: Scalar, right: float, down: float) -> Array:
            place = aside + right * wide, below + down * high
            return with_centre(receptor_kernel(self, self._retina(s), distance, place, from_cell))

        def white() -> float:
            return number(self.white_signal) / number(self.aperture_throughput)

        return prepare(kernel_at, self.resolution, s, z, counts, within, averaged=self.waveguide is None, white=white)

    def see(
        self,
        radiance: np.ndarray,
        samples_per_receptor: int,
        rng: np.random.Generator | None = None,
        z: Scalar = math.inf,
        sight: KernelBank | None = None,
        polarization: Any = None,
    ) -> np.ndarray | Array:
        """Return the signals (channel, h, w) of a scene in the tangent plane, by convolution (the reference).

        radiance: (band, Y, X), constant within each cell of pitch / samples_per_receptor (alternative: `sight`'s
            light_from), centred on the axis, at least h s x w s cells and larger by even numbers; dark outside.
        rng: None for signals without noise. Noise carries no derivative.
        z: distance of the scene along the axis [m], a number or one per cell (Y, X).
        sight: kernels from `Eye.sight` with the same samples_per_receptor; None computes them. Objects outside the
            range of distances are rendered with the kernels of the nearest or farthest distance.
        polarization: for an eye with microvilli, (degree, angle_deg) of the light: its degree of linear polarisation in
            [0, 1], and the angle of its field, from right upwards. Each is a number, (band,), (Y, X) or (band, Y, X).
            None: unpolarised or circularly polarised, which microvilli do not distinguish.

        Raises:
            ValueError: radiance of another shape, or not finite; polarised light for receptors without microvilli.
        """
        s = whole("samples_per_receptor", samples_per_receptor, 1, 64)
        if rng is not None:
            of_kind("rng", rng, np.random.Generator, "np.random.default_rng(0), or None for no noise")
        shape = self.resolution[0] * s, self.resolution[1] * s
        scene = radiance_cube(radiance, self.bands, shape)
        centred(scene, shape)
        parts = taken_by(self.microvilli, self.resolution, scene, polarization)
        bank = self.sight(s, z) if sight is None else of_kind("sight", sight, KernelBank, "eye.sight(4)")
        bank.check(shape, self.bands, averaged=self.waveguide is None)
        found = signals(self, parts, bank, s, z)
        return to_user(found if rng is None else with_noise(self, found, rng))

    def in_bands(self, radiance: Any) -> np.ndarray:
        """Convert a spectral radiance to this eye's bands (band,), for `see`.

        Each receptor type then has the correct quantum catch if there are at least as many bands as types. A band may
        be negative; see `SpectralBands.band_values`.
        """
        return self.spectral_bands.band_values(radiance, self.receptors)

    def describe(self, z: Scalar = math.inf) -> Description:
        """Table of the eye's limits: see `summary.Description`."""
        return describe(self, number(self.white_signal), self.psf(z), partial(self.kernel, z=z))
