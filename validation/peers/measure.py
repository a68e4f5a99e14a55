"""Measurement of runs as points, all on one thread of one process."""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import date
from importlib import metadata
from typing import Any

from validation.peers import rhabdom
from validation.peers.points import Point
from validation.peers.problem import Case, Peer, Run, error, grids

__all__ = ["OURS", "median_seconds", "one_thread", "our_points", "peer_points", "quickest"]

OURS = "rhabdom"
REPEATS = 5
UNHURRIED = 1.0  # seconds, above which three calls are enough
LARGEST_PARAXIAL = 600  # samples: the error of their model dominates, so more samples only take longer


@contextmanager
def one_thread() -> Iterator[None]:
    """Limit Dr.Jit, torch, BLAS, OpenMP and numexpr to one thread each, and restore their settings afterwards."""
    import drjit as dr
    import torch
    from threadpoolctl import threadpool_limits

    numexpr = sys.modules.get("numexpr")  # a dependency of some peers
    before = dr.thread_count(), torch.get_num_threads(), numexpr.set_num_threads(1) if numexpr else 1
    dr.set_thread_count(1)
    torch.set_num_threads(1)
    try:
        with threadpool_limits(1):
            yield
    finally:
        dr.set_thread_count(before[0])
        torch.set_num_threads(before[1])
        if numexpr:
            numexpr.set_num_threads(before[2])


def median_seconds(compute: Callable[[], Any], repeats: int = REPEATS, least: float = 0.05) -> float:
    """Return the median duration [s] of a call.

    The call is repeated for at least `least` seconds, and at least `repeats` times, or three times if calls take a
    second. It must have been made once before. If the second call is short, it is not counted, because it may still
    include warm-up.
    """
    times = [_seconds(compute)]
    if times[0] < UNHURRIED:
        times.clear()
    while len(times) < (repeats if sum(times) < 3 * UNHURRIED else 3) or sum(times) < least:
        times.append(_seconds(compute))
    return statistics.median(times)


def _seconds(compute: Callable[[], Any]) -> float:
    start = time.perf_counter()
    compute()
    return time.perf_counter() - start


def our_points(case: Case, machine: str) -> Iterator[Point]:
    version = metadata.version(OURS)
    for run in rhabdom.psf_runs(case):
        yield _point(case, OURS, version, run, machine, fitted=False)
    for grid in grids(case):
        for run in rhabdom.plain_angular_spectrum(case, grid):
            yield _point(case, OURS, version, run, machine, fitted=True)


def peer_points(case: Case, machine: str, peers: Mapping[Peer, str]) -> Iterator[Point]:
    """Yield points of every method of these peers (with their versions), on every grid and in every precision."""
    for peer, version in peers.items():
        done = set()  # some grids are equal for methods that choose their own pitch
        for grid in grids(case):
            for dtype in peer.dtypes:
                for run in peer.runs(case, grid, dtype):
                    setting = (run.method, run.detail, run.grid, dtype)
                    if setting not in done and (run.kind != "paraxial" or grid.n <= LARGEST_PARAXIAL):
                        done.add(setting)
                        yield _point(case, peer.distribution, version, run, machine, fitted=True)


def quickest(rounds: Sequence[Sequence[Point]]) -> list[Point]:
    """Return one point of each method and setting: that with the smallest median, since other load only adds time."""
    best: dict[tuple[object, ...], Point] = {}
    for point in (point for points in rounds for point in points):
        key = (*point.series, point.samples, point.pitch)
        if key not in best or point.seconds < best[key].seconds:
            best[key] = point
    return list(best.values())


def _point(case: Case, code: str, version: str, run: Run, machine: str, fitted: bool) -> Point:
    wrong = error(case, run.intensity(run.compute()), fitted)
    today, seconds = date.today().isoformat(), median_seconds(run.compute)
    return Point(
        case.name,
        code,
        version,
        run.method,
        run.kind,
        run.grid.n,
        run.grid.dx,
        run.dtype,
        wrong,
        seconds,
        today,
        machine,
        run.detail,
    )
