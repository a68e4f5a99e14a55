"""LightPipes: spectral propagation (Forvard, on a grid padded by us) and convolution (Fresnel); both paraxial."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from validation.peers.problem import WAVELENGTH, Case, Peer, Run, SampleGrid


def runs(case: Case, grid: SampleGrid, dtype: str) -> Iterator[Run]:
    import LightPipes

    kind = np.dtype(dtype).type
    padded = grid.padded
    spectral = LightPipes.Begin(padded.width, WAVELENGTH, padded.n, dtype=kind)
    spectral.field = case.pupil(padded, paraxial=True).astype(dtype)
    yield Run(
        "Forvard",
        "paraxial",
        grid,
        dtype,
        lambda: LightPipes.Forvard(spectral, case.distance).field,
        lambda data: case.resampled(data, padded),
        "padded to twice the grid",
    )
    # Its convolution defines the pitch as size / (n - 1).
    convolved = LightPipes.Begin(grid.dx * (grid.n - 1), WAVELENGTH, grid.n, dtype=kind)
    convolved.field = case.pupil(grid, paraxial=True).astype(dtype)
    yield Run(
        "Fresnel",
        "paraxial",
        grid,
        dtype,
        lambda: LightPipes.Fresnel(convolved, case.distance).field,
        lambda data: case.resampled(data, grid),
    )


PEER = Peer("LightPipes", "LightPipes", ("complex64", "complex128"), runs)
