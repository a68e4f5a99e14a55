"""waveprop: band-limited angular spectrum, onto the same pitch or onto the window's, and Rayleigh-Sommerfeld by FFT."""

from __future__ import annotations

import warnings
from collections.abc import Iterator

from validation.peers.problem import WAVELENGTH, Case, Peer, Run, SampleGrid

# The scaled transform convolves 4 n x 4 n: beyond this it takes seconds without an advantage over the plain one.
LARGEST_SCALED = 640


def runs(case: Case, grid: SampleGrid, dtype: str) -> Iterator[Run]:
    import torch

    warnings.filterwarnings("ignore", module="torchvision")
    from waveprop.rs import angular_spectrum, fft_di

    field = torch.from_numpy(case.pupil(grid)).to(getattr(torch, dtype))
    start = {"u_in": field, "wv": WAVELENGTH, "d1": grid.dx, "dz": case.distance, "device": "cpu"}
    for limited in (False, True):
        transfer = angular_spectrum(**start, bandlimit=limited, return_H=True)
        yield Run(
            "band-limited angular spectrum" if limited else "angular spectrum",
            "angular spectrum",
            grid,
            dtype,
            lambda transfer=transfer: angular_spectrum(**start, H=transfer)[0],
            lambda data: case.resampled(data.numpy(), grid),
            "transfer function computed beforehand",
        )
    if grid.n <= LARGEST_SCALED:
        transfer = angular_spectrum(**start, bandlimit=True, return_H=True)
        # For an even number m of points its centre is m/2 + 1; the points before the window are omitted.
        points = case.window.n + 3
        yield Run(
            "scaled angular spectrum",
            "angular spectrum",
            grid,
            dtype,
            lambda: angular_spectrum(**start, H=transfer, d2=case.window.dx, N_out=points)[0],
            lambda data: (data.abs().double() ** 2).numpy()[3:, 3:],
            "transfer function computed beforehand",
        )
    if not case.has_lens and dtype == "complex128":  # it ignores the imaginary part of its input
        odd = grid.odd  # required by its Simpson's rule
        aperture = case.aperture(odd)
        for simpson in (False, True):
            yield Run(
                "FFT direct integration" + (", Simpson" if simpson else ""),
                "exact",
                grid,
                dtype,
                lambda simpson=simpson: fft_di(aperture, WAVELENGTH, odd.dx, case.distance, use_simpson=simpson)[0],
                lambda data: case.resampled(data, odd),
            )


PEER = Peer("waveprop", "waveprop.rs", ("complex64", "complex128"), runs)
