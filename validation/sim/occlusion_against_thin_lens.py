"""Occlusion in front of a lens, compared with Mitsuba's thin lens

Does `Eye.see` hide the correct part of a far surface behind a near edge? Yes: signals differ from Mitsuba's thin lens
by at most 0.023, and by at most 0.0044 on average, where the signal of a white surface is 1. Adding the light of both
surfaces without occlusion is wrong by up to 0.26.

**Method.** A dark plate at 0.2 m covers the left half of the field. Horizontal stripes with radiances of 0.7 and 1 fill
a plane at 2 m. The lens has a radius of 1.2 mm. It is focused at the plate, at the stripes, in front of both, or
halfway between both in inverse distance. The blur is up to five receptors wide. Diffraction blurs by less than a tenth
of a receptor, so geometric optics holds. Mitsuba traces 10,000 rays per receptor through all parts of the lens.
`Eye.see` receives an image with one distance per pixel. This image contains no stripes behind the plate.

**Table.** Errors are in units of the signal of white. In the column "no occlusion", the blurred light of both surfaces
is added. If the lens is focused halfway between both distances, the blur of both surfaces is equally wide, and adding
the light is correct, too.

**Bounds.** With occlusion, the largest error is at most 0.03, and the mean error at most 0.01. Without occlusion, the
largest error is at least 0.1, except for the focus halfway.

    python -m validation.sim.occlusion_against_thin_lens [--out DIR] [--docs DIR]
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import optics
from validation.pages.page import Page, parser

RADIUS, DISTANCE, PITCH = 1.2e-3, 8e-3, 32e-6  # of the lens, of the retina, and of its receptors [m]
RECEPTORS, CELLS, MARGIN = 12, 2, 28  # along each axis
SIDE = RECEPTORS * CELLS + MARGIN  # cells of the scene
NEAR, FAR, DARK = 0.2, 2.0, 0.05
HALFWAY = 2 / (1 / NEAR + 1 / FAR)
FOCUS = {"plate": NEAR, "stripes": FAR, "in front": 0.12, "halfway": HALFWAY}
STRIPES = np.repeat([0.7, 1.0], 4)[np.arange(SIDE) % 8]
SAMPLES = 10_000
LARGEST, MEAN, WITHOUT = 0.03, 0.01, 0.1  # bounds


@dataclass(frozen=True)
class Case:
    """Signals (y, x) relative to white, for one focus.

    traced: by Mitsuba's thin lens.
    seen: by the eye, with occlusion.
    added: by the eye, without occlusion.
    """

    name: str
    traced: np.ndarray
    seen: np.ndarray
    added: np.ndarray

    @property
    def error(self) -> np.ndarray:
        return np.abs(self.seen - self.traced)

    @property
    def error_without(self) -> float:
        return float(np.abs(self.added - self.traced).max())


def eye(focus: float) -> optics.Eye:
    """Return an eye that is focused at this distance [m]."""
    pupil = optics.Pupil(RADIUS, thin_lens_focal_length=1 / (1 / DISTANCE + 1 / focus))
    width = RECEPTORS * PITCH
    fov = 2 * math.degrees(math.atan(width / 2 / DISTANCE))
    return optics.Eye(pupil, (RECEPTORS, RECEPTORS), fov, width, bands=1, full_aperture=2 * RADIUS)


def scene() -> tuple[np.ndarray, np.ndarray]:
    """Return radiance and distances (y, x) of the plate and the visible stripes."""
    plate = np.zeros((SIDE, SIDE), bool)
    plate[:, : SIDE // 2] = True
    return np.where(plate, DARK, STRIPES[:, None]), np.where(plate, NEAR, FAR)


def measure(name: str, focus: float, samples: int = SAMPLES) -> Case:
    one, (radiance, z) = eye(focus), scene()
    white = float(one.throughput) * one.spectral_bands.weights[0, 0]
    sight = one.sight(CELLS, z, "distinct")
    seen, added = (
        np.asarray(one.see(radiance[None], CELLS, z=z, sight=each))[0] / white
        for each in (None, replace(sight, parallax=0.0))
    )
    return Case(name, traced(focus, samples), seen, added)


def traced(focus: float, samples: int) -> np.ndarray:
    """Return the image of Mitsuba's thin lens."""
    import mitsuba as mi

    before = mi.variant()
    mi.set_variant("scalar_rgb")
    try:
        return np.array(mi.render(mi.load_dict(_described(mi, focus, samples))))[:, :, 0]
    finally:
        if before is not None:
            mi.set_variant(before)


