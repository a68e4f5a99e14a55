"""Cost of operations on this machine, compared with the constants of the cost model (optics/numerics/cost.py)

Each operation is timed at several sizes, warm, and a line is fitted through the medians: seconds per call, and per
sample, entry or pair. Then every method is timed as a whole and compared with the prediction of its plan.

    python -m validation.benchmarks.fit_costs [--repeats N]
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache

import drjit as dr
import numpy as np

import optics
from optics.apertures.circular import Circle
from optics.elements.beam import Beam
from optics.elements.source import PointSource
from optics.methods.hankel import _transform
from optics.methods.rayleigh_sommerfeld import cached_nodes, direct_sum
from optics.numerics import cost
from optics.numerics.array_sum_cost import lines_seconds
from optics.numerics.field import Field
from optics.numerics.fourier import _fft, fourier_sum
from optics.numerics.fourier_matrices import by_whole_matrices
from optics.numerics.grid import Grid
from optics.numerics.interpolation import TAPS
from optics.numerics.matrices import complex_flops
from optics.numerics.precision import Precision, precision
from optics.numerics.radial_profile import RadialProfile

WAVELENGTH, RADIUS, DISTANCE = 550e-9, 50e-6, 1e-3
BEAM = Beam(optics.Pupil(RADIUS, thin_lens_focal_length=DISTANCE), PointSource(), WAVELENGTH, DISTANCE)
METHODS = (
    "hankel",
    "low_rank",
    "far_field",
    "angular_spectrum",
    "split_angular_spectrum",
    "rayleigh_sommerfeld",
    "fresnel",
)


@dataclass(frozen=True)
class Operation:
    """An operation to time: `run(size)` processes `count(size)` units with a predicted time of `seconds` each."""

    name: str
    seconds: float
    sizes: tuple[int, ...]
    count: Callable[[int], float]
    run: Callable[[int], None]


def operations(types: Precision) -> Iterator[Operation]:
    """Yield operations for the constants of the cost model that can be measured separately."""
    flop = 1 / cost.MATMUL_FLOPS[types.dtype]
    yield Operation(
        f"flop of a matrix product, {types.dtype}",
        flop,
        (256, 512, 1024),
        lambda n: int(2 * complex_flops(n**3)),
        lambda n: _dft(n, types),
    )
    yield Operation(
        f"flop of a product of NumPy arrays, {types.dtype}",
        1 / cost.ARRAY_MATMUL_FLOPS[types.dtype],
        (256, 512, 1024),
        lambda n: 16 * n**3,
        lambda n: _array_sum(n, n + 0.5, types),
    )
    yield Operation(
        f"sample in an FFT of NumPy arrays, {types.dtype}",
        lines_seconds(2, 1024, types.dtype) / 1024,
        (256, 512, 1024),
        lambda n: n * n,
        lambda n: _array_sum(n, float(n), types),
    )
    if types.dtype == "float64":
        return
    yield Operation(
        "sample in an FFT", _fft_sample(1024), (256, 512, 1024), lambda n: n * n, lambda n: _fourier(n, types)
    )
    sample = cost.PUPIL_SAMPLE + cost.SOFT_EDGE_SAMPLE
    yield Operation("sample of a pupil", sample, (256, 512, 1024), lambda n: n * n, lambda n: _pupil(n, types))
    pair = 1 / cost.PAIRS_PER_SECOND["float32"]
    yield Operation(
        "pair of the direct sum", pair, (32, 64, 128), lambda n: n * n * _nodes(), lambda n: _direct(n, types)
    )
    yield Operation(
        "pair of a Hankel transform", cost.BESSEL_PAIR, (256, 512, 1024), lambda n: n * n, lambda n: _bessel(n, types)
    )
    yield Operation(
        "sample of a symmetric picture",
        cost.PROFILE_SAMPLE,
        (256, 512, 1024),
        lambda n: n * n,
        lambda n: _profile(n, types),
    )


@lru_cache
def _random(n: int, types: Precision) -> Field:
    rng = np.random.default_rng(0)
    return Field.from_numpy(rng.normal(size=(n, n)) + 1j * rng.normal(size=(n, n)), 1.0, types)


def _dft(n: int, types: Precision) -> None:
    """Compute two complex products of n x n matrices."""
    dr.eval(by_whole_matrices(_random(n, types), n + 0.5, (n, n), -1))


def _array_sum(n: int, period: float, types: Precision) -> None:
    fourier_sum(_random(n, types).numpy(), period, (n, n), -1)


def _fourier(n: int, types: Precision) -> None:
    dr.eval(_fft(_random(n, types), n, (n, n), -1))


def _fft_sample(n: int) -> float:
    """Return the predicted seconds per sample of an FFT of n x n samples, as in `fourier.predicted_seconds`."""
    return 2 * (5 * np.log2(n + 1) / cost.FFT_FLOPS + cost.FFT_LINE_SAMPLE) + 2 * cost.FFT_COPY


def _pupil(n: int, types: Precision) -> None:
    u = BEAM.behind(Circle().soften(20.0, 1e-4), Grid.square(n, 2.4 * RADIUS / n), types)
    dr.eval(u.re, u.im)


def _nodes() -> int:
    return len(cached_nodes(Circle(), 10.0, 4.0))


def _direct(n: int, types: Precision) -> None:
    x, y = Grid.square(n, 0.5e-6).coordinates(types)
    field = direct_sum(BEAM, (Circle(), 10.0, 4.0, False), x, y, types)
    dr.eval(field.re, field.im)


def _bessel(n: int, types: Precision) -> None:
    at = dr.linspace(types.Float64, 0, RADIUS, n)
    ones = types.Float(dr.ones(types.Float64, n))
    field = _transform(Field(ones, ones, Grid((1, n), 1.0), types), at, at * 1e10, types, False)
    dr.eval(field.re, field.im)


def _profile(n: int, types: Precision) -> None:
    window = Grid.square(n, 1e-7)
    line = RadialProfile(window.half_diagonal, window.half_diagonal * (1 + TAPS / 400), 64, 201)
    dr.eval(line.onto(types.Float(np.ones(64)), window, types))


def seconds(run: Callable[[], object], repeats: int) -> float:
    """Return the median duration [s] of warm calls."""
    found = []
    for _ in range(repeats + 2):
        start = time.perf_counter()
        run()
        dr.sync_thread()
        found.append(time.perf_counter() - start)
    return float(np.median(found[2:]))


def fitted(operation: Operation, repeats: int) -> tuple[float, float]:
    """Return the seconds per call and per unit, from a line that is fitted to the times with least relative errors."""
    times = np.array([seconds(lambda n=n: operation.run(n), repeats) for n in operation.sizes])
    counts = np.array([operation.count(n) for n in operation.sizes], dtype=np.float64)
    terms = np.column_stack([np.ones_like(counts), counts]) / times[:, None]
    call, each = np.linalg.lstsq(terms, np.ones_like(times), rcond=None)[0]
    return float(call), float(each)


def main() -> None:
    assert __doc__
    options = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    options.add_argument("--repeats", type=int, default=9, help="number of timings for each median")
    repeats = options.parse_args().repeats
    print(f"{'operation':<38}{'predicted':>12}{'found':>12}{'a call':>12}")
    for dtype in ("float32", "float64"):
        for operation in operations(precision(dtype)):
            call, each = fitted(operation, repeats)
            print(f"{operation.name:<38}{operation.seconds:>10.1e} s{each:>10.1e} s{call:>10.1e} s")
    print(f"\n{'method':<38}{'predicted':>12}{'found':>12}")
    for method in METHODS:
        ask = {"sensor_distance": DISTANCE, "dx": 1e-6, "shape": (129, 129), "method": method}
        found = seconds(lambda ask=ask: optics.psf(BEAM.pupil, **ask).psf, repeats)
        print(f"{method:<38}{optics.plan(BEAM.pupil, **ask).seconds:>10.1e} s{found:>10.1e} s")


if __name__ == "__main__":
    main()
