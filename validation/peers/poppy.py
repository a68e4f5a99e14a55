"""poppy: the matrix transform behind its Fraunhofer imaging, and its Fresnel propagator; apertures with grey pixels."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from validation.peers.problem import WAVELENGTH, Case, Peer, Run, SampleGrid


def runs(case: Case, grid: SampleGrid, dtype: str) -> Iterator[Run]:
    yield _focus(case, case.around_pupil(grid.n), dtype) if case.has_lens else _near_field(case, grid, dtype)


def _focus(case: Case, grid: SampleGrid, dtype: str) -> Run:
    import poppy
    from poppy.matrixDFT import MatrixFourierTransform

    circle = poppy.CircularAperture(radius=case.radius, gray_pixel=True)
    aperture = circle.sample(wavelength=WAVELENGTH, npix=grid.n, grid_size=grid.width)
    window = case.window
    extent = window.width / (WAVELENGTH * case.focal_length / grid.width)  # window in λ f / D
    transform = MatrixFourierTransform()
    return Run(
        "MatrixFourierTransform, grey edge",
        "paraxial",
        grid,
        dtype,
        lambda: transform.perform(aperture, extent, window.n),
        lambda data: np.abs(data) ** 2,
    )


def _near_field(case: Case, grid: SampleGrid, dtype: str) -> Run:
    import astropy.units as u
    import poppy

    half = grid.width / 2 * u.m
    start = poppy.FresnelWavefront(half, wavelength=WAVELENGTH * u.m, npix=grid.n, oversample=2)
    start *= poppy.CircularAperture(radius=case.radius * u.m, gray_pixel=True)

    def propagate() -> np.ndarray:
        wave = start.copy()
        wave.propagate_fresnel(case.distance * u.m)
        return wave.wavefront

    return Run(
        "propagate_fresnel, grey edge",
        "paraxial",
        grid,
        dtype,
        propagate,
        lambda data: case.resampled(data, grid.padded),
        "padded to twice the grid",
    )


PEER = Peer("poppy", "poppy", ("complex128",), runs)
