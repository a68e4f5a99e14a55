"""Extended depth of field: a phase mask and a network that removes its blur, trained together in PyTorch.

A camera lens (f = 10 mm, f/5) is in focus for objects at 0.5 m. Objects between 0.25 m and infinity are out of focus by
up to two dioptres. A glass mask at the pupil is optimised such that one network can remove the blur at all distances.
Masks and networks are trained with synthetic images of leaves that cover each other, whose statistics resemble those of
natural images (Lee, Mumford and Huang 2001), and judged by the peak signal-to-noise ratio (PSNR) of images and distances
that were not used in training. For comparison, a network is trained for the same lens without a mask.

    python examples/10_extended_depth.py [--steps 1000] [--plain] [--out extended_depth.png]

With --plain, a matrix DFT in plain PyTorch computes the PSFs during training. The judged images come from rhabdom.
"""

from __future__ import annotations

import argparse
import time

import numpy as np
import torch
from torch import nn

from rhabdom import optics
from rhabdom.optics.torch import psf

RADIUS, FOCAL_LENGTH, INDEX = 1e-3, 10e-3, 1.5
WAVELENGTHS = (610e-9, 540e-9, 460e-9)
PIXEL, SIDE = 5e-6, 33  # pitch of the sensor's pixels [m], pixels of a PSF along an axis
NEAREST = 2.0  # vergence of the nearest objects [dioptres]; the most distant ones are at infinity
SENSOR = 1 / (1 / FOCAL_LENGTH - NEAREST / 2)  # distance of the sensor [m]: half of this vergence is in focus
HEIGHTS, SIGMA = 24, 0.01  # samples of the mask along an axis; noise of the sensor, where white is 1
DISTANCES, WIDTH, TESTED, SMALLEST, FLATNESS = 8, 96, 16, 3, 0.5  # distances per step, pixels of an image along an axis, distances of the test


def camera(heights: torch.Tensor, vergences: torch.Tensor) -> torch.Tensor:
    """Return PSFs behind a mask of heights [µm], integrated over pixels, (distance, colour, y, x)."""
    mask = optics.HeightMap(heights * 1e-6)
    pupil = optics.Pupil(RADIUS, mask, n=INDEX, thin_lens_focal_length=FOCAL_LENGTH)
    view = {"dx": PIXEL, "shape": (SIDE, SIDE), "tolerance": 1e-2, "pixel_means": True}
    return psf(pupil, WAVELENGTHS, SENSOR, (1 / vergences).tolist(), **view).float() * PIXEL**2


def plain_camera(heights: torch.Tensor, vergences: torch.Tensor) -> torch.Tensor:
    """Return the same PSFs as `camera` by a Fresnel matrix DFT with 64 x 64 samples and four points per pixel."""
    at = torch.linspace(-1, 1, 65)[:-1] + 1 / 64
    square = at**2 + at[:, None] ** 2
    relief = nn.functional.interpolate(heights[None, None].float(), (64, 64), mode="bicubic")[0, 0]
    points = (torch.arange(4 * SIDE) - 2 * SIDE + 0.5) * PIXEL / 4
    colours = []
    for wavelength in WAVELENGTHS:
        k = 2 * torch.pi / wavelength
        path = (vergences[:, None, None] - NEAREST / 2) * RADIUS**2 * square / 2 + (INDEX - 1) * 1e-6 * relief
        pupil = torch.polar((square <= 1).float().expand_as(path), k * path)
        kernel = torch.polar(torch.tensor(RADIUS / 32), -k / SENSOR * RADIUS * torch.outer(points, at))
        light = (kernel @ pupil @ kernel.T / (wavelength * SENSOR)).abs().square() / (torch.pi * RADIUS**2)
        colours.append(nn.functional.avg_pool2d(light, 4) * PIXEL**2)
    return torch.stack(colours, 1)


def leaves(count: int, rng: np.random.Generator) -> torch.Tensor:
    """Return periodic images of discs that cover each other, (image, colour, y, x). Radii r have the density 1/r³."""
    y, x = np.mgrid[:WIDTH, :WIDTH]
    images = np.empty((count, 3, WIDTH, WIDTH), dtype=np.float32)
    for image in images:
        for _ in range(500):
            radius = SMALLEST / np.sqrt(rng.uniform((2 * SMALLEST / WIDTH) ** 2, 1))
            row, column = ((at - place + WIDTH / 2) % WIDTH - WIDTH / 2 for at, place in zip((y, x), rng.uniform(0, WIDTH, 2)))
            colour = np.clip(rng.beta(2, 2) + 0.1 * rng.normal(size=3), 0, 1)
            image[:, np.hypot(row, column) < radius] = colour[:, None]
    return torch.from_numpy(images)


