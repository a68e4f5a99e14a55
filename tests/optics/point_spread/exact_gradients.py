"""Exact PSFs and derivatives in plain NumPy: the first Rayleigh-Sommerfeld integral and its adjoint.

The nodes do not depend on the light. They are Gauss-Legendre nodes in every piece of the disk between given lines, the
borders of pixels or the knots of a spline. The substitution x = sin θ makes the ends of the chords smooth functions.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.interpolate import make_interp_spline


@dataclass(frozen=True)
class Scene:
    """A round pupil in front of a small window off the axis. Lengths are in m."""

    radius: float = 25e-6
    focal_length: float = 240e-6
    distance: float = 240e-6
    n: float = 1.5
    wavelength: float = 550e-9
    dx: float = 0.8e-6
    shape: tuple[int, int] = (5, 7)
    centre: tuple[float, float] = (0.4e-6, -0.8e-6)

    @property
    def wavenumber(self) -> float:
        return 2 * np.pi / self.wavelength


def lines_of_knots(n: int) -> np.ndarray:
    return (np.arange(n) + 0.5) * 2 / n - 1


def lines_of_pixels(n: int) -> np.ndarray:
    return np.arange(1, n) * 2 / n - 1


def spline(n: int, at: np.ndarray) -> np.ndarray:
    """Return the values at some places of n cubic splines, each of which is 1 at one of n cell centres and 0 at the
    others, (place, sample).
    """
    return make_interp_spline(np.arange(n), np.eye(n), k=3)((at + 1) * n / 2 - 0.5)


def pixel(n: int, at: np.ndarray) -> np.ndarray:
    return np.eye(n)[np.clip(np.floor((at + 1) * n / 2), 0, n - 1).astype(int)]


def disk_nodes(lines: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Nodes x, y and weights over the unit disk. Pieces between lines have `count` nodes along either axis."""
    lines = lines[np.abs(lines) < 1]
    crossed = np.sqrt(1 - lines**2)
    u, weight = np.polynomial.legendre.leggauss(count)
    u, weight = (u + 1) / 2, weight / 2
    found = []
    for start, end in pairwise(np.unique(np.round(np.concatenate([[-1, 0, 1], lines, crossed, -crossed]), 13))):
        theta = np.arcsin(start) + (np.arcsin(end) - np.arcsin(start)) * u
        top = np.cos(theta)
        inner = lines[np.abs(lines) < np.cos(max(abs(theta.min()), abs(theta.max())))]
        ends = np.column_stack([-top, np.tile(inner, (count, 1)), top])
        y = ends[:, :-1, None] + np.diff(ends)[:, :, None] * u
        size = (np.arcsin(end) - np.arcsin(start)) * weight * top
        x = np.broadcast_to(np.sin(theta)[:, None, None], y.shape)
        found.append((x.ravel(), y.ravel(), (size[:, None, None] * np.diff(ends)[:, :, None] * weight).ravel()))
    x, y, size = (np.concatenate(part) for part in zip(*found, strict=True))
    return x, y, size


def psf_and_adjoint(
    scene: Scene, nodes: tuple[np.ndarray, ...], path: np.ndarray, amplitude: np.ndarray, cotangent: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the PSF, flat, and for each node the derivative q of the functional Σ cotangent · PSF.

    A small change δP of the transmittance P at the nodes, times the lens, changes the functional by Re Σ q δP.

    path: optical path [m] of the relief and of the wavefront at the nodes.
    amplitude: transmitted amplitude at the nodes.
    """
    x, y, size = nodes[0] * scene.radius, nodes[1] * scene.radius, nodes[2] * scene.radius**2
    squared = x * x + y * y
    lens = squared / (np.sqrt(squared + scene.focal_length**2) + scene.focal_length)
    u = size * np.exp(1j * scene.wavenumber * (path - lens))
    height, width = scene.shape
    to_x = (np.arange(width) - width // 2) * scene.dx + scene.centre[0]
    to_y = (np.arange(height) - height // 2) * scene.dx + scene.centre[1]
    psf, q, z, k = [], np.zeros(len(x), complex), scene.distance, scene.wavenumber
    for place, share in zip(np.ndindex(height, width), cotangent, strict=True):
        d2 = (to_x[place[1]] - x) ** 2 + (to_y[place[0]] - y) ** 2
        far = np.sqrt(d2 + z * z)
        kernel = z / (2 * np.pi * far**2) * (1 / far - 1j * k) * np.exp(1j * k * d2 / (far + z))
        field = kernel @ (u * amplitude)
        psf.append(np.abs(field) ** 2)
        q += 2 * share * np.conj(field) * kernel
    area = np.pi * scene.radius**2
    return np.array(psf) / area, q * u / area
