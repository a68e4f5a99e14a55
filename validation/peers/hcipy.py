"""hcipy: its propagators, built before timing; apertures with hard edges, or supersampled as in its examples."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from validation.peers.problem import WAVELENGTH, Case, Peer, Run, SampleGrid

SUPERSAMPLED = 8


def runs(case: Case, grid: SampleGrid, dtype: str) -> Iterator[Run]:
    yield from _spectra(case, grid, dtype)
    if case.has_lens:
        yield _fraunhofer(case, case.around_pupil(grid.n), dtype)
    else:
        yield _fresnel(case, grid, dtype)


def _spectra(case: Case, grid: SampleGrid, dtype: str) -> Iterator[Run]:
    import hcipy

    sampled = _grid(grid)
    lens = case.lens(grid).ravel()
    edges = {"": case.aperture(grid).ravel(), ", grey edge": _grey(case, sampled)}
    for edge, aperture in edges.items():
        wave = hcipy.Wavefront(hcipy.Field(aperture * lens, sampled), WAVELENGTH)
        for oversampling in (1, 2):
            propagator = hcipy.AngularSpectrumPropagator(sampled, case.distance, num_oversampling=oversampling)
            yield Run(
                "AngularSpectrumPropagator" + edge,
                "exact" if edge else "angular spectrum",
                grid,
                dtype,
                lambda propagator=propagator, wave=wave: propagator.forward(wave).electric_field,
                lambda data: case.resampled(np.asarray(data).reshape(grid.n, grid.n), grid),
                f"transfer function oversampled {oversampling} times",
            )


def _fraunhofer(case: Case, grid: SampleGrid, dtype: str) -> Run:
    import hcipy

    sampled, n = _grid(grid), case.window.n
    propagator = hcipy.FraunhoferPropagator(sampled, _grid(case.window), focal_length=case.focal_length)
    wave = hcipy.Wavefront(hcipy.Field(_grey(case, sampled), sampled), WAVELENGTH)
    return Run(
        "FraunhoferPropagator, grey edge",
        "paraxial",
        grid,
        dtype,
        lambda: propagator.forward(wave).electric_field,
        lambda data: np.abs(np.asarray(data)).reshape(n, n) ** 2,
    )


def _fresnel(case: Case, grid: SampleGrid, dtype: str) -> Run:
    import hcipy

    sampled = _grid(grid)
    propagator = hcipy.FresnelPropagator(sampled, case.distance)
    wave = hcipy.Wavefront(hcipy.Field(_grey(case, sampled), sampled), WAVELENGTH)
    return Run(
        "FresnelPropagator, grey edge",
        "paraxial",
        grid,
        dtype,
        lambda: propagator.forward(wave).electric_field,
        lambda data: case.resampled(np.asarray(data).reshape(grid.n, grid.n), grid),
    )


def _grid(grid: SampleGrid) -> object:
    import hcipy

    pair = np.ones(2)
    coordinates = hcipy.RegularCoords(grid.dx * pair, grid.n * pair.astype(int), -(grid.n // 2) * grid.dx * pair)
    return hcipy.CartesianGrid(coordinates)


def _grey(case: Case, sampled: object) -> np.ndarray:
    import hcipy

    circle = hcipy.make_circular_aperture(2 * case.radius)
    return np.asarray(hcipy.evaluate_supersampled(circle, sampled, SUPERSAMPLED))


PEER = Peer("hcipy", "hcipy", ("complex128",), runs)
