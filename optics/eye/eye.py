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

LIGHT_FROM = ("cells", "centres")  # of the scene


@dataclass(frozen=True)
class Eye(EyeSpec):
    """Pupil, retina and noise. Arrays are in visual-field orientation, row 0 at the top, column 0 on the left.

    pupil: None is the perfect lens: no blur, full throughput.
    resolution: receptors (height, width); square, pitch = sensor_width / width.
    fov_deg: horizontal field of view, in [1e-3, 170], before the eye; the retina lies at f = L / (2 tan(fov/2)), and
        n/n₀ times as far behind a pupil between two media.
    sensor_width: L [m], of the retina, or of a patch of it.
    full_aperture: diameter [m] of the pupil that gathers a throughput of 1; None: L.
    eccentricity_deg: (right, up), the direction in the visual field that the middle of the patch looks in.
    bands: spectral bands, 1 to 64, or "auto": as few as keep a receptor's predicted error within the tolerance; that
        takes PSFs of many bands, so it is for an eye that will be used often. The field then holds what was chosen.
    noise_sigma: standard deviation of a receptor's Gaussian noise, in signal units.
    photon_budget: the light there is; its shot noise comes before the Gaussian noise (None: no shot noise).
    receptors: types of receptor: "rgb" (three channels, red, green, blue), "lms" (human cones), "honeybee", "goldfish",
        wavelengths of pigments' peaks [nm], or `Receptors`, which can be a mosaic. The field then holds `Receptors`.
    waveguide: what receptors are: rhabdoms, each in the middle of its square and pointing at the pupil's centre, which
        take light in modes (None: they absorb all light on the square).
    microvilli: which way those of each receptor run, and how dichroic they are: one `Microvilli` for all, or rows of
        them, repeated over the retina from its top left corner. Azimuths are of the visual field, from right upwards,
        across the ray through the pupil's centre. They matter for polarised scenes alone; signals of unpolarised light
        are what they are without (None: receptors know no polarisation).
    tolerance: relative L2 error asked of the PSF; signal error, relative to white's, of whatever else is chosen.
    dtype: "float32" or "float64", of PSF, kernel and signals.

    Whatever the pupil is made of, fov_deg and distances z may be Dr.Jit arrays that carry derivatives; what comes of
    them is then a Dr.Jit tensor, otherwise a NumPy array.

    Raises:
        ValueError: names argument, value and valid range.
        AccuracyError: microvilli behind a pupil whose rays are too steep for them to the tolerance.
    """

    @property
    def white_signal(self) -> Scalar:
        """Of a receptor that sees white everywhere: the throughput, or what waveguides take of it, mean of types."""
        if self.waveguide is None:
            return self.throughput
        return number(self.aperture_throughput) * self._guided_share

    @cached_property
    def _guided_share(self) -> float:
        return white_share(plain(self.kernel(1)), self.spectral_bands)

    def psf(self, z: Scalar = math.inf) -> PSFResult:
        """PSF on the retina (sensor orientation) of a point at distance z [m] along the axis, in the direction that the
        patch looks in, over the kernel's window. The perfect lens has one sample that holds all power.

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
        """Receptive kernel (band, ky, kx): the PSF integrated over square cells of pitch / samples_per_receptor, in
        visual-field orientation (the PSF turned by 180°), ky and kx odd.

        z: the scene's distance along the axis [m]. direction_deg: (right, up) from the axis where the light comes
        from (None: the patch's eccentricity); the centre cell is its geometric image. The sum is the fraction of the
        pupil's power that lands inside; the window is as wide as it must be to lose less than the tolerance (limits:
        see `receptive_field`). The perfect lens has the 1 x 1 kernel 1. Of light from cells' centres, signals are
        a² Σ_b weights[c, b] (kernel_b ⊗ radiance_b), averaged over receptors; `see` takes it from all over the cells
        (see `sight`).

        Waveguides are not averaged over: of them it is what a receptor takes from all over each cell around its
        direction, ky and kx even where samples_per_receptor is, and the sum is the share of what its square would take.

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
        """As few as keep a receptor's predicted error within the tolerance."""
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
        """Kernels for a scene in depth and over the field of view; printed, it says what was chosen and why.

        z: distances [m] that occur: one, or an array whose nearest and farthest count.
        depth_layers: kernels between nearest and farthest, evenly spaced in 1/z; field_zones: kernels across the
            field's width (1: the axis serves the whole retina). "auto": as few as the tolerance allows.
        tolerance: of a receptor's signal, in units of white's, for any scene no brighter than white (None: the eye's).
        light_from: "cells", exact for pictures, whose radiance is the same all over a cell; "centres" for cells that
            hold means of finer detail, as rendered ones do: every cell's light comes from its centre, which errs less
            than half as much there, by O(samples_per_receptor^-2).

        Raises:
            ValueError: names argument, value and valid range.
            AccuracyError: see `optics.psf`, or the tolerance needs more kernels than any eye has.
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
        """Signals (channel, h, w) of a scene in the tangent plane, by convolution (the reference).

        radiance: (band, Y, X), the same all over each cell of pitch / samples_per_receptor (another reading:
            `sight`'s light_from), centred on the axis, at least h s x w s cells and larger by even numbers; dark
            outside.
        rng: None for signals without noise. Noise carries no derivative.
        z: distance of the scene along the axis [m], a number or one per cell (Y, X).
        sight: the kernels, as `Eye.sight` makes them for these samples_per_receptor; None makes them. What is nearer
            or farther than they were made for is seen as their nearest or farthest.
        polarization: of an eye with microvilli, (degree, angle_deg) of the light: its degree of linear polarisation in
            [0, 1], and the angle of its field, from right upwards. Each is a number, (band,), (Y, X) or (band, Y, X).
            None: unpolarised, or circularly polarised, which is the same to microvilli.

        Raises:
            ValueError: radiance of another shape, or not finite; polarised light for receptors that know none.
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
        """(band,): a spectral radiance in this eye's bands, for `see`: each type of receptor then catches of it what it
        should, if bands are at least as many as types. A band may be negative; see `SpectralBands.of`."""
        return self.spectral_bands.of(radiance, self.receptors)

    def describe(self, z: Scalar = math.inf) -> Description:
        """What limits the eye, as a table: see `summary.Description`."""
        return describe(self, number(self.white_signal), self.psf(z), partial(self.kernel, z=z))
