"""Random streams: one per world and purpose, so that a world's episodes do not depend on its neighbours."""

from __future__ import annotations

import numpy as np


class Streams:
    """For every world i: `placement[i]`, `motion[i]` and a key for its noise, children of one seed that depend on the
    seed, i and the purpose alone; never on the number of worlds.

    noise_keys  (n,) uint64, for sim.noise
    """

    def __init__(self, seed: int | None, n: int) -> None:
        root = np.random.SeedSequence(seed)
        self.seed = root.entropy

        def children(purpose: int) -> list[np.random.SeedSequence]:
            return [np.random.SeedSequence(root.entropy, spawn_key=(i, purpose)) for i in range(n)]

        self.placement, self.motion = (
            [np.random.Generator(np.random.PCG64(child)) for child in children(purpose)] for purpose in (0, 1)
        )
        self.noise_keys = np.array([child.generate_state(1, np.uint64)[0] for child in children(2)])
