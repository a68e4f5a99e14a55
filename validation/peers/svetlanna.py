"""svetlanna: free space built before timing, by zero-padded angular spectrum or Rayleigh-Sommerfeld convolution."""

from __future__ import annotations

import warnings
from collections.abc import Iterator

from validation.peers.problem import WAVELENGTH, Case, Peer, Run, SampleGrid


def runs(case: Case, grid: SampleGrid, dtype: str) -> Iterator[Run]:
    import svetlanna
    import torch

    warnings.filterwarnings("ignore", module="svetlanna")
    real = torch.float64 if dtype == "complex128" else torch.float32
    # Its convolution is centred on odd grids only, and its own padding changes the pitch: padded by us instead.
    for method, kind, used in (("zpASM", "angular spectrum", grid), ("RSC", "exact", grid.padded.odd)):
        x = torch.from_numpy(used.x).to(real)
        space = svetlanna.SimulationParameters(x=x, y=x, wavelength=torch.tensor(WAVELENGTH, dtype=real))
        element = svetlanna.elements.FreeSpace(space, torch.tensor(case.distance, dtype=real), method=method)
        wave = svetlanna.Wavefront(torch.from_numpy(case.pupil(used)).to(getattr(torch, dtype)))
        yield Run(
            method,
            kind,
            grid,
            dtype,
            lambda element=element, wave=wave: element(wave),
            lambda data, used=used: case.resampled(data.detach().numpy(), used),
            "padded to twice the grid",
        )


PEER = Peer("svetlanna", "svetlanna", ("complex64", "complex128"), runs)
