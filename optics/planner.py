"""Which method, how many samples: the cheapest choice whose predicted error meets the tolerance.

All methods here evaluate the same integral (the angular spectrum of the thin-element field, equal to the first
Rayleigh-Sommerfeld integral); they differ in where they sample it:

- "angular_spectrum": pupil -> spectrum -> sensor plane, both planes within one period. Best at short distance.
- "split_angular_spectrum": exp(ikz cos θ) is split into its paraxial part, whose Fourier transform is known, and the
  rest, whose spectrum is narrow. Period and samples no longer grow with the distance. Exact as well.
- "rayleigh_sommerfeld": the direct sum over edge-fitted nodes; needs no grid, costs nodes x outputs. The reference.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from optics.aperture import EDGE_REACH, SoftDisk
from optics.arguments import in_range
from optics.fourier import fast_length, predicted_seconds
from optics.grid import Grid

__all__ = ["METHODS", "AccuracyError", "Plan", "Problem", "Sampling", "choose"]

METHODS = ("angular_spectrum", "split_angular_spectrum", "rayleigh_sommerfeld")
# Largest transform: 4096² complex64 is 134 MB, and a handful of such arrays live at once.
MOST_SAMPLES = 4096
# Amplitude ripple of the soft aperture and of the spectral taper against the tolerance on intensity: twice for the
# square, and then room, since ripples of neighbouring frequencies add up at the edge of the window.
RIPPLE_PER_TOLERANCE = 0.1
FLOAT_NOISE = {"float32": 1e-6, "float64": 3e-13}  # relative to the field's root mean square, see tests


class AccuracyError(ValueError):
    """Asked for more than any method can give here; the message says what can be had."""


@dataclass(frozen=True)
class Plan:
    """What was chosen, and why.

    samples: (y, x) samples of the pupil's square (nodes, for the direct sum).
    predicted_error: relative L2 error of the intensity over the window.
    """

    method: str
    samples: tuple[int, int]
    dtype: str
    predicted_error: float
    why: str
    seconds: float = 0.0

    def __str__(self) -> str:
        return (
            f"method           {self.method}\nsamples          {self.samples[0]} x {self.samples[1]}\n"
            f"dtype            {self.dtype}\npredicted error  {self.predicted_error:.1e}\n"
            f"predicted time   {self.seconds:.2g} s\nwhy              {self.why}"
        )


@dataclass(frozen=True)
class Problem:
    """One monochromatic propagation from a disk to a window, in numbers.

    radius, distance [m]; wavelength [m] in the medium; window: output grid.
    phase_band: highest spatial frequency [1/m] in the pupil's phase, over the disk and its soft edge.
    widest_band: frequencies beyond it may be dropped (infinite: whatever reaches the window counts).
    """

    radius: float
    wavelength: float
    distance: float
    window: Grid
    phase_band: float
    tolerance: float
    dtype: str = "float32"
    widest_band: float = math.inf

    @property
    def ripple(self) -> float:
        return self.tolerance * RIPPLE_PER_TOLERANCE

    def band(self, margin: float = 0.0) -> float:
        """Highest frequency [1/m] whose light can come within `margin` of the window from anywhere on the disk."""
        reach = (1 + EDGE_REACH) * self.radius + self.window.half_diagonal + margin
        return min(self.widest_band, reach / math.hypot(reach, self.distance) / self.wavelength)


@dataclass(frozen=True)
class Sampling:
    """Everything a propagation needs to know: made by `choose`, read by `propagation`.

    band, taper: the spectrum is kept up to `band` and fades out until band + taper [1/m].
    period: width [m] after which the pupil plane repeats; pupil_samples over it; spectrum_samples of 1/period.
    relay_samples: samples over the period of the field that the split method transforms last.
    """

    method: str
    disk: SoftDisk | None
    band: float
    taper: float
    period: float
    pupil_period: int
    spectrum_samples: int
    output_period: int
    seconds: float

    @property
    def pupil_samples(self) -> int:
        """Samples that hold the soft disk."""
        assert self.disk is not None
        pitch = self.period / self.pupil_period
        return min(self.pupil_period, 2 * math.ceil((self.disk.radius + self.disk.reach) / pitch) + 1)

    @property
    def largest(self) -> int:
        return max(self.pupil_period, self.output_period, self.spectrum_samples)


def choose(problem: Problem, method: str = "auto", most_seconds: float = 60.0) -> tuple[Plan, Sampling]:
    """The cheapest sampling that meets the problem's tolerance, by the named method or by any.

    Raises:
        ValueError: unknown method.
        AccuracyError: nothing within the limits on memory and time meets the tolerance.
    """
    if method not in ("auto", *METHODS):
        raise ValueError(f"method = {method!r}: must be 'auto' or one of {', '.join(METHODS)}")
    in_range("tolerance", problem.tolerance, 1e-12, 0.5)
    floor = 10 * FLOAT_NOISE[problem.dtype]
    if problem.tolerance < floor:
        raise AccuracyError(
            f"tolerance = {problem.tolerance:g}: {problem.dtype} carries {floor:g}"
            + ("; dtype='float64' carries 3e-12" if problem.dtype == "float32" else "")
        )
    asked = METHODS if method == "auto" else (method,)
    options = [option for name in asked for option in _options(problem, name)]
    fitting = [option for option in options if option.largest <= MOST_SAMPLES and option.seconds <= most_seconds]
    if not fitting:
        raise AccuracyError(_refusal(problem, options, most_seconds))
    best = min(fitting, key=lambda option: option.seconds)
    return _plan(problem, best, options), best


def _options(problem: Problem, method: str) -> list[Sampling]:
    if method == "rayleigh_sommerfeld":
        return [_direct_sum(problem)]
    make = _whole if method == "angular_spectrum" else _split
    size = problem.radius + problem.window.half_diagonal
    tapers = [Taper.of(problem, share * size) for share in (0.03, 0.06, 0.12, 0.25, 0.5, 1.0, 2.0, 4.0)]
    return [make(problem, taper) for taper in tapers if taper.sine < 0.9995]


@dataclass(frozen=True)
class Taper:
    """Where the spectrum fades out: from `band` over `width` [1/m], which blurs the field by `blur` [m].

    The fading is an error function whose derivative's transform falls to the ripple within the blur. What it removes
    must therefore land at least that far outside the window.
    """

    band: float
    width: float
    blur: float
    sine: float
    tangent: float

    @classmethod
    def of(cls, problem: Problem, blur: float) -> Taper:
        band, width = problem.band(blur), 2 * math.log(1 / problem.ripple) / (math.pi * blur)
        sine = (band + width) * problem.wavelength
        return cls(band, width, blur, sine, sine / math.sqrt(max(1 - sine * sine, 1e-12)))

    @property
    def end(self) -> float:
        return self.band + self.width


def _soft_disk(problem: Problem, edge: float) -> SoftDisk:
    widest = EDGE_REACH * problem.radius
    return SoftDisk.cheapest(problem.radius, edge + problem.phase_band, problem.ripple, widest)


def _whole(problem: Problem, taper: Taper) -> Sampling:
    """One period holds the window and all light that could wrap around into it."""
    disk = _soft_disk(problem, taper.end)
    beam = problem.radius + disk.reach + taper.blur + problem.distance * taper.tangent
    pitch = problem.window.dx
    output_period = fast_length(max(problem.window.half_width + beam, 2 * (problem.radius + disk.reach)) / pitch)
    period = output_period * pitch
    pupil_period = fast_length(period * (taper.end + disk.stopband + problem.phase_band))
    return _costed("angular_spectrum", disk, taper, period, pupil_period, output_period, problem)


def _split(problem: Problem, taper: Taper) -> Sampling:
    """One period holds the pupil and the non-paraxial walk-off z (tan θ - sin θ)."""
    disk = _soft_disk(problem, taper.end)
    relay = problem.radius + disk.reach + taper.blur + problem.distance * (taper.tangent - taper.sine)
    period = 2 * relay
    pupil_period = fast_length(period * (taper.end + disk.stopband + problem.phase_band))
    reached = problem.window.half_width + relay + problem.distance * taper.sine
    relay_period = fast_length(period * reached / (problem.wavelength * problem.distance))
    return _costed("split_angular_spectrum", disk, taper, period, pupil_period, relay_period, problem)


def _costed(
    method: str, disk: SoftDisk, taper: Taper, period: float, pupil_period: int, output_period: int, problem: Problem
) -> Sampling:
    spectrum = 2 * math.ceil(taper.end * period) + 1
    sampling = Sampling(method, disk, taper.band, taper.width, period, pupil_period, spectrum, output_period, 0.0)
    pupil, square, window = (sampling.pupil_samples,) * 2, (spectrum, spectrum), problem.window.shape
    seconds = predicted_seconds(pupil, sampling.pupil_period, square)
    if sampling.method == "angular_spectrum":
        seconds += predicted_seconds(square, sampling.output_period, window)
    else:
        relay = (sampling.output_period,) * 2
        seconds += predicted_seconds(square, sampling.output_period, relay)
        seconds += predicted_seconds(relay, 0.5, window)  # no whole period: a matrix
    elementwise = pupil[0] ** 2 * 6e-8 + spectrum**2 * 2e-8
    return replace(sampling, seconds=seconds + elementwise + 2e-3)


def _direct_sum(problem: Problem) -> Sampling:
    """Gauss-Legendre nodes in radius, trapezoid in angle: enough for the cycles that phase and path turn through."""
    cycles = problem.radius * (problem.phase_band + problem.band())
    digits = -math.log10(problem.ripple)
    radial = math.ceil(1.75 * cycles + 2 * digits + 4)
    angular = 2 * math.ceil(math.pi * cycles + 1.5 * digits * (1 + cycles ** (1 / 3)) + 4)
    pairs = radial * angular * problem.window.shape[0] * problem.window.shape[1]
    return Sampling("rayleigh_sommerfeld", None, problem.band(), 0.0, 0.0, radial, 0, angular, pairs / 6e8 + 5e-3)


def _plan(problem: Problem, best: Sampling, options: list[Sampling]) -> Plan:
    cheapest: dict[str, Sampling] = {}
    for option in options:
        if option.method not in cheapest or option.seconds < cheapest[option.method].seconds:
            cheapest[option.method] = option
    others = [f"{o.method} {o.seconds:.2g} s" for o in cheapest.values() if o.method != best.method]
    fresnel = problem.radius**2 / (problem.wavelength * problem.distance)
    why = (
        f"Fresnel number {fresnel:.3g}, sine of the steepest ray kept {problem.band() * problem.wavelength:.2g}; "
        f"cheapest at {best.seconds:.2g} s" + (f" ({', '.join(others)})" if others else "")
    )
    direct = best.method == "rayleigh_sommerfeld"
    samples = (best.pupil_period, best.output_period) if direct else (best.pupil_samples,) * 2
    error = problem.tolerance / 2 + FLOAT_NOISE[problem.dtype]
    return Plan(best.method, samples, problem.dtype, error, why, best.seconds)


def _refusal(problem: Problem, options: list[Sampling], most_seconds: float) -> str:
    if not options:
        return (
            f"the window reaches rays at {problem.band() * problem.wavelength:.4f} of grazing incidence, where no "
            f"sampled spectrum converges: shrink the window ({2 * problem.window.half_width:.3g} m at distance "
            f"{problem.distance:.3g} m) or ask for method='rayleigh_sommerfeld'"
        )
    least = min((option for option in options), key=lambda option: option.seconds)
    return (
        f"tolerance = {problem.tolerance:g} needs {least.largest} samples across by {least.method} (about "
        f"{least.seconds:.2g} s), the limits are {MOST_SAMPLES} and {most_seconds:g} s: widen the tolerance, shrink "
        f"the window ({2 * problem.window.half_width:.3g} m) or flatten the relief"
    )
