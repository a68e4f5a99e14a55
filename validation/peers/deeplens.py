"""DeepLens (deeplens-core): angular spectrum, plain and band-limited, each padded to twice the grid."""

from __future__ import annotations

from collections.abc import Iterator

from validation.peers.problem import WAVELENGTH, Case, Peer, Run, SampleGrid


def runs(case: Case, grid: SampleGrid, dtype: str) -> Iterator[Run]:
    import torch
    from deeplens.light.wave import AngularSpectrumMethod, BandLimitedASM

    field = torch.from_numpy(case.pupil(grid)).to(getattr(torch, dtype))
    units = {"z": case.distance * 1e3, "wvln": WAVELENGTH * 1e6, "ps": grid.dx * 1e3}  # mm, µm, mm
    for name, method in {"ASM": AngularSpectrumMethod, "band-limited ASM": BandLimitedASM}.items():
        yield Run(
            name,
            "angular spectrum",
            grid,
            dtype,
            lambda method=method: method(field, **units),
            lambda data: case.resampled(data.numpy(), grid),
        )


PEER = Peer("deeplens-core", "deeplens.light.wave", ("complex64", "complex128"), runs)