def _described(mi: Any, focus: float, samples: int) -> dict[str, Any]:
    def plane(z: float, x: tuple[float, float], y: tuple[float, float], radiance: float) -> dict[str, Any]:
        middle, half = (sum(x) / 2 * z, sum(y) / 2 * z, z), ((x[1] - x[0]) / 2 * z, (y[1] - y[0]) / 2 * z, 1)
        place = mi.ScalarTransform4f().translate(middle).scale(half).rotate([0, 1, 0], 180)  # facing the lens
        light = {"type": "area", "radiance": {"type": "rgb", "value": float(radiance)}}
        return {"type": "rectangle", "to_world": place, "emitter": light}

    cell, edge = PITCH / CELLS / DISTANCE, SIDE / 2 * PITCH / CELLS / DISTANCE
    tops = edge - cell * np.arange(SIDE)
    film = {"type": "hdrfilm", "width": RECEPTORS, "height": RECEPTORS, "rfilter": {"type": "box"}}
    return {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 1},
        "sensor": {
            "type": "thinlens",
            "fov": eye(focus).fov_deg,
            "aperture_radius": RADIUS,
            "focus_distance": focus,
            "near_clip": 1e-3,
            "to_world": mi.ScalarTransform4f().look_at(origin=[0, 0, 0], target=[0, 0, 1], up=[0, 1, 0]),
            "film": {**film, "pixel_format": "luminance"},
            "sampler": {"type": "independent", "sample_count": samples},
        },
        "plate": plane(NEAR, (0, edge), (-edge, edge), DARK),  # Mitsuba's +x is on the left of the image
        **{
            f"stripe{i}": plane(FAR, (-edge, edge), (top - cell, top), STRIPES[i])
            for i, top in enumerate(map(float, tops))
        },
    }


def broken_bounds(cases: list[Case]) -> list[str]:
    """Return the descriptions of the bounds that do not hold."""
    broken = []
    for case in cases:
        if not (case.error.max() <= LARGEST and case.error.mean() <= MEAN):
            broken.append(f"{case.name}: errors up to {case.error.max():.3f}, {case.error.mean():.4f} on average")
        if case.name != "halfway" and not case.error_without >= WITHOUT:
            broken.append(f"{case.name}: without occlusion, the error is only {case.error_without:.3f}")
    return broken


def table(cases: list[Case]) -> str:
    lines = ["focus     largest error  mean error  largest error, no occlusion"]
    for case in cases:
        lines.append(f"{case.name:<9} {case.error.max():<14.3f} {case.error.mean():<11.4f} {case.error_without:.3f}")
    return "\n".join(lines)


def draw(cases: list[Case], path: Path) -> None:
    """Draw profiles across the edge for each focus."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13, 3.2), layout="constrained")
    at = np.arange(RECEPTORS) - (RECEPTORS - 1) / 2
    for axes, case in zip(figure.subplots(1, len(cases), sharey=True), cases, strict=True):
        styles = ((case.traced, "k-", "Mitsuba"), (case.seen, "o", "Eye.see"), (case.added, "--", "no occlusion"))
        for image, style, label in styles:
            axes.plot(at, image.mean(axis=0), style, label=label)
        axes.set(title=f"focus: {case.name}", xlabel="receptors from the edge")
    figure.axes[0].set_ylabel("signal / white")
    figure.axes[0].legend(frameon=False)
    figure.savefig(path, dpi=110)


def main(arguments: list[str] | None = None) -> int:
    options = parser(__doc__ or "").parse_args(arguments)
    cases = [measure(name, focus) for name, focus in FOCUS.items()]
    page = Page("occlusion_against_thin_lens", __doc__ or "", table(cases), broken_bounds(cases))
    return page.publish(options, lambda path: draw(cases, path))


if __name__ == "__main__":
    sys.exit(main())
