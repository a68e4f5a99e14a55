"""Receptive fields sampled by rays, compared with convolution of a padded image

Do rays sample receptive fields without bias? Yes: errors fall with the number n of rays per receptor, at least like
n^-0.51 wherever a slope can be fitted. The automatically chosen sampling has an error of at most 0.165 of the receptor
noise σ.

**Method.** Behind a pupil, all receptors of an eye use one set of rays, whose directions are drawn from the mean of
their receptive fields. The signal of a receptor is a weighted sum over these rays. These signals are compared with
those of `Eye.see`, which convolves an image of the scene with the PSF, as in the [published eyes](../results/paper.md).
The image extends beyond the field of view by the width of the kernel on every side. Its grid differs from the grid on
which the receptive fields of the rays are tabulated. Each cell of the image is rendered with many rays or, if light may
be reflected any number of times, with many areas ([area sampling](../concepts/rendering.md#area-sampling)). Rays and
reference use the same light, so they differ only in sampling.

Errors are root mean squares over receptors, channels and states of an agent that acts at random in the detection world.
Their unit is the receptor noise, σ = 0.01. The unit of signals is the signal of white behind a pupil as wide as the
retina (a = 1). The five kinds of pupil are:

- perfect: no pupil (the perfect lens);
- pinhole: a = 0.04;
- open: an aperture of a = 0.25 without a lens;
- random relief: a = 0.25, with a relief drawn at random;
- lens: a = 0.25, with a lens in focus.

The perfect lens uses 24 states, because its errors differ much between views. The other pupils use 4 states.

**Table.** Retinas are given as width x height. The slope is the exponent of n in the error. The last column shows the
choice of `rays_per_receptor = "auto"` and its error. The choice is a number of rays or areas, and the light: direct
light or all light. No slope is given if fewer than three errors are above 0.01 σ.

**Bounds.** The error of the automatic choice is at most half of the noise. Errors above 0.01 σ fall at least like
n^-0.5, as they do with independent rays. Errors below 0.01 σ can come from the two different grids, so they have no
bound.

    python -m validation.sim.receptive_field_sampling [--out DIR] [--docs DIR]
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import optics
import sim
from sim.worlds.state import WorldState
from validation.pages.page import Page, parser
from validation.pages.tables import write_table
from validation.sim.scenes import SIGMA, lived_through, rms

PUPILS = ("perfect", "pinhole", "open", "random relief", "lens")
RETINAS = {(1, 4): 30.0, (15, 15): 45.0, (31, 31): 45.0}  # resolution and field of view [deg]
RAYS = (0.25, 1.0, 4.0, 16.0, 64.0)
MOST = 16_000  # largest number of rays of one eye
STATES, PERFECT_STATES = 4, 24
APERTURE, PINHOLE = 0.25, 0.04  # radius of the pupil relative to half of the retina's width
RELIEF_HEIGHT = 20e-6  # [m]
CELLS = 3  # cells of the reference's images along a receptor's side; the rays' fields have 2, or 4 and more
CELL_RAYS, PERFECT_RAYS = 48, 1024
CELL_AREAS, PERFECT_AREAS = 4, 64
HALF = 0.5  # bound, relative to the noise
SLOPE = -0.5
TABULATION = 0.01  # [σ] below which errors come from PSFs, not from rays (1 % on two grids, with signals of about 1 σ)


@dataclass(frozen=True)
class Series:
    """Errors [σ] with one pupil and retina, for numbers of rays per receptor and for the choice of "auto"."""

    pupil: str
    retina: str
    rays: tuple[float, ...]
    errors: tuple[float, ...]
    auto_rays: float
    auto_error: float
    light: str
    samples: str

    @property
    def slope(self) -> float:
        """Slope of log error over log rays, for errors above TABULATION; -inf for too few errors."""
        kept = [(r, e) for r, e in zip(self.rays, self.errors, strict=True) if e > TABULATION]
        if len(kept) < 3:
            return -math.inf
        return float(np.polyfit(*np.log(np.transpose(kept)), 1)[0])


def eyes_behind(pupil: str, resolution: tuple[int, int]) -> sim.Eyes:
    eyes = sim.Eyes(n_eyes=1, resolution=resolution, fov_deg=RETINAS[resolution], noise_sigma=SIGMA)
    radius = (PINHOLE if pupil == "pinhole" else APERTURE) * eyes.sensor_width / 2
    relief = optics.BSplineRelief(RELIEF_HEIGHT * np.random.default_rng(4).random((4, 4)))
    made = {
        "perfect": None,
        "pinhole": optics.Pupil(radius),
        "open": optics.Pupil(radius),
        "random relief": optics.Pupil(radius, height=relief, n=1.5),
        "lens": optics.Pupil(radius, thin_lens_focal_length=eyes.eye().sensor_distance),
    }
    return replace(eyes, optics=made[pupil])


def convolved(world: sim.World, eyes: sim.Eyes, state: WorldState, light: str) -> np.ndarray:
    """Return the signals of the eyes by the reference, (state, channel, h, w)."""
    eye = eyes.eye()
    cells = 1 if eye.pupil is None else CELLS
    reach = eye.kernel(cells).shape[-1] // 2
    sight = eye.sight(cells, light_from="centres")
    height, width = (cells * n + 2 * reach for n in eye.resolution)
    half = width / 2 * eye.receptor_pitch / cells
    camera = replace(
        eyes, optics=None, resolution=(height, width), fov_deg=math.degrees(2 * math.atan(half / eye.sensor_distance))
    )
    fidelity = reference_fidelity(eyes, light)
    found = []
    for i in range(state.n):
        renderer = sim.BatchedRenderer(world, camera, 1, fidelity)
        picture = renderer.receptor_radiance(state.take(np.array([i])))[:, 0, 0]
        found.append(eye.see(picture, cells, sight=sight))
    return np.array(found)


def reference_fidelity(eyes: sim.Eyes, light: str) -> sim.Fidelity:
    """Return the fidelity with which the reference's image is rendered before it is convolved.

    Each cell of this image is rendered as a receptor. With a perfect lens, cells are whole receptors.
    """
    perfect = eyes.optics is None
    if light == "all":
        return sim.Fidelity(PERFECT_AREAS if perfect else CELL_AREAS, eyes.bands, light=light, samples="areas")
    return sim.Fidelity(PERFECT_RAYS if perfect else CELL_RAYS, eyes.bands, light=light)


def sampled(world: sim.World, eyes: sim.Eyes, state: WorldState, fidelity: sim.Fidelity) -> tuple[np.ndarray, float]:
    """Return the signals of the eyes, and the number of rays or areas per receptor."""
    renderer = sim.BatchedRenderer(world, eyes, 1, fidelity)
    rays = len(renderer.sensor.directions) / math.prod(eyes.resolution)
    return np.concatenate([renderer.signals(state.take(np.array([i]))) for i in range(state.n)])[:, 0], rays


def measure(pupil: str, resolution: tuple[int, int], world: sim.World, state: WorldState) -> Series:
    eyes, receptors = eyes_behind(pupil, resolution), math.prod(resolution)
    auto = sim.choose_fidelity(world, eyes, bands="own")
    truth = {light: convolved(world, eyes, state, light) for light in {"direct", auto.light}}
    counts = [n for n in RAYS if 4 <= n * receptors <= MOST and (pupil != "perfect" or n >= 1)]
    found = [sampled(world, eyes, state, sim.Fidelity(n, eyes.bands)) for n in counts]
    signals, auto_rays = sampled(world, eyes, state, replace(auto, depth=sim.Fidelity(1, 1).depth))
    return Series(
        pupil,
        f"{resolution[1]} x {resolution[0]}",
        tuple(rays for _, rays in found),
        tuple(rms(s - truth["direct"]) / SIGMA for s, _ in found),
        auto_rays,
        rms(signals - truth[auto.light]) / SIGMA,
        auto.light,
        auto.samples,
    )


def broken_bounds(series: Sequence[Series]) -> list[str]:
    """Return the descriptions of the bounds that do not hold."""
    broken = []
    for s in series:
        if s.auto_error > HALF:
            broken.append(f"{s.pupil}, {s.retina}: auto has an error of {s.auto_error:.2f} σ")
        if s.slope > SLOPE:
            broken.append(f"{s.pupil}, {s.retina}: errors fall like n^{s.slope:.2f}")
    return broken


def table(series: Sequence[Series]) -> str:
    lines = ["pupil          retina   error [σ] at rays per receptor                                   slope  auto"]
    for s in series:
        errors = "  ".join(f"{n:.3g}: {e:.4f}" for n, e in zip(s.rays, s.errors, strict=True))
        slope = f"{s.slope:.2f}" if math.isfinite(s.slope) else "-"
        auto = f"{s.auto_error:.3f} at {s.auto_rays:.3g} {s.samples}, {s.light}"
        lines.append(f"{s.pupil:<14} {s.retina:<8} {errors:<64} {slope:>5}  {auto}")
    return "\n".join(lines)


COLORS = dict(zip(PUPILS, ("#000000", "#999999", "#0072B2", "#E69F00", "#009E73"), strict=True))


def draw(series: Sequence[Series], path: Path) -> None:
    """Draw one panel per retina: errors over rays, with the choice of auto as a star."""
    from matplotlib.figure import Figure

    retinas = list(dict.fromkeys(s.retina for s in series))
    figure = Figure(figsize=(4 * len(retinas) + 1, 4.3), layout="constrained")
    for axes, retina in zip(figure.subplots(1, len(retinas), sharey=True, squeeze=False)[0], retinas, strict=True):
        for s in (s for s in series if s.retina == retina):
            axes.loglog(s.rays, s.errors, "o-", ms=4, lw=1, color=COLORS[s.pupil], label=s.pupil)
            axes.loglog([s.auto_rays], [s.auto_error], "*", ms=13, mfc="none", color=COLORS[s.pupil])
        axes.axhline(HALF, color="black", ls=":", lw=1)
        axes.set(title=f"{retina} receptors", xlabel="rays (star: or areas) per receptor")
    figure.axes[0].set_ylabel("error [σ of the receptors' noise]")
    handles, labels = figure.axes[-1].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside right", title="star: auto\ndotted: σ/2", frameon=False)
    figure.suptitle("The error of the automatic choice is below half of the noise, behind every pupil")
    figure.savefig(path, dpi=110)


def main(arguments: list[str] | None = None) -> int:
    options = parser(__doc__ or "").parse_args(arguments)
    world = sim.build_world("detection", seed=3)
    few, many = (lived_through(world, n) for n in (STATES, PERFECT_STATES))
    series = [
        measure(pupil, resolution, world, many if pupil == "perfect" else few)
        for resolution in RETINAS
        for pupil in PUPILS
    ]
    if options.docs:
        write_table(options.docs / "data" / "receptive_field_sampling.csv", [_row(s) for s in series])
    page = Page("receptive_field_sampling", __doc__ or "", table(series), broken_bounds(series))
    return page.publish(options, lambda path: draw(series, path))


def _row(series: Series) -> dict[str, Any]:
    row = asdict(series)
    row["rays"], row["errors"] = (" ".join(f"{x:.5g}" for x in row[name]) for name in ("rays", "errors"))
    return row


if __name__ == "__main__":
    sys.exit(main())
