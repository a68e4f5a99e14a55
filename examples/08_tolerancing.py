"""Yield of a lens whose three elements are decentred, tilted and spaced at random.

Each trial draws the errors of all elements from normal distributions. The criterion is the brightest point of the
image, relative to that of the nominal lens: the Strehl ratio at the best position in a fixed image plane.

python examples/08_tolerancing.py [--trials 10] [--out yield.png]
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from rhabdom import optics

WAVELENGTH, RADIUS = 550e-9, 0.3e-3
FOCAL_LENGTHS, SPACINGS = (24e-3, -15e-3, 24e-3), (6e-3, 6e-3)
DECENTRE, TILT, SPACING = 20e-6, np.radians(0.2), 250e-6  # standard deviations [m], [rad] and [m] at scale 1
SCALES = (0.5, 1.0, 2.0)
PITCH, SIDE = 5e-6, 96


def back_focal_length() -> float:
    """Return the distance [m] from the last lens to the image of a distant point, by paraxial ray tracing."""
    height, slope = 1.0, 0.0
    for f, spacing in zip(FOCAL_LENGTHS, (*SPACINGS, 0.0), strict=True):
        slope -= height / f
        height += slope * spacing
    return -height / slope


def system(decentres: np.ndarray, tilts: np.ndarray, spacings: np.ndarray) -> list:
    """Return the lens with the given errors of its three elements, (3, 2) [m], (3, 2) [rad] and (3,) [m]."""
    distances = (*SPACINGS, back_focal_length())
    elements: list = []
    for f, distance, decentre, tilt, error in zip(FOCAL_LENGTHS, distances, decentres, tilts, spacings, strict=True):
        lens = optics.Pupil(RADIUS, thin_lens_focal_length=f)
        elements += [optics.Misaligned(lens, tuple(decentre), tuple(tilt)), optics.FreeSpace(distance + error)]
    return elements


def peak(elements: list, tolerance: float = 2e-2) -> float:
    """Return the largest intensity of the image, for light of unit amplitude from a distant point on the axis.

    The largest tilts at scale 2 cause an error of 1 %, so that a smaller tolerance would be refused.
    """
    image = optics.propagate_through(
        elements, wavelength=WAVELENGTH, out_dx=PITCH, out_shape=(SIDE, SIDE), tolerance=tolerance
    )
    return float((np.abs(image.u) ** 2).max())


def ratios(scale: float, trials: int) -> np.ndarray:
    """Return the peaks of random lenses relative to the nominal lens. Each scale has the same random numbers."""
    rng = np.random.default_rng(0)
    nominal = peak(system(np.zeros((3, 2)), np.zeros((3, 2)), np.zeros(3)))
    found = [
        peak(
            system(
                scale * DECENTRE * rng.normal(size=(3, 2)),
                scale * TILT * rng.normal(size=(3, 2)),
                scale * SPACING * rng.normal(size=3),
            )
        )
        for _ in range(trials)
    ]
    return np.array(found) / nominal


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--trials", type=int, default=10, help="number of random lenses for each scale")
    parser.add_argument("--out", help="save the yield curves to this file")
    arguments = parser.parse_args()
    start, curves = time.process_time(), {}
    for scale in SCALES:
        curves[scale] = np.sort(ratios(scale, arguments.trials))
        share = np.mean(curves[scale] > 0.8)
        print(
            f"{scale * DECENTRE * 1e6:3.0f} µm, {np.degrees(scale * TILT):.2f}°, {scale * SPACING * 1e6:4.1f} µm: "
            f"median ratio {np.median(curves[scale]):.2f}, yield {100 * share:.0f} % above 0.8"
        )
    print(f"{(time.process_time() - start) / (len(SCALES) * arguments.trials):.2f} CPU seconds for each lens")
    if arguments.out:
        draw(curves, arguments.out)


def draw(curves: dict[float, np.ndarray], out: str) -> None:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(5, 3.4), layout="constrained")
    for scale, ratio in curves.items():
        label = f"{scale * DECENTRE * 1e6:.0f} µm, {np.degrees(scale * TILT):.2f}°, {scale * SPACING * 1e6:.1f} µm"
        axes.step(ratio, 100 * np.arange(len(ratio), 0, -1) / len(ratio), where="post", label=label)
    axes.set(xlabel="smallest accepted Strehl ratio", ylabel="yield [%]", xlim=(0, 1.05), ylim=(0, 102))
    axes.legend(title="decentre, tilt, spacing (1 σ)", fontsize=8, title_fontsize=8)
    figure.savefig(out, dpi=120)
    print(f"drawn to {out}")


if __name__ == "__main__":
    main()
