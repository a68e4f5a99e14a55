"""Costs of optimisation: roughness, modes, pixels and distances

How long does a step of a lens design take, and which error does its PSF have? One step is a PSF with its gradient with
respect to all heights, pixels or Zernike coefficients. At a tolerance of 0.01, a step takes 5 to 18 ms, or 36 ms for 48
PSFs, with an error of at most 1.0e-3. A matrix Fourier transform without a predicted error takes 0.4 to 1.0 ms, or 8 ms
for 48 PSFs, for an error of at most 0.01.

**Method.** The pupils have a radius of 1 mm, a focal length of 10 mm (f/5), and one of three kinds of design
parameters: a map of heights, pixels of constant height, or Zernike coefficients. A map of heights is a smooth map plus
random deviations with the stated standard deviation ("noise"). A PSF has 65 x 65 samples with a pitch of 1.4 µm at
550 nm. The last design has sources at 16 distances and three wavelengths, computed in one call. `optics.torch.psf`
plans, computes and checks each PSF in the measured time, and each pupil is new. For comparison, a matrix Fourier
transform in plain PyTorch computes the same PSFs with 24 to 192 samples across the pupil. All of its matrices are
prepared before timing. It plans nothing and predicts no error, so its number of samples must be known in advance.

**Table.** The times are CPU times of one thread, medians over seven new pupils after a first one that compiles kernels.
The gradient is that of the mean square of the PSFs, and its time includes the PSFs. The error is the relative L2
distance from a direct sum of the first Rayleigh-Sommerfeld integral over 384 x 384 samples of the pupil, at every
fourth sample of the PSF along each axis. Of the 16 distances, only the first and the last are compared. "Same error" is
the time of the plain transform, with gradient, for the smallest number of samples whose error does not exceed that of
`optics`. "In tolerance" is its time for the smallest number of samples whose error is at most 0.01. A dash means that
no number of samples is sufficient.

**Limits.** The machine was idle during the measurement. In two other runs on the same day, steps took up to 1.6 times
as long: 24 ms for 128 x 128 heights, and 18 ms for 128 x 128 pixels. Compare only ratios within the table. The
direction sines of the plain transform are approximations, so its error cannot fall below 3e-4 to 5e-3, depending on the
design.

    python -m validation.peers.optimisation_costs [--repeated N] [--out DIR] [--docs DIR]
"""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from optics.torch import psf
from validation.pages.page import Page, parser
from validation.pages.work_precision_chart import MUTED, OURS, OURS_TOO, Curve, draw_work_precision
from validation.peers.design_cases import DX, EVERY, FOCUS, Design, N, designs, direct_sum, matrix_transform
from validation.reference import relative_l2

__all__ = ["Point", "design_points", "table"]

TOLERANCES, STATED = (3e-2, 1e-2, 3e-3), 1e-2
SAMPLES = (24, 32, 48, 64, 96, 128, 192)
VIEW = {"dx": DX, "shape": (N, N)}

Images = Callable[[torch.Tensor], torch.Tensor]


@dataclass(frozen=True)
class Point:
    """CPU times [ms] of a design's PSFs, without and with their gradient, and their largest relative L2 error.

    setting: tolerance of `optics`, or the number of samples of the plain transform.
    """

    ours: bool
    setting: float
    forward: float
    gradient: float
    error: float


def design_points(design: Design, repeated: int) -> list[Point]:
    """Return points of `optics` and of the plain transform for a design."""
    rng = np.random.default_rng(1)
    pupils = [torch.tensor(design.numbers(rng)) for _ in range(repeated + 1)]
    ends = sorted({0, len(design.distances) - 1})
    known = np.stack([direct_sum(design, pupils[1].numpy(), design.distances[end]) for end in ends])

    def point(ours: bool, setting: float, images: Images) -> Point:
        found = images(pupils[1]).detach().numpy()[ends, ..., ::EVERY, ::EVERY]
        error = max(relative_l2(one, exact) for one, exact in zip(found, known, strict=True))
        times = [_times(images, numbers) for numbers in pupils]
        return Point(ours, setting, *(statistics.median(column) for column in zip(*times[1:], strict=True)), error)

    points = [point(True, tolerance, _images(design, tolerance)) for tolerance in TOLERANCES]
    return points + [point(False, count, matrix_transform(design, count)) for count in SAMPLES]


