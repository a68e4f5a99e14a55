"""Table of the properties that limit an eye's vision, such as diffraction, the spacing of receptors, and noise."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from optics.eye.eye_spec import EyeSpec
from optics.numerics.accuracy import AccuracyError, Plan
from optics.numerics.autodiff import Array, Scalar, number, plain
from optics.point_spread.contrast import image_quality, mtf
from optics.point_spread.psf_result import PSFResult
from optics.point_spread.strehl import strehl_ratio
from optics.spectra.spectrum import daylight

__all__ = ["Description", "daylight_psf", "describe", "noise_of"]

LIMITS = ("diffraction", "sampling", "noise")  # limits of acuity
FREQUENCIES = 513  # choice: number of frequencies up to the cut-off at which the MTF is compared with the noise
CELLS_ACROSS, MOST_CELLS = 8, 64  # choice: cells of a kernel across a waveguide, and most cells along a receptor's side
FINER = 16  # choice: points per sample of the PSF at which a receptor's angular sensitivity is evaluated


Kernels = Callable[[int], Array | np.ndarray]  # cells per receptor -> kernel (band, y, x)


@dataclass(frozen=True)
class Description:
    """Limits of an eye in white daylight, at the field's centre. Frequencies are in cycles per degree of visual angle.

    relative_aperture: a, the pupil's diameter divided by the diameter of the eye's widest pupil.
    throughput: a², times the open fraction of the aperture's disk, times the mask's transmission.
    f_number: focal length f, divided by the pupil's diameter. A distance x on the retina corresponds to the angle x/f,
        so f is n₀/n times the distance to the retina, with the indices n behind and n₀ before the pupil. The brightness
        of the image is proportional to 1/f_number².
    wavelength: mean wavelength [m] of daylight, weighted by the receptors.
    diffraction_cpd: cut-off frequency of diffraction, 2 sin θ/λ on the retina, with the cone of light's half angle θ.
    sampling_cpd: Nyquist frequency of the receptors, 1/(2 Δφ), horizontally.
    noise_cpd: lowest frequency with a contrast below `noise`/`white_signal`, or the cut-off frequency if there is none.
    acuity_cpd: horizontal acuity, the smallest of these three frequencies; NaN if one is unknown.
    acuity_vertical_cpd: vertical acuity, with the Nyquist frequency of the receptors' rows.
    binding: name of the smallest known limit: "diffraction", "sampling" or "noise".
    strehl_ratio: Strehl ratio of the band nearest `wavelength`.
    image_quality: `white_signal` times the mean of max(contrast - `noise`/`white_signal`, 0) up to `sampling_cpd`.
    noise: standard deviation of the signal of a receptor that sees white, from all sources of noise.
    photons: photons that a receptor that sees white absorbs per integration time, mean of channels; None if unknown.
    acceptance_angle_deg: full width at half maximum of a receptor's angular sensitivity, horizontally.
    interommatidial_angle_deg: angle Δφ between horizontally neighbouring receptors.
    interommatidial_vertical_deg: angle between vertically neighbouring receptors.
    interommatidial_range_deg: smallest and largest angle between receptors over the whole eye, horizontally and
        vertically, ((smallest, largest), (smallest, largest)). None: all receptors have the same size on the retina.
    plan: plan of the PSF of the least accurate band.
    white_signal: signal of a receptor that sees white: the throughput, reduced by the losses of waveguides.
    unknown: one line, with the reason, for each measure that is NaN because the PSF is not accurate enough.
    """

    relative_aperture: float
    throughput: float
    f_number: float
    wavelength: float
    diffraction_cpd: float
    sampling_cpd: float
    noise_cpd: float
    strehl_ratio: float
    image_quality: float
    noise: float
    photons: float | None
    acceptance_angle_deg: float
    interommatidial_angle_deg: float
    interommatidial_vertical_deg: float
    plan: Plan
    unknown: tuple[str, ...] = ()
    white_signal: float = math.nan
    interommatidial_range_deg: tuple[tuple[float, float], tuple[float, float]] | None = None

    @property
    def _limits(self) -> dict[str, float]:
        limits = zip(LIMITS, (self.diffraction_cpd, self.sampling_cpd, self.noise_cpd), strict=True)
        return {name: limit for name, limit in limits if not math.isnan(limit)}

    @property
    def binding(self) -> str:
        return min(self._limits, key=self._limits.__getitem__)

    @property
    def acuity_cpd(self) -> float:
        return self._limits[self.binding] if len(self._limits) == len(LIMITS) else math.nan

    @property
    def sampling_vertical_cpd(self) -> float:
        return 1 / (2 * self.interommatidial_vertical_deg)

    @property
    def acuity_vertical_cpd(self) -> float:
        return self._vertical_limit if len(self._limits) == len(LIMITS) else math.nan

    @property
    def _vertical_limit(self) -> float:
        return min((self._limits | {"sampling": self.sampling_vertical_cpd}).values())

    def __str__(self) -> str:
        shot = "" if self.photons is None else f", of {self.photons:.3g} photons per receptor"
        bound = "at most " if math.isnan(self.acuity_cpd) else ""
        rows = {
            "aperture": f"a = {self.relative_aperture:.3g}, f/{self.f_number:.3g}, throughput {self.throughput:.3g}",
            "image": f"Strehl ratio {self.strehl_ratio:.3g}, quality {self.image_quality:.3g}",
            "noise": f"{self.noise:.2g} of {self.white_signal:.3g} for white{shot}",
            **{f"limit: {name}": f"{_cycles(limit)}{self._mark(name)}" for name, limit in self._limits.items()},
            "acuity": f"{bound}{_cycles(self._limits[self.binding])}, {self.binding} binds",
            **self._vertical_rows(bound),
            "acceptance": f"{self.acceptance_angle_deg:.3g}°, {self._overlap:.3g} of the angle between receptors",
            "receptors": f"{self.interommatidial_angle_deg:.3g}° apart",
            **self._range_rows(),
            "PSF": f"{self.plan.method}, {self.plan.samples[0]} x {self.plan.samples[1]} samples, "
            f"{self.plan.dtype}, predicted error {self.plan.predicted_error:.1e}",
            **{f"not known ({number})": line for number, line in enumerate(self.unknown, start=1)},
        }
        return "\n".join(f"{name:<20}{value}" for name, value in rows.items())

    def _vertical_rows(self, bound: str) -> dict[str, str]:
        """Return printed rows on vertical acuity, none if receptors are square. `bound` is a text before the acuity."""
        if math.isclose(self.interommatidial_vertical_deg, self.interommatidial_angle_deg, rel_tol=1e-9):
            return {}
        apart = f"rows of receptors {self.interommatidial_vertical_deg:.3g}° apart"
        return {"acuity, vertical": f"{bound}{_cycles(self._vertical_limit)}, {apart}"}

    def _range_rows(self) -> dict[str, str]:
        """Return table rows on the range of receptor spacings over the eye; none if all receptors are alike."""
        if self.interommatidial_range_deg is None:
            return {}
        names = "spacing, horizontal", "spacing, vertical"
        return {
            name: f"{fine:.3g}° to {coarse:.3g}° over the eye, {_cycles(1 / (2 * fine))} at the finest"
            for name, (fine, coarse) in zip(names, self.interommatidial_range_deg, strict=True)
        }

    def _mark(self, name: str) -> str:
        return "  <- binding" if name == self.binding else ""

    @property
    def _overlap(self) -> float:
        return self.acceptance_angle_deg / self.interommatidial_angle_deg


def noise_of(eye: EyeSpec, white_signal: Scalar) -> float:
    """Return the standard deviation of a receptor's signal for white in daylight: receptor noise and photon noise."""
    photons = _photons_of(eye)
    if photons is None:
        return float(eye.noise_sigma)
    light = number(white_signal)
    return math.hypot(eye.noise_sigma, light / math.sqrt(photons * light))


