"""Random streams: one per world and purpose, so that a world's episodes do not depend on its neighbours."""

from __future__ import annotations

import numpy as np


class Streams:
    """For every world i: `placement[i]`, `motion[i]` and `noise[i]`, children of one seed that depend on the seed,
    i and the purpose alone; never on the number of worlds."""

    def __init__(self, seed: int | None, n: int) -> None:
        root = np.random.SeedSequence(seed)
        self.seed = root.entropy
        self.placement, self.motion, self.noise = (
            [
                np.random.Generator(np.random.PCG64(np.random.SeedSequence(root.entropy, spawn_key=(i, purpose))))
                for i in range(n)
            ]
            for purpose in range(3)
        )
