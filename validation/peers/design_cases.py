"""Pupils of lens designs, and their PSFs by a matrix Fourier transform in PyTorch.

The transform computes the window from samples of the pupil, placed by their direction sines. The pupil's edge is grey:
a sample counts by the share of its cell within the pupil. The transform plans nothing and predicts no error. All
matrices that do not depend on the design parameters are prepared in advance.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import torch
from scipy.interpolate import CubicSpline

import optics

__all__ = ["DX", "EVERY", "FOCUS", "Design", "N", "designs", "direct_sum", "matrix_transform"]

RADIUS, FOCUS, N, DX = 1e-3, 10e-3, 65, 1.4e-6
GREEN, COLOURS = (550e-9,), (460e-9, 550e-9, 610e-9)
FAR, DEPTHS = (np.inf,), tuple(1 / np.linspace(1e-3, 1, 16))  # distances of sources [m]
SUBSAMPLES = 4  # subsamples of a cell along an axis, for the grey edge
EVERY, FINE = 4, 384  # samples of the window per compared sample along an axis; samples of the direct sum

Path = Callable[[torch.Tensor], torch.Tensor]


@dataclass(frozen=True)
class Design:
    """A kind of pupil.

    numbers: function that returns new design parameters.
    pupil: function that returns the pupil with these parameters, NumPy or PyTorch.
    path: function of points along an axis of the pupil [m]. It returns a function from design parameters to the optical
        path [m] at these points.
    """

    name: str
    numbers: Callable[[np.random.Generator], np.ndarray]
    pupil: Callable[[object], optics.Pupil]
    path: Callable[[np.ndarray], Path]
    wavelengths: tuple[float, ...] = GREEN
    distances: tuple[float, ...] = FAR


def designs() -> Iterator[Design]:
    """Yield all designs, from smooth to rough."""
    for count, rough in ((32, 0.0), (32, 20e-9), (32, 60e-9), (32, 150e-9), (128, 50e-9)):
        yield _map(f"{count} x {count} heights, {1e9 * rough:.0f} nm of noise", count, rough)
    for order in (4, 9):
        count = (order + 1) * (order + 2) // 2
        yield Design(f"{count} Zernike modes", _modes(count), _zernike, lambda at, count=count: _mode_path(at, count))
    for count in (32, 64, 128):
        name = f"{count} x {count} pixels"
        yield Design(name, _heights(count, 0.0), _pixels, lambda at, count=count: _separable(_in_pixels(at, count)))
    yield _map("16 distances x 3 wavelengths", 32, 0.0, COLOURS, DEPTHS)


def matrix_transform(design: Design, count: int) -> Callable[[torch.Tensor], torch.Tensor]:
    """Return the function from design parameters to PSFs (distance, wavelength, y, x) in float32.

    count: samples across the pupil.
    """
    at, pitch, inside = _cells(count)
    x, y = at[None, :], at[:, None]
    distance, lens = np.sqrt(x * x + y * y + FOCUS**2), optics.Pupil(RADIUS, thin_lens_focal_length=FOCUS)
    window = (np.arange(N) - N // 2) * DX
    sines = np.outer(window, at / np.sqrt(at**2 + RADIUS**2 / 4 + FOCUS**2))
    paths = [lens.path(x, y, GREEN[0], optics.PointSource(each)) + distance for each in design.distances]
    lights, kernels = [], []
    for wave in design.wavelengths:
        size = inside * FOCUS / distance**2 / wave * pitch**2 / np.sqrt(np.pi * RADIUS**2)
        lights.append(torch.tensor(size * np.exp(2j * np.pi / wave * np.stack(paths)), dtype=torch.complex64))
        kernels.append(torch.tensor(np.exp(-2j * np.pi / wave * sines), dtype=torch.complex64))
    bent = design.path(at)

    def picture(numbers: torch.Tensor) -> torch.Tensor:
        own = bent(numbers)
        images = []
        for wave, light, kernel in zip(design.wavelengths, lights, kernels, strict=True):
            turned = torch.polar(torch.ones_like(own), 2 * torch.pi / wave * own).to(torch.complex64)
            images.append((kernel @ (light * turned) @ kernel.T).abs().square())
        return torch.stack(images, 1)

    return picture


def direct_sum(design: Design, numbers: np.ndarray, distance: float) -> np.ndarray:
    """Return every fourth sample of the PSFs by the first Rayleigh-Sommerfeld integral, (wavelength, y, x)."""
    at, pitch, inside = _cells(FINE)
    y, x = (at[place] for place in np.nonzero(inside))
    pupil, size = design.pupil(numbers), inside[inside > 0] * pitch**2
    window = ((np.arange(N) - N // 2) * DX)[::EVERY]
    found = np.empty((len(design.wavelengths), len(window), len(window)))
    for image, wave in zip(found, design.wavelengths, strict=True):
        k = 2 * np.pi / wave
        field = size * np.exp(1j * k * pupil.path(x, y, wave, optics.PointSource(distance)))
        for row, v in zip(image, window, strict=True):
            for column, u in enumerate(window):
                r = np.sqrt((x - u) ** 2 + (y - v) ** 2 + FOCUS**2)
                row[column] = abs(np.sum(field * np.exp(1j * k * r) * FOCUS / r**2 * (1 / r - 1j * k))) ** 2
    return found / (4 * np.pi**2 * pupil.area)


def _cells(count: int) -> tuple[np.ndarray, float, np.ndarray]:
    """Return samples along an axis of the pupil [m], their pitch, and the share of each cell within the pupil."""
    pitch = 2 * RADIUS / count
    at = (np.arange(count) - (count - 1) / 2) * pitch
    finer = (np.arange(SUBSAMPLES) - (SUBSAMPLES - 1) / 2) / SUBSAMPLES * pitch
    parts = np.add.outer(at, finer).ravel() ** 2
    inside = (parts[:, None] + parts <= RADIUS**2).reshape(count, SUBSAMPLES, count, SUBSAMPLES)
    return at, pitch, inside.mean((1, 3))


def _map(name: str, count: int, rough: float, *light: tuple[float, ...]) -> Design:
    return Design(name, _heights(count, rough), _relief, lambda at: _separable(_spline(at, count)), *light)


def _relief(heights: object) -> optics.Pupil:
    return optics.Pupil(RADIUS, optics.HeightMap(heights), thin_lens_focal_length=FOCUS)


def _pixels(heights: object) -> optics.Pupil:
    return optics.Pupil(RADIUS, optics.PixelRelief(heights), thin_lens_focal_length=FOCUS)


def _zernike(modes: object) -> optics.Pupil:
    return optics.Pupil(RADIUS, wavefront=optics.Zernike(modes), thin_lens_focal_length=FOCUS)


def _heights(count: int, rough: float) -> Callable[[np.random.Generator], np.ndarray]:
    x = _centres(count)
    smooth = 0.3e-6 * (x**3 - x[:, None] ** 2 * x + 0.5 * np.cos(3 * x[:, None]))
    return lambda rng: smooth * rng.uniform(0.5, 1) + rough * rng.standard_normal((count, count))


def _modes(count: int) -> Callable[[np.random.Generator], np.ndarray]:
    return lambda rng: 0.1 * rng.standard_normal(count) / np.sqrt(np.arange(1, count + 1))


def _centres(count: int) -> np.ndarray:
    centres: np.ndarray = (np.arange(count) + 0.5) / count * 2 - 1
    return centres


def _spline(at: np.ndarray, count: int) -> np.ndarray:
    """Return the matrix (point, height) of the cubic spline through heights."""
    matrix: np.ndarray = CubicSpline(_centres(count), np.eye(count))(at / RADIUS)
    return matrix


def _in_pixels(at: np.ndarray, count: int) -> np.ndarray:
    """Return the matrix (point, pixel) that selects the pixel of each point."""
    return np.eye(count)[np.clip(((at / RADIUS + 1) / 2 * count).astype(int), 0, count - 1)]


def _separable(matrix: np.ndarray) -> Path:
    own = torch.tensor(matrix)
    return lambda heights: _relief(np.zeros((4, 4))).index_step(GREEN[0]) * (own @ heights @ own.T)


def _mode_path(at: np.ndarray, count: int) -> Path:
    """Return the function from coefficients of `optics.Zernike` [µm] to the optical path [m] at these points."""
    x, y, far = at[None, :], at[:, None], optics.PointSource()
    flat = _zernike(np.zeros(count)).path(x, y, GREEN[0], far)
    own = torch.tensor(np.stack([_zernike(one).path(x, y, GREEN[0], far) - flat for one in np.eye(count)], -1))
    return lambda modes: own @ modes