def _photons_of(eye: EyeSpec) -> float | None:
    """Return the photons that a receptor absorbs for a signal of 1, or None if the eye has no `photon_budget`.

    The number is averaged over the types of receptors. It is for the integration time of the receptors' temporal filter
    if the eye has dynamics, and otherwise for the integration time of the budget.
    """
    if eye.photons is None or eye.photon_budget is None:
        return None
    found = float(eye.photons.mean())
    if eye.dynamics is None:
        return found
    return found * 1e-3 * eye.dynamics.integration_ms / eye.photon_budget.integration_time


def describe(eye: EyeSpec, light: float, result: PSFResult, kernel: Kernels) -> Description:
    """Return the limits of an eye's vision, such as its acuity, for a scene at one distance.

    A measure that cannot be computed accurately enough is NaN and has a line in `Description.unknown`.

    light: signal of a receptor that sees white.
    result: PSF for this distance.
    kernel: function that returns the eye's kernel (band, y, x) for the same distance. Its argument is the number of
        cells, the samples of the kernel, along a receptor's side.
    """
    distance = number(eye.sensor_distance)
    white = daylight_psf(eye, result)
    wavelength = float(white.wavelengths[0])
    unknown: list[str] = []
    photons, noise = _photons_of(eye), noise_of(eye, light)
    if eye.pupil is None:
        diffraction, strehl, quality = math.inf, 1.0, max(1 - noise, 0.0)
        noise_limit = math.inf if noise < 1 else 0.0
    else:
        diffraction = float(white.cutoff[0])
        nearest = int(np.argmin(np.abs(result.wavelengths - wavelength)))
        measures: dict[str, Callable[[], float]] = {
            "Strehl ratio": lambda: float(plain(strehl_ratio(result.of_wavelength(nearest)))[0]),
            "image quality": lambda: float(plain(image_quality(white, 1 / (2 * eye.receptor_pitch), light, noise))[0]),
            "limit by noise": lambda: _noise_limit(white, diffraction, noise / light),
        }
        strehl, quality, noise_limit = (_known(name, measure, unknown) for name, measure in measures.items())
    per_degree = math.radians(distance)
    return Description(
        relative_aperture=number(eye.relative_aperture),
        throughput=number(eye.throughput),
        white_signal=light,
        f_number=distance / (2 * result.pupil.radius),
        wavelength=wavelength,
        diffraction_cpd=diffraction * per_degree,
        sampling_cpd=per_degree / (2 * eye.receptor_pitch),
        noise_cpd=noise_limit * per_degree,
        strehl_ratio=strehl,
        image_quality=quality,
        noise=noise,
        photons=None if photons is None else photons * light,
        acceptance_angle_deg=_acceptance(eye, white, kernel) / per_degree,
        interommatidial_angle_deg=eye.receptor_pitch / per_degree,
        interommatidial_vertical_deg=eye.receptor_size[0] / per_degree,
        plan=result.plan,
        unknown=tuple(unknown),
    )


