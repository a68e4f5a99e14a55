"""torchoptics: angular spectrum on a padded grid, Rayleigh-Sommerfeld convolution (DIM) onto any window."""

from __future__ import annotations

import math
from collections.abc import Iterator

from scipy.fft import next_fast_len

from validation.peers.problem import WAVELENGTH, Case, Peer, Run, SampleGrid


def runs(case: Case, grid: SampleGrid, dtype: str) -> Iterator[Run]:
    import torch
    import torchoptics

    torchoptics.set_default_dtype(torch.float64 if dtype == "complex128" else torch.float32)
    # Its default pads by 2 n on every side; n/2 is the padding of the others, at a sixth of the time.
    for pad in (grid.n // 2, 2 * grid.n) if grid.n <= 300 else (grid.n // 2,):
        field = torchoptics.Field(torch.from_numpy(case.pupil(grid)), WAVELENGTH, 0, grid.dx)

        def spectrum(field: torchoptics.Field = field, pad: int = pad) -> torch.Tensor:
            # asm_pad returns the padding, too; only the middle is used.
            method = {"propagation_method": "ASM", "asm_pad": (pad, pad)}
            return field.propagate_to_z(case.distance, **method).data

        def window(data: torch.Tensor) -> object:
            return case.resampled(data.numpy(), grid)

        yield Run("ASM", "angular spectrum", grid, dtype, spectrum, window, f"padded by {pad}")
    source, target = grid.odd, _target(case, grid)
    start = torchoptics.Field(torch.from_numpy(case.pupil(source)), WAVELENGTH, 0, source.dx)

    def direct() -> torch.Tensor:
        return start.propagate((target.n, target.n), case.distance, target.dx, propagation_method="DIM").data

    yield Run("DIM", "exact", grid, dtype, direct, lambda data: case.resampled(data.numpy(), target))


def _target(case: Case, grid: SampleGrid) -> SampleGrid:
    """Return a grid with an odd number of samples that covers the window, with the pitch of `grid`.

    The number is chosen so that the convolution with the samples of `grid.odd` has a fast Fourier transform.
    """
    least = 2 * math.ceil(case.half_window / grid.dx) + 1
    if grid.dx > case.window.dx:
        least = grid.odd.n
    while next_fast_len(grid.odd.n + least) != grid.odd.n + least:
        least += 2
    return SampleGrid(least, grid.dx)


PEER = Peer("torchoptics", "torchoptics", ("complex64", "complex128"), runs)
