"""A hologram by two algorithms: Gerchberg-Saxton, and gradient descent in PyTorch.

A plate of 32 x 32 pixels in front of a lens forms a letter in the focal plane. The Gerchberg-Saxton algorithm
(Gerchberg and Saxton 1972) alternates between plate and image with Fourier transforms. It controls the light at one
point per resolution cell, λf/2R, but not between these points, so that the image has speckles. Gradient descent changes
the heights of the pixels until the PSF agrees with the letter at four points per cell.

Gradient descent from random heights leaves optical vortices, which are points without light. Small changes of the
heights move a vortex but cannot remove it. A defocused lens spreads light over the letter without vortices, and is
therefore a better start.

All plates are judged by `optics.psf` at sixteen points per cell: by the share of the light in the letter, and by the
standard deviation of the light within the letter, relative to its mean.

    python examples/09_hologram.py [--steps 100] [--out hologram.png]
"""

from __future__ import annotations

import argparse

import numpy as np
import torch

from rhabdom import optics
from rhabdom.optics.torch import psf

PIXELS, PITCH, FOCAL_LENGTH, WAVELENGTH, INDEX = 32, 8e-6, 30e-3, 532e-9, 1.5
RADIUS = PIXELS * PITCH / 2
CELL = WAVELENGTH * FOCAL_LENGTH / (2 * RADIUS)  # one resolution cell in the focal plane [m]
FULL_TURN = WAVELENGTH / (INDEX - 1)  # height that delays light by one wave [m]
CELLS = 25  # cells of the judged window
DEFOCUS = 2.4  # waves at the rim, with which a lens spreads its light over the letter
LETTER = np.array(
    [
        [int(mark) for mark in row]
        for row in ("1111110", "1100011", "1100011", "1111110", "1101100", "1100110", "1100011", "1100011")
    ]
)


def target(per_cell: int) -> np.ndarray:
    """Return the letter as a mask with `per_cell` points per cell along either axis, (y, x)."""
    side = (CELLS - 1) * per_cell + 1
    at = np.floor((np.arange(side) - side // 2) / per_cell + 0.5).astype(int) + CELLS // 2
    mask = np.zeros((CELLS, CELLS))
    rows, columns = LETTER.shape
    top, left = CELLS // 2 - rows, CELLS // 2 - columns  # each mark of the letter covers two by two cells
    mask[top : top + 2 * rows, left : left + 2 * columns] = np.kron(LETTER, np.ones((2, 2)))
    return mask[np.ix_(at, at)]


def view(per_cell: int) -> dict:
    """Return the arguments of `optics.psf` for the window with `per_cell` points per cell."""
    side = (CELLS - 1) * per_cell + 1
    return {"dx": CELL / per_cell, "shape": (side, side), "tolerance": 1e-2}


def plate(turns: np.ndarray | torch.Tensor) -> optics.Pupil:
    """Return lens and plate for a delay of each pixel in waves, (y, x)."""
    return optics.Pupil(RADIUS, optics.PixelRelief(turns * FULL_TURN), n=INDEX, thin_lens_focal_length=FOCAL_LENGTH)


def gerchberg_saxton(steps: int, rng: np.random.Generator) -> np.ndarray:
    """Return the delays of a plate in waves, (y, x)."""
    at = np.arange(PIXELS) - (PIXELS - 1) / 2
    open_pixels = np.hypot(at, at[:, None]) < PIXELS / 2
    wanted = np.zeros((PIXELS, PIXELS))
    first = (PIXELS - CELLS) // 2 + (PIXELS - CELLS) % 2
    wanted[first : first + CELLS, first : first + CELLS] = np.sqrt(target(1))
    # The pixels lie at half-integer positions, so the transform needs a factor that depends on the position.
    there = np.arange(PIXELS) - PIXELS // 2
    kernel = np.exp(-2j * np.pi * np.outer(there, at) / PIXELS) / np.sqrt(PIXELS)
    phase = 2 * np.pi * rng.random((PIXELS, PIXELS))
    for _ in range(steps):
        image = kernel @ (open_pixels * np.exp(1j * phase)) @ kernel.T
        phase = np.angle(kernel.conj().T @ (wanted * np.exp(1j * np.angle(image))) @ kernel.conj())
    return phase / (2 * np.pi)


def gradient_descent(turns: np.ndarray, steps: int) -> np.ndarray:
    """Return the delays of a plate in waves, (y, x), after steps of Adam from a first plate."""
    delays = torch.tensor(turns, requires_grad=True)
    letter = torch.tensor(target(2))
    optimiser = torch.optim.Adam([delays], lr=0.02)
    for _ in range(steps):
        image = psf(plate(delays), WAVELENGTH, FOCAL_LENGTH, **view(2))[0].double()
        light = image * (CELL / 2) ** 2  # share of the light per point
        level = (light * letter).sum() / letter.sum()
        error = (light - level * letter).square().sum() / (level**2 * letter.sum())
        optimiser.zero_grad()
        (error - 0.5 * (light * letter).sum().log()).backward()
        optimiser.step()
    return delays.detach().numpy()


def defocus() -> np.ndarray:
    """Return the delays of a defocused lens in waves, (y, x)."""
    at = (np.arange(PIXELS) - (PIXELS - 1) / 2) * PITCH / RADIUS
    return DEFOCUS * (at**2 + at[:, None] ** 2)


def judged(turns: np.ndarray) -> tuple[np.ndarray, float, float]:
    """Return the PSF (y, x), the share of the light in the letter, and the relative standard deviation within it."""
    image = optics.psf(plate(turns), [WAVELENGTH], FOCAL_LENGTH, **view(4)).psf[0]
    inside = image[target(4) > 0]
    return image, float(inside.sum() * (CELL / 4) ** 2), float(inside.std() / inside.mean())


def draw(images: dict[str, np.ndarray], path: str) -> None:
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, len(images), figsize=(3.2 * len(images), 3.4), layout="constrained")
    extent = np.array([-1, 1, 1, -1]) * CELLS / 2 * CELL * 1e3
    for ax, (title, image) in zip(axes, images.items(), strict=True):
        ax.imshow(image / np.quantile(image, 0.998), cmap="gray", vmin=0, vmax=1, extent=extent)
        ax.set_title(title, fontsize="medium")
        ax.set_xlabel("x [mm]")
    axes[0].set_ylabel("y [mm]")
    figure.savefig(path, dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--steps", type=int, default=100, help="steps of each algorithm")
    parser.add_argument("--out", help="save the images to this file")
    arguments = parser.parse_args()
    first = gerchberg_saxton(arguments.steps, np.random.default_rng(0))
    plates = {
        "Gerchberg-Saxton": first,
        "descent from there": gradient_descent(first, arguments.steps),
        "descent from a defocused lens": gradient_descent(defocus(), arguments.steps),
    }
    images = {}
    for name, turns in plates.items():
        images[name], share, spread = judged(turns)
        print(f"{name:29s} {share:4.0%} of the light in the letter, standard deviation {spread:4.0%} of its mean")
    if arguments.out:
        draw({"wanted": target(4), **images}, arguments.out)
        print(f"drawn to {arguments.out}")


if __name__ == "__main__":
    main()