def transfer(blur: torch.Tensor) -> torch.Tensor:
    """Return the optical transfer functions of PSFs for images of WIDTH pixels, (distance, colour, v, u)."""
    whole = nn.functional.pad(blur, (0, WIDTH - SIDE, 0, WIDTH - SIDE))
    return torch.fft.rfft2(whole.roll((-(SIDE // 2),) * 2, (2, 3)))


def photographed(scene: torch.Tensor, blur: torch.Tensor) -> torch.Tensor:
    """Return images (distance, colour, y, x) of a scene at each of the distances, with the noise of the sensor."""
    sharp = torch.fft.rfft2(scene)
    blurred = torch.fft.irfft2(transfer(blur) * sharp, s=(WIDTH, WIDTH))
    return blurred + SIGMA * torch.randn_like(blurred)


class Deblur(nn.Module):
    """A Wiener filter for all distances together, followed by a small convolutional network.

    Of all linear filters, the Wiener filter has the smallest mean square error over the distances of its PSFs.

    scenes: images with the statistics of those that are restored, (image, colour, y, x).
    """

    def __init__(self, scenes: torch.Tensor) -> None:
        super().__init__()
        spectrum = torch.fft.rfft2(scenes - scenes.mean((2, 3), keepdim=True)).abs().square()
        self.power = spectrum.mean((0, 1)) / WIDTH**2
        self.power[0, 0] = 1e3  # the mean of a scene is unknown
        layers = [convolution(6, 24), nn.ReLU(), convolution(24, 24), nn.ReLU(), convolution(24, 3)]
        self.correction = nn.Sequential(*layers)

    def forward(self, images: torch.Tensor, blur: torch.Tensor) -> torch.Tensor:
        """Return restored images. The filter depends on all PSFs, not on the distance of an image."""
        through = transfer(blur)
        received = self.power * through.abs().square().mean(0) + SIGMA**2
        wiener = self.power * through.mean(0).conj() / received
        sharp = torch.fft.irfft2(wiener * torch.fft.rfft2(images), s=(WIDTH, WIDTH))
        return sharp + self.correction(torch.cat((sharp, images), 1))


def convolution(inputs: int, outputs: int) -> nn.Conv2d:
    return nn.Conv2d(inputs, outputs, 3, padding=1, padding_mode="circular")


def trained(compute, heights: torch.Tensor, scenes: torch.Tensor, steps: int) -> tuple[torch.Tensor, Deblur]:
    """Return a mask and a network. Both are trained if `heights` requires gradients, otherwise only the network."""
    network = Deblur(scenes)
    groups = [{"params": list(network.parameters()), "lr": 2e-3}]
    if heights.requires_grad:
        groups.append({"params": [heights], "lr": 0.03})
    optimiser = torch.optim.Adam(groups)
    schedule = torch.optim.lr_scheduler.LambdaLR(optimiser, lambda step: 1 - step / steps)
    for _ in range(steps):
        inside = (torch.arange(1, DISTANCES - 1) + torch.rand(DISTANCES - 2) - 0.5) / (DISTANCES - 1)
        vergences = NEAREST * torch.cat((torch.zeros(1), inside, torch.ones(1)))
        blur = compute(heights, vergences.clamp(min=1e-3))
        scene = scenes[torch.randint(len(scenes), ())]
        error = (network(photographed(scene, blur), blur) - scene).square().mean((1, 2, 3))
        optimiser.zero_grad()
        (10 * error.log10() / FLATNESS).logsumexp(0).backward()  # emphasises the distances with the largest errors
        optimiser.step()
        schedule.step()
    return heights.detach(), network


@torch.no_grad()
def judged(heights: torch.Tensor, network: Deblur, scenes: torch.Tensor) -> tuple[np.ndarray, torch.Tensor]:
    """Return the PSNR [dB] and the first restored image at each of the tested distances."""
    blur = camera(heights, NEAREST * torch.linspace(1e-3, 1, TESTED))
    restored = torch.stack([network(photographed(scene, blur), blur).clamp(0, 1) for scene in scenes])
    error = (restored - scenes[:, None]).square().mean((0, 2, 3, 4))
    return (-10 * error.log10()).numpy(), restored[0]


def draw(ratios: dict[str, np.ndarray], images: dict[str, torch.Tensor], path: str) -> None:
    """Draw the PSNR over vergence, and images at three distances."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 1 + len(images), figsize=(4 * (1 + len(images)), 3.6), layout="constrained")
    vergences = NEAREST * (np.arange(TESTED) + 0.5) / TESTED
    for name, ratio in ratios.items():
        axes[0].plot(vergences, ratio, label=name)
    axes[0].set(xlabel="vergence of the object [dioptres]", ylabel="PSNR [dB]")
    axes[0].legend()
    for ax, (name, restored) in zip(axes[1:], images.items(), strict=True):
        row = torch.cat([restored[place] for place in (0, TESTED // 2, TESTED - 1)], 2)
        ax.imshow(row.permute(1, 2, 0).numpy())
        ax.set_title(name, fontsize="medium")
        ax.axis("off")
    figure.savefig(path, dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--steps", type=int, default=1000, help="training steps of the mask and its network")
    parser.add_argument("--plain", action="store_true", help="train with PSFs of plain PyTorch")
    parser.add_argument("--out", help="save a figure to this file")
    arguments = parser.parse_args()
    torch.manual_seed(0)
    rng = np.random.default_rng(0)
    scenes, unseen = leaves(96, rng), leaves(16, rng)
    compute = plain_camera if arguments.plain else camera
    flat = torch.zeros(HEIGHTS, HEIGHTS, dtype=torch.float64)
    ratios, images = {}, {}
    for name, start in {"mask and network": flat.clone().requires_grad_(), "lens and network": flat}.items():
        began = time.process_time()
        heights, network = trained(compute, start, scenes, arguments.steps)
        took = time.process_time() - began
        ratios[name], images[name] = judged(heights, network, unseen)
        worst, best = ratios[name].min(), ratios[name].max()
        print(f"{name}: {worst:.1f} to {best:.1f} dB over distance, {took:.0f} CPU seconds", flush=True)
    if arguments.out:
        draw(ratios, images, arguments.out)
        print(f"drawn to {arguments.out}")


if __name__ == "__main__":
    main()
