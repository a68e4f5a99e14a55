"""This package on the same cases.

`optics.psf` runs at tolerances from 1e-2 to 1e-9, and `optics.propagate` runs on a hard-edged pupil.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

import optics
from optics.point_spread.planner import EXACT
from validation.peers.problem import WAVELENGTH, Case, Run, SampleGrid

__all__ = ["TOLERANCES", "plain_angular_spectrum", "psf_runs"]

TOLERANCES = tuple(10.0**-n for n in range(2, 10))
DTYPES = ("float32", "float64")
LONGEST = 0.2  # predicted seconds above which a method selected by name is omitted


def psf_runs(case: Case) -> Iterator[Run]:
    """Yield runs at every tolerance that is reached, with the planner's choice of method and with each exact method.

    Methods that the planner does not choose are omitted if their predicted time is above LONGEST.
    """
    focal_length = case.focal_length if case.has_lens else None
    pupil = optics.Pupil(aperture_radius=case.radius, thin_lens_focal_length=focal_length)
    for method in ("auto", *EXACT):
        for dtype in DTYPES:
            for tolerance in TOLERANCES:
                request = {
                    "sensor_distance": case.distance,
                    "dx": case.window.dx,
                    "shape": (case.window.n, case.window.n),
                    "tolerance": tolerance,
                    "method": method,
                    "dtype": dtype,
                }
                yield from _calls(pupil, request)


def _calls(pupil: optics.Pupil, request: dict[str, Any]) -> Iterator[Run]:
    method, dtype = request["method"], request["dtype"]
    try:
        plan = optics.plan(pupil, WAVELENGTH, **request)
        if method != "auto" and plan.seconds > LONGEST:
            return
        optics.psf(pupil, [WAVELENGTH], **request)
    except optics.AccuracyError:
        return  # it raises an error instead of returning a wrong PSF: no point to draw
    calls = {method: lambda: optics.psf(pupil, [WAVELENGTH], **request).psf}
    for name, compute in calls.items():
        detail = f"tolerance {request['tolerance']:.0e}" + (f", {plan.method}" if method == "auto" else "")
        grid = SampleGrid(plan.samples[0], 2 * pupil.aperture_radius / plan.samples[0])
        yield Run(name, "exact", grid, dtype, compute, lambda psf: psf[0] * pupil.area, detail)


def plain_angular_spectrum(case: Case, grid: SampleGrid) -> Iterator[Run]:
    """Yield the angular spectrum of the same hard-edged samples that the peers receive."""
    window = case.window
    pupil = case.pupil(grid)
    for dtype, complex_dtype in zip(DTYPES, (np.complex64, np.complex128), strict=True):
        u = pupil.astype(complex_dtype)
        request = {"dx": grid.dx, "wavelength": WAVELENGTH, "distance": case.distance, "dtype": dtype}
        yield Run(
            "propagate",
            "angular spectrum",
            grid,
            dtype,
            lambda u=u, request=request: optics.propagate(u, out_dx=window.dx, out_shape=(window.n,) * 2, **request).u,
            lambda field: np.abs(field.astype(np.complex128)) ** 2,
        )
