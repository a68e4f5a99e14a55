"""Where an eye looks and what each receptor makes of the light: ray directions and their weights.

All directions are fixed when the sensor is built, so that rendering is the same kernel every step. Coordinates
are the visual field's tangent plane, in receptor pitches: x to the right, y *down* as rows run, origin on the
optical axis; receptor (i, j) covers [j - w/2, j + 1 - w/2] x [i - h/2, i + 1 - h/2].
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse

import optics
from sim.readout import Readout, RowProduct, of_bands, of_components, of_receptors, within_stretches

# Below this many rays a receptive field wider than the eye is sampled too coarsely, however few its receptors.
MIN_RAYS = 64
# Cells across the eye, at least, on which receptive fields are tabulated.
MIN_CELLS = 32
# Weights that together change no signal by more than this share of the receptors' noise are left out.
NEGLIGIBLE = 0.1


@dataclass(frozen=True)
class BoxSensor:
    """Perfect lens: a receptor's signal is the mean over the square it covers.

    directions         unit vectors in the eye's frame (x right, y up, z optical axis), (ray, 3) float32;
                       ray = receptor * rays_per_receptor + sample
    rays_per_receptor  samples of one receptor; the renderer sums them in its kernel
    """

    directions: np.ndarray
    rays_per_receptor: int

    def receptor_radiance(self, sums: np.ndarray) -> np.ndarray:
        """Mean radiance of each receptor from the sums over its rays: (band, view, receptor), both ways."""
        return sums * np.float32(1.0 / self.rays_per_receptor)

    def readout(self, mixing: np.ndarray, basis: np.ndarray) -> Readout:
        """Signals from sums of components over receptors' rays, see sim.readout."""
        return of_receptors(mixing @ basis.T / self.rays_per_receptor)


@dataclass(frozen=True)
class ReceptiveFieldSensor:
    """An eye behind a pupil: one set of directions, drawn from the mixture of all receptive fields, serves all
    receptors and bands; a receptor's signal is a weighted sum (importance sampling, self-normalised):

        signal_r = sum_p W_b[r, p] radiance_b(p),   W_b[r, p] ∝ RF_{r,b}(p) / q(p),   sum_p W_b[r, p] = power_b

    with RF the turned PSF kernel convolved with the receptor's square, q the density that directions were drawn from
    and power_b the fraction of the pupil's power inside the kernel.

    Weights far above and below a row of receptors are 0 where they are too small to matter: together they are less than
    the tolerance asked of the PSF, and change no signal of a scene up to white in full daylight by more than
    NEGLIGIBLE of the receptors' noise.

    directions  unit vectors in the eye's frame, (ray, 3) float32
    weights     per band, sparse (receptor, ray)
    resolution  receptors (height, width)
    """

    directions: np.ndarray
    weights: tuple[scipy.sparse.csr_array, ...]
    resolution: tuple[int, int]
    rays_per_receptor: int = 1  # summed in the kernel: none

    def receptor_radiance(self, radiance: np.ndarray) -> np.ndarray:
        """(band, view, ray) -> (band, view, receptor)."""
        planes = [product(plane) for product, plane in zip(self._products, radiance, strict=True)]
        return np.stack([plane.reshape(len(plane), -1) for plane in planes])

    def readout(self, mixing: np.ndarray, basis: np.ndarray) -> Readout:
        """Signals from components along rays, see sim.readout."""
        if len(mixing) * len(basis) > len(self.weights):
            return of_bands(self._products, mixing, basis)
        return of_components(self.weights, self.resolution, mixing, basis)

    @cached_property
    def _products(self) -> list[RowProduct]:
        return [RowProduct.of([w], self.resolution) for w in self.weights]

    @property
    def density(self) -> float:
        """Share of weights that are not zero."""
        return float(np.mean([w.nnz / np.prod(w.shape) for w in self.weights]))


Sensor = BoxSensor | ReceptiveFieldSensor