def _images(design: Design, tolerance: float) -> Images:
    def images(numbers: torch.Tensor) -> torch.Tensor:
        return psf(
            design.pupil(numbers), design.wavelengths, FOCUS, list(design.distances), tolerance=tolerance, **VIEW
        )

    return images


def _times(images: Images, numbers: torch.Tensor) -> tuple[float, float]:
    """Return the CPU times [ms] of PSFs, and of PSFs with their gradient."""
    start = time.process_time()
    images(numbers)
    middle = time.process_time()
    parameters = numbers.clone().requires_grad_()
    images(parameters).square().mean().backward()
    return 1e3 * (middle - start), 1e3 * (time.process_time() - middle)


def least(points: Sequence[Point], error: float) -> Point | None:
    """Return the plain transform with the fewest samples whose error is at most `error`; None if there is none."""
    return next((point for point in points if not point.ours and point.error <= error), None)


def table(found: dict[str, list[Point]]) -> str:
    """Return the table for the stated tolerance."""
    head = (
        f"{'':<36}{'optics at a tolerance of 0.01':>32}   {'plain PyTorch, with gradient':>30}\n{'design':<36}"
        f"{'psf [ms]':>10}{'gradient':>11}{'error':>11}   {'same error [ms]':>16}{'in tolerance':>14}"
    )
    lines = []
    for name, points in found.items():
        own = _stated(points)
        plain = ["-" if one is None else f"{one.gradient:.1f}" for one in map(least, [points] * 2, (own.error, STATED))]
        times = f"{own.forward:>10.1f}{own.gradient:>11.1f}{own.error:>11.1e}"
        lines.append(f"{name:<36}{times}   {plain[0]:>16}{plain[1]:>14}")
    return "\n".join([head, *lines])


def _stated(points: Sequence[Point]) -> Point:
    return next(point for point in points if point.ours and point.setting == STATED)


def broken_bounds(found: dict[str, list[Point]]) -> list[str]:
    """Return a line for each error above its tolerance."""
    return [
        f"{name}: error {point.error:.1e} at a tolerance of {point.setting:g}"
        for name, points in found.items()
        for point in points
        if point.ours and not point.error <= point.setting
    ]


def draw(path: Path, found: dict[str, list[Point]]) -> None:
    """Draw error against time, a pair of axes for each design."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    columns = min(3, len(found))
    rows = -(-len(found) // columns)
    figure, grid = plt.subplots(rows, columns, figsize=(5.6 * columns, 3.2 * rows), layout="constrained", squeeze=False)
    for axes in grid.flat[len(found) :]:
        axes.remove()
    for axes, (name, points) in zip(grid.flat, found.items(), strict=False):
        curves = []
        for ours, code, colours in ((True, "optics", (OURS_TOO, OURS)), (False, "plain", (MUTED, MUTED))):
            own = [point for point in points if point.ours == ours]
            errors = [point.error for point in own]
            curves.append(Curve(f"{code}, PSF", [point.forward / 1e3 for point in own], errors, colours[0]))
            curves.append(Curve(f"{code}, gradient", [point.gradient / 1e3 for point in own], errors, colours[1]))
        draw_work_precision(axes, curves, title=name)
    figure.savefig(path, dpi=100)
    plt.close(figure)


def main() -> int:
    import drjit as dr

    options = parser(__doc__)
    options.add_argument("--repeated", type=int, default=7, help="number of pupils for the median of times")
    chosen = options.parse_args()
    dr.set_thread_count(1)
    torch.set_num_threads(1)
    found = {design.name: design_points(design, chosen.repeated) for design in designs()}
    page = Page("optimisation_costs", __doc__, table(found), broken_bounds(found))
    return page.publish(chosen, lambda path: draw(path, found))


if __name__ == "__main__":
    sys.exit(main())
