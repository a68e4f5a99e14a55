"""Number of samples for integrals over cells: `python -m validation.optics.cell_samples [genotypes]`.

For random genotypes of the preset `lens`, each wavelength's PSF is computed with twice the stated samples per cycle of
its highest frequency. Integrals over the eye's cells from every second sample are compared with those from all samples.
The script prints the relative error by the number of cycles per cell: the median, the 90 % quantile, and the largest of
all PSFs.
"""

from __future__ import annotations

import sys
from itertools import pairwise

import numpy as np

import optics
from optics.eye import visual_kernel
from optics.eye.cell_integrals import Tiles, cell_integrals, samples_per_cycle
from optics.eye.visual_kernel import BESIDE, beams_to, spot_of
from optics.point_spread.pictures import pictures
from sim.eyes.receptive_fields import cells_for
from validation.benchmarks.kernel_times import VIEWS_DEG, eyes

GENOTYPES = 20
SAMPLES = (1.75, 2.0, 2.125, 2.25, 2.375, 2.625)  # per cycle
CYCLES = (0.0, 0.5, 1.0, 2.0, 9.0)  # per cell: limits of classes


def errors(eye: optics.Eye, samples: float) -> list[tuple[float, float]]:
    """Return cycles per cell and relative error of the integrals, for each of the eye's wavelengths."""
    assert eye.pupil is not None
    retina = eye._retina(cells_for(eye))
    beams = beams_to(eye.pupil, retina, np.inf, (0.0, 0.0))
    spot, own = spot_of(beams, retina), samples_per_cycle(retina.tolerance)
    tiles = Tiles(spot.cells(retina.cell), retina.cell, False)
    pitches = [need.pitch * own / (2 * samples) for need in spot.needs]
    requests = [
        visual_kernel._request(beam, spot, need, spot.window(pitch, 2 * BESIDE), retina)
        for beam, need, pitch in zip(beams, spot.needs, pitches, strict=True)
    ]
    found = []
    for request, picture in zip(requests, pictures(requests), strict=True):
        window = request.problem.window
        image = picture.image.numpy().reshape(window.shape).astype(float)
        if window.shape[0] // 2 % 2:  # both sets must end at the same sample and contain the middle
            image = image[1:-1, 1:-1]
        few = _integrals(image[::2, ::2], 2 * window.dx, tiles)
        many = _integrals(image, window.dx, tiles)
        error = np.linalg.norm(few - many) / np.linalg.norm(many)
        found.append((retina.cell / (window.dx * 2 * samples), float(error)))
    return found


def _integrals(image: np.ndarray, pitch: float, tiles: Tiles) -> np.ndarray:
    across = cell_integrals(len(image), pitch, tiles)
    summed: np.ndarray = across @ image @ across.T
    return summed


def main(arguments: list[str]) -> None:
    """Print a row for each number of samples and size of cell."""
    count = int(arguments[0]) if arguments else GENOTYPES
    everyone = [eye for scale in ("laptop", "paper") for view in VIEWS_DEG for eye in eyes(count, view, scale, seed=3)]
    print("| samples per cycle | cycles per cell | PSFs | median | 90 % | worst |\n|---|---|---|---|---|---|")
    for samples in SAMPLES:
        rows = []
        for eye in everyone:
            try:
                rows += errors(eye, samples)
            except optics.AccuracyError:
                continue  # its light is too extended for twice the samples
        for least, most in pairwise(CYCLES):
            some = [error for cycles, error in rows if least <= cycles < most]
            if some:
                median, ninety = np.quantile(some, (0.5, 0.9))
                held = f"{least:g} to {most:g}"
                print(
                    f"| {samples:g} | {held} | {len(some)} | {median:.0e} | {ninety:.0e} | {max(some):.0e} |",
                    flush=True,
                )


if __name__ == "__main__":
    main(sys.argv[1:])