def build_sensor(eye: optics.Eye, rays_per_receptor: int) -> Sensor:
    """The sensor of an eye. Raises ValueError for less than one ray, and optics.AccuracyError for a pupil whose
    light spreads too far to be computed."""
    if rays_per_receptor < 1:
        raise ValueError(f"rays_per_receptor = {rays_per_receptor!r}, must be at least 1")
    if eye.pupil is None:
        return box_sensor(eye, rays_per_receptor)
    height, width = eye.resolution
    rays = max(rays_per_receptor * height * width, MIN_RAYS)
    cells = cells_per_receptor(eye.resolution)
    while True:
        try:
            return receptive_field_sensor(eye, rays, cells)
        except optics.AccuracyError:
            # Light that spreads over too many cells for a PSF is smooth on the scale of coarser ones.
            if cells == 1:
                raise
            cells //= 2


def cells_per_receptor(resolution: tuple[int, int]) -> int:
    """Cells along a receptor's side on which receptive fields are tabulated."""
    return max(4, -(-MIN_CELLS // max(resolution)))


def box_sensor(eye: optics.Eye, rays_per_receptor: int) -> BoxSensor:
    """Every receptor's square sampled by the same low-discrepancy points, each receptor's shifted (on the torus)
    by its own fixed random offset so that the errors of neighbours are independent."""
    height, width = eye.resolution
    shifts = np.random.default_rng(0).random((height, width, 1, 2))
    points = (low_discrepancy(rays_per_receptor) + shifts) % 1.0
    x = points[..., 0] + np.arange(width)[None, :, None] - width / 2
    y = points[..., 1] + np.arange(height)[:, None, None] - height / 2
    return BoxSensor(directions_of(eye, np.stack([x, y], axis=-1).reshape(-1, 2)), rays_per_receptor)


def receptive_field_sensor(eye: optics.Eye, rays: int, cells: int) -> ReceptiveFieldSensor:
    """Directions from the mixture of all receptive fields, tabulated on `cells` x `cells` per receptor."""
    # (K ⊗ L)(r) = Σ_v K(r - v) L(v): as weights around the receptor, the convolution's kernel is turned about.
    fields = _receptive_fields(eye.kernel(cells)[:, ::-1, ::-1], cells)
    density = _mixture(fields, eye.resolution, cells)
    positions, ys, xs = _draw(density, rays)
    margin = (np.array(density.shape) - cells * np.array(eye.resolution)) // 2
    weights = _weights(fields, density, (ys - margin[0], xs - margin[1]), (ys, xs), eye.resolution, cells)
    weights = within_stretches(weights, eye.resolution, negligible_share(eye))
    plane = positions / cells - np.array(density.shape)[::-1] / (2 * cells)
    return ReceptiveFieldSensor(directions_of(eye, plane), weights, eye.resolution)


def directions_of(eye: optics.Eye, plane: np.ndarray) -> np.ndarray:
    """Unit vectors (ray, 3) in the eye's frame of points (x right, y down) [receptor pitches] on the tangent plane."""
    pitch = eye.receptor_pitch
    v = np.stack([plane[:, 0] * pitch, -plane[:, 1] * pitch, np.full(len(plane), eye.sensor_distance)], axis=-1)
    return (v / np.linalg.norm(v, axis=-1, keepdims=True)).astype(np.float32)


def low_discrepancy(n: int) -> np.ndarray:
    """n points in the unit square, (n, 2): the Hammersley set (van der Corput in base 2 against i/n), moved to the
    strata's centres."""
    index = np.arange(n)
    inverse, scale, rest = np.zeros(n), 0.5, index.copy()
    while rest.any():
        inverse += scale * (rest & 1)
        rest >>= 1
        scale /= 2
    first_dyadic = 2.0 ** -np.ceil(np.log2(max(n, 2)))
    return np.stack([(index + 0.5) / n, inverse + first_dyadic / 2], axis=-1)


def _receptive_fields(kernel: np.ndarray, cells: int) -> np.ndarray:
    """Power per cell of one receptor's field, (band, y, x): the kernel convolved with the receptor's square."""
    fields = kernel.astype(np.float64)
    for axis in (1, 2):
        ends = [(0, 0)] * 3
        ends[axis] = (cells, cells - 1)
        sums = np.cumsum(np.pad(fields, ends), axis=axis)
        size = fields.shape[axis] + cells - 1
        upper = np.take(sums, np.arange(cells, cells + size), axis)
        fields = (upper - np.take(sums, np.arange(size), axis)) / cells
    return np.maximum(fields, 0.0)


def _mixture(fields: np.ndarray, resolution: tuple[int, int], cells: int) -> np.ndarray:
    """Probability per cell of the mean field over receptors and bands, each band with the same weight."""
    one = (fields / fields.sum(axis=(1, 2), keepdims=True)).mean(axis=0)
    total = np.zeros([size + cells * (n - 1) for size, n in zip(one.shape, resolution, strict=True)])
    for i in range(resolution[0]):
        for j in range(resolution[1]):
            total[i * cells : i * cells + one.shape[0], j * cells : j * cells + one.shape[1]] += one
    return total / total.sum()


def _draw(density: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """n low-discrepancy draws from a piecewise constant density: positions (n, 2) in cells (x, y), and the cells'
    rows and columns. Inverts the marginal over rows, then each row's cumulative."""
    points = low_discrepancy(n)
    rows = np.concatenate([[0.0], np.cumsum(density.sum(axis=1))])
    rows /= rows[-1]
    ys = np.clip(np.searchsorted(rows, points[:, 0], side="right") - 1, 0, density.shape[0] - 1)
    y = ys + (points[:, 0] - rows[ys]) / (rows[ys + 1] - rows[ys])
    xs, x = np.empty(n, int), np.empty(n)
    for row in np.unique(ys):
        mine = ys == row
        columns = np.concatenate([[0.0], np.cumsum(density[row])])
        columns /= columns[-1]
        at = np.clip(np.searchsorted(columns, points[mine, 1], side="right") - 1, 0, density.shape[1] - 1)
        xs[mine] = at
        x[mine] = at + (points[mine, 1] - columns[at]) / (columns[at + 1] - columns[at])
    return np.stack([x, y], axis=-1), ys, xs


def _weights(
    fields: np.ndarray,
    density: np.ndarray,
    from_first: tuple[np.ndarray, np.ndarray],
    cell: tuple[np.ndarray, np.ndarray],
    resolution: tuple[int, int],
    cells: int,
) -> tuple[scipy.sparse.csr_array, ...]:
    """W per band, (receptor, ray); `from_first` is each ray's cell counted from receptor (0, 0)'s first cell."""
    margin = [(size - cells) // 2 for size in fields.shape[1:]]
    probability = density[cell]
    power = fields.sum(axis=(1, 2))
    rows: list[list[scipy.sparse.csr_array]] = [[] for _ in power]
    for i in range(resolution[0]):
        y = from_first[0] - i * cells + margin[0]
        x = from_first[1][None] - np.arange(resolution[1])[:, None] * cells + margin[1]
        inside = (y >= 0) & (y < fields.shape[1]) & (x >= 0) & (x < fields.shape[2])
        y, x = np.where(inside, y, 0), np.where(inside, x, 0)
        for band, field in enumerate(fields):
            w = np.where(inside, field[y, x], 0.0) / probability
            total = w.sum(axis=1, keepdims=True)
            if not (total > 0).all():
                raise ValueError("rays_per_receptor: a receptor has no ray in its receptive field; use more rays")
            rows[band].append(scipy.sparse.csr_array((w * (power[band] / total)).astype(np.float32)))
    return tuple(scipy.sparse.vstack(band, format="csr") for band in rows)


def negligible_share(eye: optics.Eye) -> float:
    """Share of a receptor's weights that can be left out: a share s changes a signal by a² s at most."""
    return min(NEGLIGIBLE * eye.noise_sigma / eye.throughput, eye.tolerance)
