"""Random streams: one per world and purpose, so that a world's episodes do not depend on its neighbours."""

from __future__ import annotations

from functools import cached_property

import numpy as np

AHEAD = 64  # actions: a call per world and action costs more than the numbers


class Streams:
    """For every world i: `placement[i]`, `light[i]`, a part of `motion` and a key for its noise, children of one seed
    that depend on the seed, i and the purpose alone; never on the number of worlds.

    noise_keys: (n,) uint64, for sim.render.receptor_noise
    """

    def __init__(self, seed: int | None, n: int) -> None:
        root = np.random.SeedSequence(seed)
        self.seed = root.entropy

        def children(purpose: int) -> list[np.random.SeedSequence]:
            return [np.random.SeedSequence(root.entropy, spawn_key=(i, purpose)) for i in range(n)]

        self.placement, motion = (
            [np.random.Generator(np.random.PCG64(child)) for child in children(purpose)] for purpose in (0, 1)
        )
        self.motion = MotionNoise(motion)
        self._of_light = children(3)
        self.noise_keys = np.array([child.generate_state(1, np.uint64)[0] for child in children(2)])

    @cached_property
    def light(self) -> list[np.random.Generator]:
        """Of what light an episode has."""
        return [np.random.Generator(np.random.PCG64(child)) for child in self._of_light]


class MotionNoise:
    """What chance does to movers: for every action of every world, numbers from the world's own generator."""

    def __init__(self, generators: list[np.random.Generator]) -> None:
        self._generators = generators
        self._drawn = np.empty((0, 2, len(generators), 0))

    def next(self, movers: int) -> tuple[np.ndarray, np.ndarray]:
        """Of the next action: standard normal numbers, and others uniform in [-1, 1), (n, movers) each."""
        if not len(self._drawn):
            shape = (AHEAD, movers)
            of_worlds = [(rng.standard_normal(shape), rng.uniform(-1, 1, shape)) for rng in self._generators]
            self._drawn = np.ascontiguousarray(np.transpose(of_worlds, (2, 1, 0, 3)))
        (normal, uniform), self._drawn = self._drawn[0], self._drawn[1:]
        return normal, uniform
