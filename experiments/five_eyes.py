"""Image of one scene by five eyes, from an open aperture to a focused lens

python -m experiments.five_eyes [--docs DIR]
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import optics
import sim
from evolve.analysis.statistics import psnr
from evolve.analysis.vision import ssim
from evolve.analysis.white_light import white_strehl
from evolve.report.picture import display
from experiments.page import Figure, Page, markdown_table, new_figure, parser, save
from experiments.store import Origin
from sim.worlds.state import WorldState

__all__ = ["STAGES", "Stage", "View", "scene", "view"]

Floats = NDArray[np.floating]
FINE, COARSE, CELLS = 90, 30, 180  # receptors along a side of the two retinas, and cells of the scene over that side
SENSOR_WIDTH, FOV_DEG, NOISE, INDEX = 200e-6, 45.0, 0.003, 1.5
WIDE = 0.38  # relative aperture of cup and lenses, the maximum for a focused lens within the genes' range
SPP = 128


@dataclass(frozen=True)
class Stage:
    """One of the five eyes, which differ only in their pupils.

    power: power of the glass in the pupil, 1 in focus; 0: no glass
    """

    name: str
    relative_aperture: float
    power: float = 0.0

    def pupil(self) -> optics.Pupil:
        """Return the pupil; its glass has n = 1.5."""
        radius = self.relative_aperture * SENSOR_WIDTH / 2
        if not self.power:
            return optics.Pupil(radius)
        focal_length = float(optics.Eye(fov_deg=FOV_DEG, sensor_width=SENSOR_WIDTH).sensor_distance)
        curvature = self.power / ((INDEX - 1) * focal_length)
        return optics.Pupil(radius, optics.BSplineRelief.paraboloid(0.0, curvature, radius), n=INDEX)


STAGES = (
    Stage("open", 1.0),
    Stage("cup", WIDE),
    Stage("pinhole", 0.11),
    Stage("unfocused lens", WIDE, 0.6),
    Stage("focused lens", WIDE, 1.0),
)


@dataclass(frozen=True)
class View:
    """Signals of one eye (channel, y, x), scaled to the brightness of a perfect lens, and their quality.

    The fine retina has no noise, and the coarse retina has noise. PSNR and SSIM are relative to the perfect lens.
    """

    fine: Floats
    coarse: Floats
    strehl: float
    psnr_db: float
    ssim: float
    noisy_psnr_db: float


def scene() -> Floats:
    """Return the path-traced spectral radiance (band, y, x) in front of the eye on the tangent plane.

    A cell is 1/180 of the retina wide. The goal is on the left and an adversary on the right. The scene extends to all
    directions from which light reaches the retina through the widest pupil.
    """
    world = sim.build_world("detection")
    place, none = np.zeros((1, 2)), np.zeros(1, int)
    objects = np.array([[[2.3, 0.46, 0.5], [2.9, -0.62, 0.5], [6.0, 0.25, 0.5]]])
    state = WorldState(place, np.zeros(1), place, objects, np.zeros((1, 3)), place, none, none, none)
    eyes = sim.Eyes(1, (FINE, FINE), FOV_DEG, optics=STAGES[0].pupil(), sensor_width=SENSOR_WIDTH)
    renderer = sim.ReferenceRenderer(world, eyes, spp=SPP, samples_per_receptor=CELLS // FINE)
    return np.asarray(renderer.pictures(state)[0, 0])


def eye(pupil: optics.Pupil | None, side: int) -> optics.Eye:
    """Return an eye with a square retina."""
    return optics.Eye(pupil, (side, side), FOV_DEG, SENSOR_WIDTH, noise_sigma=NOISE)


def view(pupil: optics.Pupil | None, radiance: Floats, seed: int = 0) -> View:
    """Return the signals of an eye with this pupil, or with a perfect lens (None); only the coarse retina has noise."""
    fine, coarse = eye(pupil, FINE), eye(pupil, COARSE)
    gain = 1 / float(fine.throughput)
    sharp, blocks = (eye(None, side).see(radiance, CELLS // side) for side in (FINE, COARSE))
    seen, noisy = (
        gain * np.asarray(one.see(radiance, s, rng, sight=one.sight(s, light_from="centres")))
        for one, s, rng in ((fine, CELLS // FINE, None), (coarse, CELLS // COARSE, np.random.default_rng(seed)))
    )
    strehl = 1.0 if pupil is None else white_strehl(fine, fine.psf())
    return View(seen, noisy, strehl, psnr(seen, sharp), ssim(seen, sharp), psnr(noisy, blocks))


def page(views: Sequence[View], perfect: View, origin: Origin) -> Page:
    """Return the page of results, made from the views of all eyes and of the perfect lens."""
    rows = [
        [
            s.name,
            f"{s.relative_aperture:g}",
            f"{v.strehl:.2g}",
            f"{v.psnr_db:.1f}",
            f"{v.ssim:.2f}",
            f"{v.noisy_psnr_db:.1f}",
        ]
        for s, v in zip(STAGES, views, strict=True)
    ]
    header = ["", "a", "Strehl ratio", f"PSNR [dB], {FINE} x {FINE}", "SSIM", f"PSNR [dB], {COARSE} x {COARSE}, noise"]
    _, cup, pinhole, blurred, focused = views
    named = {"cup": cup, "pinhole": pinhole, "blurred": blurred, "focused": focused}
    return Page(
        name="five_eyes",
        command="python -m experiments.five_eyes",
        values={
            **{f"ssim_of_{name}": f"{one.ssim:.2f}" for name, one in named.items()},
            "noisy_psnr_of_pinhole": f"{pinhole.noisy_psnr_db:.0f}",
            "noisy_psnr_of_focused": f"{focused.noisy_psnr_db:.0f}",
            "stages": markdown_table(header, rows),
            "fine": str(FINE),
            "coarse": str(COARSE),
            "width_um": f"{1e6 * SENSOR_WIDTH:g}",
            "fov_deg": f"{FOV_DEG:g}",
            "index": f"{INDEX:g}",
            "noise": f"{NOISE:g}",
        },
        figures=[Figure("five_eyes", lambda path: draw(views, perfect, path))],
        origin=origin,
    )


def draw(views: Sequence[View], perfect: View, path: Path) -> None:
    """Draw a column per eye, with the perfect lens last."""
    names = [
        *(f"{s.name}\na = {s.relative_aperture:g}, SSIM {v.ssim:.2f}" for s, v in zip(STAGES, views, strict=True)),
        "perfect lens\n",
    ]
    figure, axes = new_figure(12, 4.7, columns=6, rows=2)
    for column, (name, one) in enumerate(zip(names, [*views, perfect], strict=True)):
        for place, signals in zip(axes[:, column], (one.fine, one.coarse), strict=True):
            place.imshow(display(signals), interpolation="nearest")
            place.set_axis_off()
        axes[0, column].set_title(name, fontsize=11)
    for place, name in zip(axes[:, 0], ("90 x 90 receptors", "30 x 30, with noise"), strict=True):
        place.text(-0.06, 0.5, name, rotation=90, ha="right", va="center", transform=place.transAxes)
    figure.suptitle("A pinhole is sharp and dark; a focused lens is sharp and bright")
    save(figure, path)


def main(arguments: Sequence[str] | None = None) -> int:
    """Render the scene, compute the signals, and make the page."""
    options = parser(__doc__ or "").parse_args(arguments)
    began = time.process_time()
    radiance = scene()
    views = [view(stage.pupil(), radiance) for stage in STAGES]
    perfect = view(None, radiance)
    page(views, perfect, Origin.here((time.process_time() - began) / 3600)).publish(options.docs)
    return 0


if __name__ == "__main__":
    sys.exit(main())
