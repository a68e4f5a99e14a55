"""Convolution over the ommatidia of a compound eye, in two layers with the same weights everywhere in the eye.

A unit of the first layer receives the signals of seven ommatidia: a central one and its six neighbours. A unit of the
second layer receives the outputs of seven units of the first layer in the same way. The centres are chosen so that
every ommatidium is in at least one neighbourhood. On a hexagonal lattice, neighbourhoods are hexagons. The first layer
then has about a quarter as many neighbourhoods as there are ommatidia, and the second layer has about a quarter as many
as the first. The viewing directions of the ommatidia may also form other patterns.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from scipy.spatial import KDTree
from torch import Tensor, nn

from evolve.learning.per_eye_layers import AdaptedLinear, PerEyeLinear
from sim.eyes.viewing_directions import unit_directions

__all__ = ["HexagonalLayers", "directions_from_record", "neighbourhoods"]

NEIGHBOURS = 7  # a place and its six neighbours
WIDTHS = 8, 16  # choice: number of units at each place, in the first and the second layer


class SharedAdaptation(AdaptedLinear):
    """AdaptedLinear whose normalisation uses the same variance of signals for all neighbourhoods of ommatidia.

    Noise in dark parts of the view is therefore not amplified.
    """

    @torch.no_grad()
    def adapt(self, x: Tensor) -> None:
        """Update the running means and the running variance with further signals.

        Each input of each neighbourhood has its own mean. All inputs have the same variance.

        x: signals (neighbourhood, input, sample); a neighbourhood is an ommatidium and its six neighbours, and its
            inputs are the signals of all their channels
        """
        super().adapt(x)
        self.variance.copy_(self.variance.mean(dim=0, keepdim=True).expand_as(self.variance))


class HexagonalLayers(nn.Module):
    """Map of frames (..., ommatidium, channel) to features (sample, feature).

    directions: viewing directions, unit vectors (ommatidium, 3)
    channels: number of signals of an ommatidium
    units: class of the nonlinear units, such as nn.LeakyReLU

    The attribute `outputs` is the number of features.
    """

    def __init__(self, directions: np.ndarray, channels: int, units: type[nn.Module]) -> None:
        super().__init__()
        first = neighbourhoods(directions)
        second = neighbourhoods(np.asarray(directions)[first[:, 0]])
        for name, places in (("first", first), ("second", second)):
            self.register_buffer(name, torch.from_numpy(places), persistent=False)
        self.outputs = len(second) * WIDTHS[1]
        self.convolution = SharedAdaptation(len(first), first.shape[1] * channels, WIDTHS[0], shared=True)
        self.combination = PerEyeLinear(len(second), second.shape[1] * WIDTHS[0], WIDTHS[1], shared=True)
        self.units = units(inplace=True)

    def forward(self, frames: Tensor) -> Tensor:
        codes = self.units(self.convolution(self._gathered(frames)))
        features = self.units(self.combination(codes[self.second].flatten(1, 2)))
        return features.flatten(0, 1).T

    def adapt(self, frames: Tensor) -> None:
        """Update the running means and the variance with further frames (..., ommatidium, channel)."""
        self.convolution.adapt(self._gathered(frames))

    def _gathered(self, frames: Tensor) -> Tensor:
        """Return the signals of each neighbourhood of the first layer: an ommatidium and its six neighbours.

        The result has the axes (neighbourhood, input, sample). The inputs are the pairs (ommatidium of the
        neighbourhood, channel) in row-major order.

        frames: signals of all ommatidia, (..., ommatidium, channel); the leading axes become samples
        """
        samples = frames.flatten(0, -3).permute(1, 2, 0)
        return samples[self.first].flatten(1, 2)


def neighbourhoods(directions: np.ndarray) -> np.ndarray:
    """Return the indices of the directions in each neighbourhood, the centre first, (neighbourhood, 7).

    The six neighbours are in counter-clockwise order, as the animal sees them, beginning on the right. Every direction
    is in at least one neighbourhood. If there are fewer than seven directions, all belong to a single neighbourhood,
    and the result is (1, ommatidium).

    directions: unit vectors, (ommatidium, 3)
    """
    directions = np.asarray(directions, float)
    count = min(NEIGHBOURS, len(directions))
    tree = KDTree(directions)
    near = tree.query(directions, k=count)[1].reshape(len(directions), count)
    centres, covered = [], np.zeros(len(directions), bool)
    for place in np.argsort(((directions - directions[0]) ** 2).sum(axis=1), kind="stable"):
        if not covered[place]:
            centres.append(int(place))
            covered[near[place]] = True
    return np.stack([_in_order(directions, near[centre]) for centre in centres])


def _in_order(directions: np.ndarray, near: np.ndarray) -> np.ndarray:
    """Return `near` with the centre, its first entry, unchanged, and the neighbours sorted by angle around it."""
    ahead, left, _ = directions[near[0]]
    level = np.hypot(ahead, left)
    rightwards = np.array([left, -ahead, 0]) / level if level > 0 else np.array([0.0, -1.0, 0.0])
    upwards = np.cross(rightwards, directions[near[0]])
    offsets = directions[near[1:]] - directions[near[0]]
    # Azimuths count from -30 degrees, so that a neighbour on the right is first, even after rounding.
    azimuths = (np.arctan2(offsets @ upwards, offsets @ rightwards) + np.pi / 6) % (2 * np.pi)
    return np.concatenate([near[:1], near[1:][np.argsort(azimuths, kind="stable")]])


def directions_from_record(stored: Mapping[str, Any]) -> tuple[tuple[float, ...], ...]:
    """Return the viewing directions of ommatidia for which a policy was trained; () for eyes without ommatidia.

    stored: record of the policy's shape, see `PolicyConfig.record`

    Raises:
        ValueError: the directions do not fit the shape of the eyes, or are not unit vectors.
        KeyError: the record has no shape of the eyes.
        TypeError: a value has the wrong type.
    """
    found = tuple(tuple(float(part) for part in way) for way in stored.get("directions", ()))
    if len(stored["eyes"]) != (3 if found else 5) or (found and len(found) != int(stored["eyes"][1])):
        raise ValueError(f"{len(found)} directions do not fit eyes of the shape {stored['eyes']}")
    if any(len(way) != 3 for way in found):
        raise ValueError("directions: must be unit vectors (ahead, left, up)")
    if found:
        unit_directions("directions", found)
    return found
