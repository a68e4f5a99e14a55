"""diffractsim: angular spectrum, on a grid padded by us, with its numpy back end."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from validation.peers.problem import WAVELENGTH, Case, Peer, Run, SampleGrid


def runs(case: Case, grid: SampleGrid, dtype: str) -> Iterator[Run]:
    import diffractsim

    padded = grid.padded
    field = diffractsim.MonochromaticField(WAVELENGTH, padded.width, padded.width, padded.n, padded.n)
    pupil = case.pupil(padded)

    def spectrum() -> np.ndarray:
        field.E = pupil
        field.propagate(case.distance)
        return field.E

    yield Run(
        "propagate",
        "angular spectrum",
        grid,
        dtype,
        spectrum,
        lambda data: case.resampled(data, padded),
        "padded to twice the grid",
    )


PEER = Peer("diffractsim", "diffractsim", ("complex128",), runs)
