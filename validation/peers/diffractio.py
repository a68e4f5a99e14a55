"""diffractio: Rayleigh-Sommerfeld by FFT on the same grid, and its chirp-z transform onto the window."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from validation.peers.problem import WAVELENGTH, Case, Peer, Run, SampleGrid

MICRONS = 1e6  # its unit of length


def runs(case: Case, grid: SampleGrid, dtype: str) -> Iterator[Run]:
    distance = case.distance * MICRONS
    wide = _field(case, grid)
    yield Run(
        "RS",
        "exact",
        grid,
        dtype,
        lambda: wide.RS(distance, matrix=True),
        lambda data: case.resampled(data, grid),
    )
    tight = case.around_pupil(grid.n).odd
    narrow = _field(case, tight)
    # It treats the ends as edges of cells, and its first output is the second cell.
    edge = case.half_window + case.window.dx / 2
    window = (np.linspace(-edge, edge, case.window.n) - case.window.dx) * MICRONS
    yield Run(
        "CZT",
        "paraxial",  # its cross term is xx'/z
        tight,
        dtype,
        lambda: narrow.CZT(distance, window, window).u,
        lambda data: np.abs(data) ** 2,
    )


def _field(case: Case, grid: SampleGrid) -> Any:
    from diffractio.scalar_fields_XY import Scalar_field_XY

    x = grid.x * MICRONS
    field = Scalar_field_XY(x, x, WAVELENGTH * MICRONS)
    field.u = case.pupil(grid)
    return field


PEER = Peer("diffractio", "diffractio.scalar_fields_XY", ("complex128",), runs)