def _known(name: str, measure: Callable[[], float], unknown: list[str]) -> float:
    """Return `measure()`. If this value is not accurate enough, return NaN and add the reason to `unknown`."""
    try:
        return measure()
    except AccuracyError as error:
        # The window of an eye is fixed, but the user can compute a PSF of its pupil over another window.
        remedy = "" if error.remedy is None else f"; of optics.psf(eye.pupil), {error.remedy}"
        unknown.append(f"{name}: {error.what}{remedy}")
        return math.nan


def daylight_psf(eye: EyeSpec, result: PSFResult) -> PSFResult:
    """Return the PSF in white daylight, (1, y, x). Bands are weighted by the mean sensitivity of the channels."""
    worth = eye.spectral_bands.weights.mean(axis=0) * daylight(eye.spectral_bands.wavelengths)
    return result.mean(worth / worth.sum())


def _noise_limit(white: PSFResult, cutoff: float, floor: float) -> float:
    """Return the lowest frequency [1/m] at which the MTF falls to the floor; the cut-off if it never does."""
    frequency = np.linspace(0, cutoff, FREQUENCIES)
    above = mtf(white).profile(frequency)[0] - floor
    drowned = np.flatnonzero(above <= 0)
    if drowned.size == 0 or floor <= 0:
        return cutoff
    at = int(drowned[0])
    if at == 0:
        return 0.0
    share = above[at - 1] / (above[at - 1] - above[at])
    return float(frequency[at - 1] + share * (frequency[at] - frequency[at - 1]))


def _acceptance(eye: EyeSpec, white: PSFResult, kernel: Kernels) -> float:
    """Return the full width [m] at half maximum of a receptor's sensitivity to white daylight, along x.

    The sensitivity is the PSF convolved with the receptor's aperture. If the receptor is a waveguide, the sensitivity
    is the fraction of light that the waveguide accepts from each direction.
    """
    if eye.pupil is None:
        return eye.receptor_pitch
    if eye.waveguide is not None:
        return _guided_acceptance(eye, eye.waveguide.diameter, kernel)
    half_height, half = (side / 2 for side in eye.receptor_size)
    rows = _within(white.y, white.psf[0], white.y, half_height)
    peak = int(np.argmax(_within(white.x, rows.T, white.x, half).max(axis=0)))
    at = np.arange(white.x[0] - half, white.x[-1] + half, white.dx / FINER)
    profile = _within(white.x, rows[peak], at, half)
    above = profile - profile.max() / 2
    first, last = np.flatnonzero(above >= 0)[[0, -1]]
    left, right = above[first] / (above[first] - above[first - 1]), above[last] / (above[last] - above[last + 1])
    return float(last + right - first + left) * white.dx / FINER


def _guided_acceptance(eye: EyeSpec, diameter: float, kernel: Kernels) -> float:
    """Return the full width [m] at half maximum, along x, of the sensitivity of a receptor with a waveguide.

    The sensitivity to white light is computed in steps of a fraction of a receptor. A spline interpolates between them.

    diameter: diameter [m] of the waveguide.
    """
    from scipy.interpolate import CubicSpline

    cells = min(max(4, math.ceil(CELLS_ACROSS * eye.receptor_pitch / diameter)), MOST_CELLS)
    seen = eye.spectral_bands.white_light(plain(kernel(cells))).mean(axis=0)
    row = seen[int(np.argmax(seen.max(axis=1)))]
    curve = CubicSpline(np.arange(len(row)), row)
    at = np.linspace(0, len(row) - 1, FINER * len(row))
    above = np.flatnonzero(curve(at) >= curve(at).max() / 2)
    return float(at[above[-1]] - at[above[0]]) * eye.receptor_pitch / cells


def _within(x: np.ndarray, image: np.ndarray, at: np.ndarray, half: float) -> np.ndarray:
    """Return, for each `at`, the integral from `at - half` to `at + half` of a spline through `image` (x, …)."""
    from scipy.interpolate import CubicSpline

    primitive = CubicSpline(x, image).antiderivative()
    found: np.ndarray = primitive(np.clip(at + half, x[0], x[-1])) - primitive(np.clip(at - half, x[0], x[-1]))
    return found


def _cycles(frequency: float) -> str:
    return f"{frequency:.3g} cycles/degree"
