"""Plans with predicted errors, and the error that is raised if no method meets a tolerance."""

from __future__ import annotations

import math
from dataclasses import dataclass

__all__ = [
    "FLOAT_NOISE",
    "MOST_BYTES",
    "MOST_SAMPLES",
    "MOST_SECONDS",
    "AccuracyError",
    "Option",
    "Plan",
    "above",
    "rounded_up",
    "size_of",
]


# Choice: side of the largest square array in `optics.propagate`. 4096² complex64 numbers take 134 MB, and several such
# arrays exist at the same time.
MOST_SAMPLES = 4096
MOST_BYTES = 4e9  # choice: largest predicted memory of a PSF
MOST_SECONDS = 60.0  # choice: largest predicted time of a PSF


# Rounding error of a method's sums, relative to the root mean square of the field.
FLOAT_NOISE = {"float32": 1e-6, "float64": 3e-13}


STEEP = 1e-2  # choice: a printed plan shows the error of scalar theory if it is above this value, reached at NA 0.16


class AccuracyError(ValueError):
    """The result cannot be computed to the requested accuracy. The message states the reason, and usually a remedy.

    what: description of the problem.
    remedy: settings that would work; omitted unless the caller can change them.
    seconds: predicted time [s] of a sufficient computation, if only a limit on the time prevents it.
    """

    def __init__(self, what: str, remedy: str | None = None, seconds: float | None = None):
        super().__init__(what if remedy is None else f"{what}: {remedy}")
        self.what, self.remedy, self.seconds = what, remedy, seconds


@dataclass(frozen=True)
class Option:
    """One of the compared methods, with its samples, predicted error, predicted time [s] and verdict.

    The verdict is "chosen" or the reason why the method was rejected. Samples and error are as in `Plan`.
    """

    method: str
    samples: tuple[int, int]
    predicted_error: float
    seconds: float
    verdict: str


@dataclass(frozen=True)
class Plan:
    """The chosen method with its samples and predicted error, and the reason for the choice.

    samples: numbers of samples of the pupil along (y, x). If the samples are no grid of rows and columns, the value is
        (number of samples, 1). For the method "hankel", it is (number of radii in the pupil, number of angles in the
        spectrum).
    padding: period of the Fourier transform of the pupil, in samples, divided by the number of samples across the
        pupil. It is 1 for methods without a padded grid of the pupil.
    predicted_error: relative L2 error of the intensity over the window.
    scalar_error: upper bound on the error of scalar theory, for light of any polarisation. It depends on the steepest
        ray and adds to `predicted_error`. All methods of `optics.psf` have this error; only `optics.vector_focus`
        avoids it. The bound is valid for windows that contain the brightest point of the light, but not for windows
        that are dark everywhere.
    why: reason for the choice, in words.
    seconds: predicted time [s] of a call with compiled kernels on two cores; 0 without a prediction.
    options: all methods that were compared.
    derivative_error: upper bound of the relative L2 error of derivatives, for a random functional of the PSF. None: the
        PSF carries no derivatives, or the method is an approximation that predicts no error of them.
    """

    method: str
    samples: tuple[int, int]
    dtype: str
    predicted_error: float
    why: str
    seconds: float = 0.0
    options: tuple[Option, ...] = ()
    padding: float = 1.0
    scalar_error: float = 0.0
    derivative_error: float | None = None

    def __str__(self) -> str:
        rows = {
            "method": self.method,
            "samples": _size(self.samples),
            "padding": f"{self.padding:.2f}",
            "dtype": self.dtype,
            "predicted error": f"{self.predicted_error:.1e}",
            **({} if self.derivative_error is None else {"derivatives": f"error up to {self.derivative_error:.1e}"}),
            **({"scalar theory": f"error up to {self.scalar_error:.2g}"} if self.scalar_error >= STEEP else {}),
            **({"predicted time": f"{self.seconds:.2g} s"} if self.seconds else {}),
            "why": self.why,
        }
        head = [f"{name:<17}{value}" for name, value in rows.items()]
        if not self.options:
            return "\n".join(head)
        others = [
            f"  {option.method:<24}{_size(option.samples):>13}{option.predicted_error:>10.1e}{option.seconds:>9.2g} s"
            f"  {option.verdict}"
            for option in self.options
        ]
        return "\n".join([*head, "compared", *others])


def above(error: float, tolerance: float) -> str:
    """Return an error as text, with enough digits to show that it exceeds a tolerance.

    An error of 0.00108 becomes "0.0011" if the tolerance is 0.001.
    """
    shown = (f"{error:.{digits}g}" for digits in range(1, 17))
    return next((text for text in shown if float(text) > tolerance), f"{error!r}")


def rounded_up(error: float) -> float:
    """Return an error rounded up to one significant digit, for advice on a sufficient tolerance."""
    step = 10.0 ** math.floor(math.log10(error))
    return step * math.ceil(error / step)


def size_of(count: float) -> str:
    """Return a number of bytes as text, such as "1.3 GB"."""
    return f"{count / 1e9:.2g} GB" if count >= 1e8 else f"{count / 1e6:.2g} MB"


def _size(samples: tuple[int, int]) -> str:
    return f"{samples[0]} x {samples[1]}" if samples[1] > 1 else str(samples[0])
