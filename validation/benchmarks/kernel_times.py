"""CPU time of the kernels of evolving eyes.

    OPENBLAS_NUM_THREADS=1 python -m validation.benchmarks.kernel_times [genotypes]

The script prints the CPU seconds of one thread for `Eye.kernel` of new eyes, and the number of refused eyes. Before
that, a round with other eyes compiles Dr.Jit's kernels. The eyes develop from random genotypes of the preset `lens`,
whose relief has three genes (scale laptop) or sixteen (scale paper). Their fields of view are 45°, 20° and 10°. The
kernels have the cells on which receptive fields are tabulated.
"""

from __future__ import annotations

import sys
import time

import drjit as dr
import numpy as np

import optics
from evolve.config.assemble import assemble
from evolve.genome.genotype import Genotype
from evolve.genome.phenotype import develop
from sim.eyes.receptive_fields import cells_for

GENOTYPES, FIRST = 40, 10
VIEWS_DEG = (45.0, 20.0, 10.0)


def eyes(count: int, fov_deg: float, scale: str, seed: int) -> list[optics.Eye]:
    """Return eyes of random genotypes."""
    config = assemble(preset="lens", scale=scale, assignments=[f"genome.fov_deg.start={fov_deg}"])
    rng, dimension = np.random.default_rng(seed), Genotype(config.genome).dimension
    return [develop(rng.random(dimension), config).eyes(config.eye).eye() for _ in range(count)]


def seconds(eye: optics.Eye) -> float | None:
    """Return the CPU time [s] of an eye's kernel; None if the eye is refused."""
    start = time.process_time()
    try:
        eye.kernel(cells_for(eye))
    except optics.AccuracyError:
        return None
    return time.process_time() - start


def main(arguments: list[str]) -> None:
    """Print a row for each population."""
    dr.set_thread_count(1)
    count = int(arguments[0]) if arguments else GENOTYPES
    print("| genes | view [deg] | median [s] | 90 % [s] | worst [s] | refused |\n|---|---|---|---|---|---|")
    for scale in ("laptop", "paper"):
        for fov_deg in VIEWS_DEG:
            for eye in eyes(FIRST, fov_deg, scale, seed=1):
                seconds(eye)
            spent = [seconds(eye) for eye in eyes(count, fov_deg, scale, seed=0)]
            known = [each for each in spent if each is not None]
            median, most = np.quantile(known, (0.5, 0.9))
            refused = f"{len(spent) - len(known)} of {count}"
            print(f"| {scale} | {fov_deg:g} | {median:.3f} | {most:.3f} | {max(known):.2f} | {refused} |")


if __name__ == "__main__":
    main(sys.argv[1:])
