"""Times and errors of single PSFs and of their gradients, for the design of pupils.

Each pupil is new: its PSF is planned, computed and checked in the measured time. The yardstick is a matrix Fourier
transform in NumPy, from direction sines to the window, with a grey edge. It plans nothing and predicts no error. The
number of its samples is chosen in advance such that its error is near the tolerance.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

import optics
from validation.reference import relative_l2

__all__ = ["Design", "DesignRow", "design_rows", "design_table", "designs"]

WAVE, RADIUS, FOCUS, N, DX = 550e-9, 1e-3, 10e-3, 65, 1.4e-6
TOLERANCE, EXACT = 1e-2, 2e-4
REPEATED = 3  # new pupils per design
SUBSAMPLES = 4  # subsamples of a cell along an axis, for the grey edge of the yardstick


@dataclass(frozen=True)
class Design:
    """A kind of pupil.

    numbers: function that returns new design parameters.
    pupil: function that returns the pupil with these parameters, NumPy or Dr.Jit.
    samples: samples of the yardstick across the pupil.
    """

    name: str
    numbers: Callable[[np.random.Generator], np.ndarray]
    pupil: Callable[[object], optics.Pupil]
    samples: int


@dataclass(frozen=True)
class DesignRow:
    """CPU times [ms] and errors of a PSF, without and with its gradient, and of the yardstick.

    All values are medians over new pupils.
    """

    name: str
    forward: float
    gradient: float
    predicted: float
    error: float
    yardstick: float
    yardstick_error: float


def designs() -> Iterator[Design]:
    for count, rough, samples in (
        (32, 0.0, 32), (32, 20e-9, 48), (32, 60e-9, 64), (32, 150e-9, 96), (128, 50e-9, 96),
    ):  # fmt: skip
        name = f"{count} x {count} heights, {1e9 * rough:.0f} nm of noise"
        yield Design(name, _heights(count, rough), lambda heights: _pupil(height=optics.HeightMap(heights)), samples)
    for order in (4, 9):
        count = (order + 1) * (order + 2) // 2
        yield Design(f"{count} Zernike modes", _modes(count), lambda modes: _pupil(wavefront=optics.Zernike(modes)), 96)


def _pupil(**bent: object) -> optics.Pupil:
    return optics.Pupil(RADIUS, thin_lens_focal_length=FOCUS, **bent)


def _heights(count: int, rough: float) -> Callable[[np.random.Generator], np.ndarray]:
    x = (np.arange(count) + 0.5) / count * 2 - 1
    smooth = 0.3e-6 * (x**3 - x[:, None] ** 2 * x + 0.5 * np.cos(3 * x[:, None]))
    return lambda rng: smooth * rng.uniform(0.5, 1) + rough * rng.standard_normal((count, count))


def _modes(count: int) -> Callable[[np.random.Generator], np.ndarray]:
    return lambda rng: 0.1 * rng.standard_normal(count) / np.sqrt(np.arange(1, count + 1))


def design_rows(repeated: int = REPEATED) -> list[DesignRow]:
    """Return a row for each design."""
    return [_row(design, repeated) for design in designs()]


def _row(design: Design, repeated: int) -> DesignRow:
    rng, found = np.random.default_rng(1), []
    for _ in range(repeated + 1):  # the first pupil compiles kernels
        numbers = design.numbers(rng)
        pupil = design.pupil(numbers)
        forward, result = _timed(lambda pupil=pupil: _psf(pupil, TOLERANCE))
        gradient, _ = _timed(lambda numbers=numbers: _gradient(design, numbers))
        plain, image = _timed(lambda pupil=pupil: matrix_transform(pupil, design.samples))
        exact = _psf(pupil, EXACT).psf[0]
        errors = relative_l2(result.psf[0], exact), relative_l2(image, exact)
        found.append((forward, gradient, result.plan.predicted_error, errors[0], plain, errors[1]))
    return DesignRow(design.name, *(statistics.median(column) for column in zip(*found[1:], strict=True)))


def _timed(compute: Callable[[], object]) -> tuple[float, object]:
    """Return the CPU time [ms] and the result."""
    start = time.process_time()
    result = compute()
    return 1e3 * (time.process_time() - start), result


def _psf(pupil: optics.Pupil, tolerance: float) -> optics.PSFResult:
    result = optics.psf(pupil, [WAVE], FOCUS, dx=DX, shape=(N, N), tolerance=tolerance)
    assert result.psf.shape == (1, N, N)  # reading the PSF completes its computation
    return result


def _gradient(design: Design, numbers: np.ndarray) -> np.ndarray:
    """Return the gradient of the mean square of the PSF with respect to all design parameters."""
    import drjit as dr
    from drjit.llvm.ad import Float64, TensorXf64

    inputs = TensorXf64(numbers) if numbers.ndim > 1 else Float64(numbers)
    dr.enable_grad(inputs)
    dr.backward(dr.mean(dr.square(_psf(design.pupil(inputs), TOLERANCE).tensor.array)))
    return np.asarray(dr.grad(inputs).numpy())


def matrix_transform(pupil: optics.Pupil, count: int) -> np.ndarray:
    """Return the PSF by the yardstick, (y, x), with `count` samples across the pupil."""
    pitch = 2 * RADIUS / count
    at = (np.arange(count) - (count - 1) / 2) * pitch
    finer = (np.arange(SUBSAMPLES) - (SUBSAMPLES - 1) / 2) / SUBSAMPLES * pitch
    parts = np.add.outer(at, finer).ravel()
    inside = (parts[:, None] ** 2 + parts**2 <= RADIUS**2).reshape(count, SUBSAMPLES, count, SUBSAMPLES).mean((1, 3))
    x, y = at[None, :], at[:, None]
    distance = np.sqrt(x * x + y * y + FOCUS**2)
    waves = (pupil.path(x, y, WAVE, optics.PointSource()) + distance) / WAVE
    field = inside * FOCUS / distance**2 / WAVE * pitch**2 * np.exp(2j * np.pi * waves)
    window = (np.arange(N) - N // 2) * DX
    kernel = np.exp(-2j * np.pi / WAVE * np.outer(window, at / np.sqrt(at**2 + RADIUS**2 / 4 + FOCUS**2)))
    found: np.ndarray = np.abs(kernel @ field @ kernel.T) ** 2 / pupil.area
    return found


def design_table(rows: list[DesignRow]) -> str:
    head = (
        f"{'design (tolerance 0.01)':<32}{'psf [ms]':>10}{'gradient':>10}{'predicted':>11}{'error':>9}"
        f"{'matrix DFT [ms]':>17}{'error':>9}"
    )
    lines = [
        f"{row.name:<32}{row.forward:>10.1f}{row.gradient:>10.1f}{row.predicted:>11.1e}{row.error:>9.1e}"
        f"{row.yardstick:>17.2f}{row.yardstick_error:>9.1e}"
        for row in rows
    ]
    return "\n".join([head, *lines])
