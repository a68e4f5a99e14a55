"""Many rays where a receptor sees an edge, few elsewhere: perfect lenses on models of one's own.

Four rays through a receptor's square tell whether all of it looks alike (Whitted 1980 asks a pixel's corners); where
they differ, all rays are traced. An edge may pass between them and cut off a corner, a quarter of the square at most.
Whatever is beyond it fills a neighbour, so receptors that are very unlike a neighbour get all rays, too. Missed is what
reaches into a corner from beyond the field's rim, and what is smaller than the gaps between four rays.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

import optics
from optics.numerics.autodiff import Array
from sim.eyes.sensor import BoxSensor
from sim.render.fidelity_stages import LEAST_TOLERANCE, SHARE_OF_NOISE
from sim.robots.model_wavefront import ModelWavefront
from sim.robots.poses import Poses
from sim.scene.device_arrays import as_whole_numbers
from sim.scene.variant import MitsubaObject

FIRST = 4  # rays through every receptor's square


class EdgeRays:
    """What `ModelWavefront.light` finds with `fine`'s rays, from fewer.

    wavefront: of a sensor with FIRST rays per receptor
    fine: the sensor whose rays are traced at edges
    signals: what a component is worth to each type of receptor, (channel, component)
    noticed: rays whose signals differ by no more are alike
    resolution: receptors (height, width)
    """

    def __init__(
        self,
        wavefront: ModelWavefront,
        fine: BoxSensor,
        signals: np.ndarray,
        noticed: float,
        resolution: tuple[int, int],
    ) -> None:
        self._wavefront, self._rays, self._noticed = wavefront, fine.rays_per_receptor, noticed
        self._resolution = resolution
        self._signals = [[float(worth) for worth in channel] for channel in signals]
        self._coarse: Any = dr.freeze(lambda *args: self._look_once(*args))
        self._fine: Any = dr.freeze(lambda *args: self._look_again(*args))
        self._along = wavefront.look(fine.directions)

    def launch(self, look: dict[str, Array], poses: Poses, eyes: np.ndarray) -> Callable[[], np.ndarray]:
        """Start to look; what is returned waits for it: sums over FIRST rays, flat (component, world, eye, receptor),
        as if so many were traced everywhere."""
        found = self._wavefront.launch(self._coarse, look, poses, eyes)
        return lambda: self._refined(found())

    @property
    def recordings(self) -> int:
        """How often the kernels were recorded."""
        return int(self._coarse.n_recordings + self._fine.n_recordings)

    def _refined(self, found: np.ndarray) -> np.ndarray:
        light, spread = found[:-1], found[-1]
        edges = np.flatnonzero((spread > self._noticed) | self._beside_edges(light))
        if len(edges):
            lanes = (self._rays * edges[:, None] + np.arange(self._rays)).ravel()
            look = {**self._along, "lanes": mi.UInt32(as_whole_numbers(lanes))}
            light[:, edges] = self._wavefront.again(self._fine, look)() * (FIRST / self._rays)
        return light.ravel()

    def _beside_edges(self, light: np.ndarray) -> np.ndarray:
        """Receptors so unlike a neighbour that an edge may run between the first rays of either, flat."""
        means = (np.array(self._signals) @ light / FIRST).reshape(len(self._signals), -1, *self._resolution)
        far = FIRST * self._noticed
        found = np.zeros(means.shape[1:], bool)
        for y, x in ((0, 1), (1, 0), (1, 1), (1, -1)):
            one, other = _shifted(y, x), _shifted(-y, -x)
            apart = (np.abs(means[:, :, *one] - means[:, :, *other]) > far).any(axis=0)
            found[:, *one] |= apart
            found[:, *other] |= apart
        return found.ravel()

    def _look_once(
        self, still: MitsubaObject, meshes: list[MitsubaObject], buffers: dict[str, Array], look: dict[str, Array]
    ) -> tuple[Array, ...]:
        """Sums over each receptor's rays, per component, and how far apart their signals are."""
        components, _ = self._wavefront.components(still, buffers, look)
        signals = [sum(w * c for w, c in zip(worth, components, strict=True)) for worth in self._signals]
        dr.eval(components, signals)  # once, as sums of neighbours would trace all rays again for every component
        spread = mi.Float(0)
        for signal in signals:
            highest, lowest = (dr.block_reduce(op, signal, FIRST) for op in (dr.ReduceOp.Max, dr.ReduceOp.Min))
            spread = dr.maximum(spread, highest - lowest)
        return *_sums(components, FIRST), spread

    def _look_again(
        self, still: MitsubaObject, meshes: list[MitsubaObject], buffers: dict[str, Array], look: dict[str, Array]
    ) -> tuple[Array, ...]:
        """Sums over the rays of the receptors that are looked at again, per component."""
        components, _ = self._wavefront.components(still, buffers, look)
        dr.eval(components)
        return _sums(components, self._rays)


def _shifted(y: int, x: int) -> tuple[slice, slice]:
    """All but the last rows and columns; from the other end where a shift is negative."""
    return slice(max(-y, 0), -y if y > 0 else None), slice(max(-x, 0), -x if x > 0 else None)


def _sums(components: list[Array], rays: int) -> tuple[Array, ...]:
    return tuple(dr.block_reduce(dr.ReduceOp.Add, component, rays) for component in components)


def allowed_error(eye: optics.Eye, tolerance: float | None) -> float:
    """Of a signal (root mean square), where None is asked for: half of the receptors' noise, but no less than
    LEAST_TOLERANCE of what white is worth behind the eye's pupil.

    Raises:
        ValueError: a tolerance that is not positive.
    """
    if tolerance is None:
        return max(SHARE_OF_NOISE * eye.noise_sigma, LEAST_TOLERANCE * float(eye.throughput))
    if not 0 < tolerance < np.inf:
        raise ValueError(f"tolerance = {tolerance!r}: must be positive")
    return tolerance
