"""Extended depth of field: a phase mask and a network that removes its blur, trained together in PyTorch.

A camera lens (f = 10 mm, f/5) is in focus for objects at 1 m. Objects at 0.5 m and at infinity are out of focus by one
dioptre. A glass mask at the pupil makes the blur almost equal at all distances, so that one filter and one network can
remove it without knowing the distance. The mask starts as a weak cubic phase plate (Dowski and Cathey 1995). Mask and
network are then trained end to end, as by Sitzmann et al. (2018).

The scenes are synthetic images of leaves that cover each other, with statistics that resemble those of natural images
(Lee, Mumford and Huang 2001). New scenes at other distances are restored to judge the result by the peak
signal-to-noise ratio (PSNR). Two other cameras are trained with the same number of steps: the lens without a mask, and
a mask whose PSFs come from thirty lines of plain PyTorch during training. All judged images use the PSFs of rhabdom.

    python examples/10_extended_depth.py [--steps 120] [--out extended_depth.png]
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np
import torch
from torch import nn

from rhabdom import optics
from rhabdom.optics.torch import psf

RADIUS, FOCAL_LENGTH, INDEX = 1e-3, 10e-3, 1.5
WAVELENGTHS = (610e-9, 540e-9, 460e-9)
PIXEL, SIDE = 5e-6, 25  # pitch of the sensor's pixels [m], pixels of a PSF along an axis
SIGMA = 0.01  # standard deviation of the sensor's noise, where white is 1
NEAREST = 2.0  # vergence of the nearest objects [dioptres]; the most distant ones are at infinity
SENSOR = 1 / (1 / FOCAL_LENGTH - NEAREST / 2)  # distance of the sensor [m]: half of this vergence is in focus
HEIGHTS, CUBIC = 24, 0.5  # heights of the mask along an axis; coefficient of the first mask [µm]
WIDTH, SMALLEST = 64, 3  # pixels of a scene along an axis; radius of the smallest leaves [pixels]
DISTANCES, TESTED = 8, 16  # distances per step, distances of the test
FLATNESS = 3.0  # weight of the standard deviation over distances, relative to the mean, of the error in decibels

Camera = Callable[[torch.Tensor, torch.Tensor], torch.Tensor]


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


def cubic() -> torch.Tensor:
    """Return the heights [µm] of the first mask."""
    at = (torch.arange(HEIGHTS, dtype=torch.float64) + 0.5) / HEIGHTS * 2 - 1
    return CUBIC * (at**3 + at[:, None] ** 3)


def leaves(count: int, rng: np.random.Generator) -> torch.Tensor:
    """Return periodic images of discs that cover each other, (image, colour, y, x). Radii r have the density 1/r³."""
    y, x = np.mgrid[:WIDTH, :WIDTH]
    images = np.full((count, 3, WIDTH, WIDTH), 0.5, dtype=np.float32)
    for image in images:
        for _ in range(300):
            radius = SMALLEST / np.sqrt(rng.uniform((2 * SMALLEST / WIDTH) ** 2, 1))
            row, column = ((at - rng.uniform(0, WIDTH)) % WIDTH - WIDTH / 2 for at in (y, x))
            colour = np.clip(rng.beta(2, 2) + 0.1 * rng.normal(size=3), 0, 1)
            image[:, np.hypot(row, column) < radius] = colour[:, None]
    return torch.from_numpy(images)


def transfer(blur: torch.Tensor) -> torch.Tensor:
    """Return the optical transfer functions of PSFs for images of WIDTH pixels, (distance, colour, v, u)."""
    whole = nn.functional.pad(blur, (0, WIDTH - SIDE, 0, WIDTH - SIDE))
    return torch.fft.rfft2(whole.roll((-(SIDE // 2),) * 2, (2, 3)))


def photographed(scene: torch.Tensor, blur: torch.Tensor) -> torch.Tensor:
    """Return images (distance, colour, y, x) of a scene at each of the distances, with the noise of the sensor."""
    blurred = torch.fft.irfft2(transfer(blur) * torch.fft.rfft2(scene), s=(WIDTH, WIDTH))
    return blurred + SIGMA * torch.randn_like(blurred)


class Deblur(nn.Module):
    """A Wiener filter for all distances together, followed by a small convolutional network.

    Of all linear filters, the Wiener filter has the smallest mean square error over scenes and distances.

    scenes: images with the statistics of those that will be restored, (image, colour, y, x).
    """

    def __init__(self, scenes: torch.Tensor) -> None:
        super().__init__()
        self.power = torch.fft.rfft2(scenes).abs().square().mean((0, 1)) / WIDTH**2  # spectrum of the scenes
        same = {"kernel_size": 3, "padding": 1, "padding_mode": "circular"}
        first, second, last = nn.Conv2d(6, 24, **same), nn.Conv2d(24, 24, **same), nn.Conv2d(24, 3, **same)
        self.correction = nn.Sequential(first, nn.ReLU(), second, nn.ReLU(), last)

    def forward(self, images: torch.Tensor, blur: torch.Tensor) -> torch.Tensor:
        """Return restored images. The filter depends on the PSFs of all distances, not on that of an image."""
        through = transfer(blur)
        wiener = self.power * through.mean(0).conj() / (self.power * through.abs().square().mean(0) + SIGMA**2)
        sharp = torch.fft.irfft2(wiener * torch.fft.rfft2(images), s=(WIDTH, WIDTH))
        return sharp + self.correction(torch.cat((sharp, images), 1))


def trained(compute: Camera, heights: torch.Tensor, scenes: torch.Tensor, steps: int) -> tuple[torch.Tensor, Deblur]:
    """Return a mask and a network. Both are trained if `heights` requires gradients, otherwise only the network."""
    network = Deblur(scenes)
    groups = [{"params": list(network.parameters()), "lr": 2e-3}]
    if heights.requires_grad:
        groups.append({"params": [heights], "lr": 0.03})
    optimiser = torch.optim.Adam(groups)
    schedule = torch.optim.lr_scheduler.LambdaLR(optimiser, lambda step: 1 - step / steps)
    for _ in range(steps):
        between = (torch.arange(1, DISTANCES - 1) + torch.rand(DISTANCES - 2) - 0.5) / (DISTANCES - 1)
        vergences = NEAREST * torch.cat((torch.tensor([1e-3]), between, torch.ones(1)))
        blur = compute(heights, vergences)
        scene = scenes[torch.randint(len(scenes), ())]
        restored = network(photographed(scene, blur), blur)
        decibels = 10 * (restored - scene).square().mean((1, 2, 3)).log10()  # minus the PSNR at each distance
        optimiser.zero_grad()
        (decibels.mean() + FLATNESS * decibels.std()).backward()
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


def draw(ratios: dict[str, np.ndarray], images: dict[str, torch.Tensor], mask: torch.Tensor, path: str) -> None:
    """Draw the PSNR over vergence, the mask, and restored images at three distances."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplot_mosaic("ppmabc;ppmdef", figsize=(14, 4.6), layout="constrained", width_ratios=[1] * 6)
    vergences = NEAREST * np.linspace(0, 1, TESTED)
    for name, ratio in ratios.items():
        axes["p"].plot(vergences, ratio, label=name)
    axes["p"].set(xlabel="vergence of the object [dioptres]", ylabel="PSNR [dB]")
    axes["p"].legend()
    shown = axes["m"].imshow(mask, extent=(-1, 1, -1, 1), origin="lower")
    axes["m"].set(title="mask [µm]", xlabel="x [mm]", ylabel="y [mm]")
    figure.colorbar(shown, ax=axes["m"], orientation="horizontal")
    for row, name in zip(("abc", "def"), ("lens and network", "mask and network"), strict=True):
        for letter, place in zip(row, (0, TESTED // 2, TESTED - 1), strict=True):
            axes[letter].imshow(images[name][place].permute(1, 2, 0))
            axes[letter].set_title(f"{name}, {vergences[place]:.0f} D", fontsize="small")
            axes[letter].axis("off")
    figure.savefig(path, dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--steps", type=int, default=120, help="training steps of each camera")
    parser.add_argument("--out", help="save a figure to this file")
    arguments = parser.parse_args()
    rng = np.random.default_rng(0)
    scenes, unseen = leaves(48, rng), leaves(8, rng)
    cameras = {
        "mask and network": (camera, cubic().requires_grad_()),
        "the same with plain PyTorch": (plain_camera, cubic().requires_grad_()),
        "lens and network": (camera, 0 * cubic()),
    }
    ratios, images, masks = {}, {}, {}
    for name, (compute, start) in cameras.items():
        torch.manual_seed(0)
        began = time.process_time()
        masks[name], network = trained(compute, start, scenes, arguments.steps)
        took = time.process_time() - began
        ratios[name], images[name] = judged(masks[name], network, unseen)
        worst, best = ratios[name].min(), ratios[name].max()
        print(f"{name:28s} {worst:.1f} to {best:.1f} dB over distance, {took:.0f} CPU seconds", flush=True)
        print("   ", *(f"{ratio:.1f}" for ratio in ratios[name]), flush=True)
    if arguments.out:
        draw(ratios, images, masks["mask and network"], arguments.out)
        print(f"drawn to {arguments.out}")


if __name__ == "__main__":
    main()
