"""Adaptive edge sampling: many rays for receptors that see an edge, few for others.

It requires a perfect lens, and is chosen automatically only for user models. Four rays through a receptor's square test
whether the square is uniform (Whitted 1980 compares a pixel's corners). If the four signals differ, all rays are
traced. An edge may also pass between the four rays and cut off a corner, at most a quarter of the square. The surface
beyond such an edge usually fills a neighbouring square. All rays are therefore also traced for receptors that differ
strongly from a neighbour. For this comparison, four rays are also traced through each square just beyond the rim of the
field. A receptor misses a surface that lies between its four rays, unless the surface fills a neighbouring square.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from optics.numerics.autodiff import Array
from sim.eyes.sampling import BoxSampling, beyond_rim_of
from sim.render.ray_kernel import Frame, KernelInputs, RayKernel
from sim.scene.device_arrays import as_whole_numbers
from sim.scene.frozen_kernels import FrozenKernel

Launch = Callable[[Any, KernelInputs], Callable[[], np.ndarray]]  # the result waits for the kernel
FIRST = 4  # number of first rays, which are traced through every receptor's square


class EdgeRays:
    """Sums of the light over each receptor's rays, with many rays only for receptors that see an edge.

    An edge is a border between surfaces of different brightness or colour. Four rays are traced for every receptor. The
    full number of rays is traced if the four signals differ, or if the receptor's signal differs strongly from the
    signal of a neighbouring receptor. The result approximates the sums of `RayKernel.sums`, for which every receptor
    has the full number of rays.

    kernel: kernel that traces the rays
    sampling: rule by which the directions of the receptors' rays are chosen
    rays: full number of rays, for a receptor that sees an edge
    signals: contribution of a component of light to the signal of each type of receptor, (channel, component)
    noticed: largest difference at which the signals of two rays still count as equal
    """

    def __init__(
        self, kernel: RayKernel, sampling: BoxSampling, rays: float, signals: np.ndarray, noticed: float
    ) -> None:
        fine = sampling.sensor(rays)
        self._kernel, self._rays, self._noticed = kernel, fine.rays_per_receptor, noticed
        self._beyond = beyond_rim_of(sampling.eye.resolution)
        self._signals = [[float(worth) for worth in channel] for channel in signals]
        self._coarse, self._fine = FrozenKernel(self._render_all), FrozenKernel(self._render_edges)
        first = np.concatenate([sampling.sensor(FIRST).directions, sampling.beyond_rim(FIRST)])
        self._first, self._along = kernel.inputs(first), kernel.inputs(fine.directions)

    def launch(self, launch: Launch) -> Callable[[], np.ndarray]:
        """Start rendering, and return a function that waits for, and returns, each receptor's sums of light over rays.

        A receptor has 4 rays or, if it sees an edge, more. A sum over more rays is scaled to 4 rays: it is multiplied
        by 4 and divided by the number of rays. All receptors are then comparable. The worlds must not change before the
        sums are read. The sums are a flat array (component, world, eye, receptor).

        launch: function that launches a `FrozenKernel` with its inputs, and returns a function that waits for the
            result
        """
        found = launch(self._coarse, self._first)
        return lambda: self._refined(found(), launch)

    @property
    def recordings(self) -> int:
        """Number of times that the kernels were recorded."""
        return self._coarse.n_recordings + self._fine.n_recordings

    def _refined(self, found: np.ndarray, launch: Launch) -> np.ndarray:
        cells = found.reshape(len(found), -1, self._beyond.size)  # (component or spread, view, receptor or beyond)
        receptors = np.count_nonzero(~self._beyond)
        light, spread = cells[:-1, :, :receptors].reshape(len(found) - 1, -1), cells[-1, :, :receptors].ravel()
        edges = np.flatnonzero((spread > self._noticed) | self._beside_edges(cells[:-1]))
        if len(edges):
            lanes = (self._rays * edges[:, None] + np.arange(self._rays)).ravel()
            inputs = replace(self._along, lanes=mi.UInt32(as_whole_numbers(lanes)))
            light[:, edges] = launch(self._fine, inputs)() * (FIRST / self._rays)
        return light.ravel()

    def _beside_edges(self, light: np.ndarray) -> np.ndarray:
        """Return a mask that is True for receptors whose signal differs strongly from that of a neighbour.

        Only four rays have been traced for each receptor, and an edge between two surfaces may pass unnoticed between
        them. Each receptor covers a square of the visual field. Receptors at the rim of the visual field are also
        compared with squares of the same size just outside it. The mask is a flat array (view, receptor).

        light: sums of the light over the four rays of each square, array (component, view, square). The squares are the
            receptors' squares and the squares just outside the visual field
        """
        means = np.tensordot(np.array(self._signals), light, 1) / FIRST
        field = np.empty((*means.shape[:2], *self._beyond.shape), means.dtype)
        field[..., ~self._beyond], field[..., self._beyond] = np.split(means, [np.count_nonzero(~self._beyond)], axis=2)
        far = FIRST * self._noticed
        found = np.zeros(field.shape[1:], bool)
        for y, x in ((0, 1), (1, 0), (1, 1), (1, -1)):
            one, other = _shifted(y, x), _shifted(-y, -x)
            apart = (np.abs(field[:, :, *one] - field[:, :, *other]) > far).any(axis=0)
            found[:, *one] |= apart
            found[:, *other] |= apart
        return found[:, 1:-1, 1:-1].ravel()

    def _render_all(self, scenes: Any, frame: Frame, inputs: KernelInputs) -> tuple[Array, ...]:
        """Return, for each square, the sums of light over its four rays, and how much the signals of these rays differ.

        Each receptor covers a square of the visual field. Squares of the same size just outside the visual field are
        included. The four rays test whether a square contains an edge. There is one array of sums for each component of
        the light's spectrum. The last array contains the difference between the largest and the smallest signal of the
        four rays, for the type of receptor for which it is largest.
        """
        components = self._kernel.layers(scenes, frame, inputs)
        signals = [sum(w * c for w, c in zip(worth, components, strict=True)) for worth in self._signals]
        dr.eval(components, signals)  # otherwise each component's sums would trace all rays again
        spread = mi.Float(0)
        for signal in signals:
            highest, lowest = (dr.block_reduce(op, signal, FIRST) for op in (dr.ReduceOp.Max, dr.ReduceOp.Min))
            spread = dr.maximum(spread, highest - lowest)
        return *_sums(components, FIRST), spread

    def _render_edges(self, scenes: Any, frame: Frame, inputs: KernelInputs) -> tuple[Array, ...]:
        """Return sums of light over the rays of each receptor that sees an edge, one array per component of light.

        Only these receptors are rendered again, with the full number of rays.
        """
        components = self._kernel.layers(scenes, frame, inputs)
        dr.eval(components)
        return _sums(components, self._rays)


def _shifted(y: int, x: int) -> tuple[slice, slice]:
    """Return slices (rows, columns) of the receptors that have a neighbour y rows below and x columns to the right."""
    return slice(max(-y, 0), -y if y > 0 else None), slice(max(-x, 0), -x if x > 0 else None)


def _sums(components: list[Array], rays: int) -> tuple[Array, ...]:
    return tuple(dr.block_reduce(dr.ReduceOp.Add, component, rays) for component in components)


def edges_pay(resolution: tuple[int, int], rays: float) -> bool:
    """Return whether adaptive edge sampling is likely to save rays.

    Adaptive edge sampling first traces four rays for every receptor, and for further squares of a receptor's size just
    beyond the rim of the retina. It then traces the full number of rays, but only for receptors that see an edge.
    Return True if the rays of the first step are at most half as many as all rays without adaptive sampling. If they
    are more, a few receptors that see an edge may use up what is saved at the others.

    resolution: number of rows and of columns of receptors
    rays: number of rays per receptor without adaptive sampling
    """
    return 2 * FIRST * beyond_rim_of(resolution).size <= rays * resolution[0] * resolution[1]
