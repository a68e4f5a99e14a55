"""A lens found by gradient descent through the signals of an eye, in PyTorch.

The eye has 15 x 15 receptors behind a glass relief with 4 x 4 control points, which is flat at the start. The loss is
the difference between its signals and those of an eye with a perfect lens, for random scenes. Gradients of the loss
with respect to the heights pass through the receptors, the retina and the diffraction at the pupil.

    python examples/11_lens_through_an_eye.py [--steps 60]
"""

from __future__ import annotations

import argparse

import numpy as np
import torch

from rhabdom import optics
from rhabdom.optics.torch import eye_signals

RADIUS, INDEX = 30e-6, 1.5
SIDE, CELLS, BANDS = 15, 2, 2  # receptors along an axis, cells of a scene per receptor and axis, spectral bands
PERFECT = optics.Eye(resolution=(SIDE, SIDE), bands=BANDS)


def eye(heights: torch.Tensor) -> optics.Eye:
    """Return the eye behind a relief with control points of these heights [µm], (4, 4)."""
    pupil = optics.Pupil(RADIUS, optics.BSplineRelief(heights * 1e-6), n=INDEX)
    return optics.Eye(pupil, resolution=(SIDE, SIDE), bands=BANDS)


def scene(rng: np.random.Generator) -> np.ndarray:
    """Return the radiance (band, y, x) of grey checks with random widths of 1 to 5 cells."""
    side = SIDE * CELLS
    rows, columns = (rng.random(side).repeat(width)[:side] for width in rng.integers(1, 6, 2))
    return np.broadcast_to(np.outer(rows, columns), (BANDS, side, side))


def difference(seeing: optics.Eye, radiance: np.ndarray) -> torch.Tensor:
    """Return the mean square difference from the signals of a perfect lens, relative to the variance of the latter."""
    signals, wanted = eye_signals(seeing, radiance, CELLS), torch.from_numpy(PERFECT.see(radiance, CELLS))
    signals, wanted = signals / signals.mean(), wanted / wanted.mean()  # the relief transmits less light
    return (signals - wanted).square().mean() / wanted.var()


def find(steps: int) -> tuple[list[float], list[float]]:
    """Return the loss of each step, and the Strehl ratio at the start, in the middle and at the end."""
    heights = torch.zeros(4, 4, dtype=torch.float64, requires_grad=True)  # [µm]
    optimiser = torch.optim.Adam([heights])
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, 1.5, total_steps=steps)
    rng, losses, ratios = np.random.default_rng(0), [], [strehl(heights)]
    for step in range(steps):
        loss = difference(eye(heights), scene(rng))
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        schedule.step()
        losses.append(loss.item())
        if step + 1 in (steps // 2, steps):
            ratios.append(strehl(heights))
    return losses, ratios


def strehl(heights: torch.Tensor) -> float:
    """Return the Strehl ratio on the retina, averaged over the bands."""
    return float(np.mean(optics.strehl_ratio(eye(heights.detach()).psf())))


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--steps", type=int, default=60, help="steps of Adam, at least 2")
    losses, ratios = find(parser.parse_args().steps)
    tenth = max(len(losses) // 10, 1)
    print(f"difference from a perfect lens: {np.mean(losses[:tenth]):.2f} -> {np.mean(losses[-tenth:]):.2f}")
    print("Strehl ratio:", " -> ".join(f"{ratio:.2f}" for ratio in ratios))


if __name__ == "__main__":
    main()
