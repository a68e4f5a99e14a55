"""A phase plate by gradient descent in PyTorch: the same image quality at three distances and three wavelengths.

A lens is in focus at one distance of the sensor. The script optimises a plate in front of the lens, a map of 12 x 12
heights. The aim is a share of the light on the middle 3 x 3 pixels that is large and equal at three distances. Each
call of `optics.torch.psf` returns all nine PSFs, integrated over the pixels.

    python examples/07_three_distances_in_torch.py
"""

from __future__ import annotations

import torch

from rhabdom import optics
from rhabdom.optics.torch import psf

RADIUS, FOCAL_LENGTH, PIXEL = 30e-6, 240e-6, 2e-6
WAVELENGTHS = [480e-9, 550e-9, 620e-9]
DISTANCES = [200e-6, 240e-6, 310e-6]
STEPS = 25


def shares(heights_um: torch.Tensor) -> torch.Tensor:
    """Return the share of the light on the middle 3 x 3 pixels, (distance, wavelength)."""
    plate = optics.Pupil(RADIUS, optics.HeightMap(heights_um * 1e-6), thin_lens_focal_length=FOCAL_LENGTH)
    view = {"dx": PIXEL, "shape": (9, 9), "tolerance": 1e-2, "pixel_means": True}
    images = psf(plate, WAVELENGTHS, DISTANCES, **view)
    return images[..., 3:6, 3:6].sum((-2, -1)) * PIXEL**2


def main() -> None:
    heights = torch.zeros(12, 12, dtype=torch.float64, requires_grad=True)  # [µm]
    optimiser = torch.optim.Adam([heights], lr=0.06)
    for step in range(STEPS + 1):
        light = shares(heights)
        if step in (0, STEPS):
            worst, best = (100 * end for end in (light.min().item(), light.max().item()))
            print(f"step {step:2d}: the middle pixels receive {worst:.0f} to {best:.0f} % of the light")
        optimiser.zero_grad()
        (-light.log().sum()).backward()
        optimiser.step()


if __name__ == "__main__":
    main()
