"""Portraits: an animal for each task, with the image of its world

python -m experiments.portraits [--runs TASK=DIR ...] [--out FILE]
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import sim
from evolve.store.directory import Run
from experiments.page import exit_code, new_figure, save
from optics.numerics.arguments import one_of
from sim.envs.retina_images import side_by_side
from sim.worlds.state import WorldState
from sim.worlds.world import World

__all__ = ["designed", "draw", "draw_head"]

PURPOSE = {"navigation": "navigation, eyes of one row", "detection": "detection, square eyes"}
RAYS = 256  # rays per receptor of the images
REACH = 2.4  # length of the drawn fields of view, in head radii
RECEPTOR_DEG = 3.0  # angle of a receptor on the head, as in the presets "bifurcation-..."
SKIN, PUPIL = "#C9B79C", "#222222"
COLORS = {"navigation": "#D55E00", "detection": "#0072B2"}


def designed() -> dict[str, sim.Eyes]:
    """Return the two published kinds of eyes; a navigator's eyes are rows, as in `experiments.eyes_for_tasks`."""
    return {
        "navigation": sim.Eyes(n_eyes=10, resolution=(1, 4), fov_deg=45, placement_range_deg=135),
        "detection": sim.Eyes(n_eyes=2, resolution=(15, 15), fov_deg=45, placement_range_deg=45),
    }


def moment(world: World) -> WorldState:
    """Return a state of the world that illustrates its task.

    The agent stands before the first fork of a course, or sees a goal on the left and a distractor on the right.
    """
    none = np.zeros(1, int)
    if not world.objects:
        place, heading = np.array([[-34.0, 4.0]]), np.array([math.radians(35.0)])
        objects = np.empty((1, 0, 3))
    else:
        place, heading = np.zeros((1, 2)), np.zeros(1)
        objects = np.array([[[2.4, 0.75, 0.5], [2.4, -0.75, 0.5], [-6.0, 3.0, 0.5]]])
    still, turned = np.zeros((1, 2)), np.zeros((1, objects.shape[1]))
    return WorldState(place, heading, still, objects, turned, place, none, none, none)


def seen(task: str, eyes: sim.Eyes) -> np.ndarray:
    """Return the eyes' signals at one time in the task's world, without noise, as an sRGB image (y, x, 3) uint8."""
    world = sim.build_world(task)
    renderer = sim.BatchedRenderer(world, eyes, 1, sim.Fidelity(RAYS, eyes.bands, light="bounce"))
    return side_by_side(renderer.signals(moment(world))[0], renderer.eye)


def draw_head(place: Any, eyes: sim.Eyes, color: str = "#777777") -> None:
    """Draw a head from above, with its heading upwards, its eyes and their fields of view."""
    from matplotlib.patches import Circle, Wedge

    place.set(xlim=(-REACH - 1, REACH + 1), ylim=(-1.2, REACH + 1), aspect="equal")
    place.axis("off")
    half, size = eyes.fov_deg / 2, 0.9 * math.radians(RECEPTOR_DEG * eyes.resolution[1]) / 2
    for azimuth in np.degrees(eyes.azimuths()):
        towards = 90 + float(azimuth)
        at = (math.cos(math.radians(towards)), math.sin(math.radians(towards)))
        place.add_patch(Wedge(at, REACH, towards - half, towards + half, color=color, alpha=0.16, lw=0))
        for side in np.linspace(-half, half, eyes.resolution[1] + 1):
            angle = math.radians(towards + float(side))
            end = (at[0] + REACH * math.cos(angle), at[1] + REACH * math.sin(angle))
            place.plot([at[0], end[0]], [at[1], end[1]], color=color, lw=0.4, alpha=0.6)
        place.add_patch(Circle(at, size, color=PUPIL, zorder=3))
    place.add_patch(Circle((0, 0), 1.0, color=SKIN, zorder=2))


def draw(animals: Mapping[str, sim.Eyes], path: Path, made: str) -> None:
    """Draw a column per task: the head above, the image of its eyes below.

    made: origin of the animals, for the title
    """
    figure, axes = new_figure(9.6, 5.4, columns=len(animals), rows=2, height_ratios=(3, 1.1))
    for (head, view), (task, eyes) in zip(axes.T, animals.items(), strict=True):
        draw_head(head, eyes, COLORS[task])
        fine = f"{eyes.n_eyes} eye{'s' * (eyes.n_eyes > 1)} of {eyes.resolution[1]} x {eyes.resolution[0]}"
        head.set_title(f"{PURPOSE[task]}:\n{fine}", fontsize=14)
        view.imshow(seen(task, eyes), interpolation="nearest", aspect="auto" if eyes.resolution[0] == 1 else "equal")
        view.set_axis_off()
        view.set_title("images of the eyes, left to right", fontsize=9)
    figure.suptitle(f"Goals shape eyes ({made})", fontsize=10, color="#555555")
    save(figure, path)


def main(arguments: Sequence[str] | None = None) -> int:
    """Draw the designed animals, or the fittest of runs."""
    options = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    options.add_argument("--runs", nargs="+", default=[], metavar="TASK=DIR", help="draw the fittest of these runs")
    options.add_argument("--out", type=Path, default=Path("docs/images/portraits.png"), help="file to draw into")
    chosen = options.parse_args(arguments)
    return exit_code("portraits", lambda: _drawn(chosen))


def _drawn(chosen: argparse.Namespace) -> None:
    animals = designed()
    for task, _, path in (text.partition("=") for text in chosen.runs):
        one_of("--runs: task", task, COLORS)
        run = Run.open(Path(path))
        animals[task] = replace(run.candidate().phenotype.eyes(run.config.eye), noise_sigma=0.0)
    draw(animals, chosen.out, "evolved" if chosen.runs else "designed by hand, and trained")
    print(f"picture: {chosen.out}")


if __name__ == "__main__":
    sys.exit(main())
