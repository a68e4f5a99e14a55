"""prysm: its free-space (Fresnel) transfer function, and its matrix and chirp-z transforms to the focus."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from validation.peers.problem import WAVELENGTH, Case, Peer, Run, SampleGrid

MILLIMETRES, MICRONS = 1e3, 1e6


def runs(case: Case, grid: SampleGrid, dtype: str) -> Iterator[Run]:
    from prysm.conf import config
    from prysm.propagation import angular_spectrum, angular_spectrum_transfer_function, focus_fixed_sampling

    config.precision = 32 if dtype == "complex64" else 64
    padded = grid.padded
    field = case.pupil(padded, paraxial=True).astype(dtype)
    micro, distance = WAVELENGTH * MICRONS, case.distance * MILLIMETRES
    transfer = angular_spectrum_transfer_function(padded.n, micro, padded.dx * MILLIMETRES, distance)
    yield Run(
        "angular_spectrum",
        "paraxial",
        grid,
        dtype,
        lambda: angular_spectrum(field, micro, 0.0, 0.0, tf=transfer),
        lambda data: case.resampled(data, padded),
        "transfer function computed beforehand",
    )
    if not case.has_lens:
        return
    tight, window = case.around_pupil(grid.n), case.window
    aperture = case.aperture(tight).astype(dtype)
    # One point more than the window's: both transforms have the axis in the middle of an even number.
    where = (tight.dx * MILLIMETRES, distance, micro, window.dx * MICRONS, window.n + 1)
    for method in ("mdft", "czt"):
        yield Run(
            f"focus_fixed_sampling, {method}",
            "paraxial",
            tight,
            dtype,
            lambda method=method: focus_fixed_sampling(aperture, *where, method=method),
            lambda data: np.abs(data[1:, 1:]).astype(np.float64) ** 2,
        )


PEER = Peer("prysm", "prysm.propagation", ("complex64", "complex128"), runs)
