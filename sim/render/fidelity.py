"""The fidelity with which a world is rendered for given eyes, and the reasons for it.

A fidelity is chosen in four stages: bands, depth layers, light and samples. The choices available in one stage, ordered
by cost, are its levels.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from optics.numerics.arguments import one_of, shown, whole
from optics.numerics.number_types import is_number
from sim.eyes.depth_layers import ONE_PSF, DepthLayers
from sim.eyes.eyes import Eyes
from sim.tracing.lighting import ALL, DIRECT, LEVELS

RAYS, AREAS, EDGES = SAMPLES = ("rays", "areas", "edges")
MOST_RAYS = 1e7  # per receptor; a larger number is a mistake, and calculations with it would overflow
MOST_BANDS = 4096
MOST_FRAMES = 10**6


@dataclass(frozen=True)
class Level:
    """One decision in the choice of a `Fidelity`, with its reason.

    The accuracy of rendering is chosen in stages: the number of spectral bands, the depth layers, the reflections of
    light, the samples (rays or areas), and sometimes the frames per action. The options in a stage are its levels.

    stage, level: names of the stage and of its chosen level, for example "light" and "bounce"
    why: reason for this choice
    predicted_error: root mean square error that this level causes in a signal; None if it is unknown. If the eyes keep
        the number of bands that they were built with, the error in the stage "bands" is an upper bound, which may
        exceed the tolerance. This bound is the largest error over all types of receptors and over several surfaces:
        surfaces with measured reflectances and, in a medium, a white and a black surface
    """

    stage: str
    level: str
    predicted_error: float | None
    why: str


@dataclass(frozen=True)
class Fidelity:
    """Accuracy with which a world is rendered for given eyes. `print` shows it as a table.

    rays_per_receptor: average number of samples (rays or areas) per receptor, above 0 and at most 10⁷. With
        samples="edges", it is the number for receptors that see an edge. If the eye has a pupil, rays_per_receptor may
        be below 1, because several receptors then use the same ray or area.
    bands: number of spectral bands, 1 to 4096. It replaces the number of bands that the eye was built with. An eye in a
        world has at most 64 bands, so a larger number cannot be rendered.
    depth: distances for which the eye has a PSF
    light: "direct": light of lamps after one reflection; "bounce": also after two reflections; "all": after any number
        of reflections, with samples="areas" only
    samples: "rays", "areas" or "edges". Each receptor covers a square of the visual field. With "areas", this square is
        divided into rays_per_receptor rectangles, and the mean light in each of them is computed in closed form. If the
        eye has a pupil, there are also rectangles outside the retina, along its rim, and receptors share larger
        rectangles if rays_per_receptor is below 1. Areas need a world of upright walls, a floor and spheres. "edges" is
        adaptive edge sampling. A receptor has four rays. It has rays_per_receptor rays instead if the signals of the
        four differ, or if its signal differs strongly from that of a neighbouring receptor. Adaptive edge sampling
        needs a perfect lens and direct light, and is chosen automatically only for the user's own MuJoCo models, not
        for built-in worlds.
    frames: number of rendered frames per action, for receptors with `dynamics`: a divisor of the number of physics
        steps per action, at most 10⁶. None: environments choose the smallest number with which the error of the signals
        is allowed.
    tolerance: allowed error of a receptor's signal (root mean square), above 0; None if nothing was chosen. In adaptive
        edge sampling, rays whose signals differ by at most the tolerance count as equal.
    levels: decisions by which this fidelity was chosen, with their reasons; see `Level`

    Raises:
        ValueError: bands, rays_per_receptor, tolerance or frames is not a number or is out of range, light or samples
            is unknown, or light = "all" is combined with another kind of samples than areas.
    """

    rays_per_receptor: float
    bands: int
    depth: DepthLayers = ONE_PSF
    tolerance: float | None = None
    levels: tuple[Level, ...] = ()
    light: str = DIRECT
    samples: str = RAYS
    frames: int | None = None

    def __post_init__(self) -> None:
        rays = self.rays_per_receptor
        if not (is_number(rays) and 0 < rays <= MOST_RAYS):
            most = f"{MOST_RAYS:g}"
            raise ValueError(f"rays_per_receptor = {shown(rays)}: must be positive and at most {most}, or 'auto'")
        whole("bands", self.bands, 1, MOST_BANDS)
        if self.tolerance is not None and not (is_number(self.tolerance) and 0 < self.tolerance < math.inf):
            raise ValueError(f"tolerance = {shown(self.tolerance)}: must be positive, or None")
        if self.frames is not None:
            whole("frames", self.frames, 1, MOST_FRAMES)
        one_of("light", self.light, LEVELS)
        one_of("samples", self.samples, SAMPLES)
        if self.light == ALL and self.samples != AREAS:
            raise ValueError("light = 'all': must be used with samples = 'areas'; rays follow at most two reflections")

    @property
    def predicted_error(self) -> float | None:
        """Predicted error of a receptor's signal (root mean square); None if no error is known.

        It combines the known errors due to bands, depth layers, light and samples, as the root of the sum of their
        squares. The error due to the bands may be an upper bound (see `Level`).
        """
        known = [level.predicted_error for level in self.levels if level.predicted_error is not None]
        return math.hypot(*known) if known else None

    @property
    def why(self) -> str:
        """Reasons for the decisions about bands, depth layers, light and samples, one per line."""
        return "\n".join(f"{level.stage}: {level.why}" for level in self.levels) or "as requested"

    def __str__(self) -> str:
        levels = self.levels or (
            Level("bands", f"{self.bands}", None, "as requested"),
            Level("depth", f"{self.depth}", None, "as requested"),
            Level("light", self.light, None, "as requested"),
            Level(self.samples, f"{self.rays_per_receptor:g} per receptor", None, "as requested"),
            *([Level("frames", f"{self.frames} per action", None, "as requested")] if self.frames else []),
        )
        rows = [("stage", "level", "error", "why")]
        for level in levels:
            error = "" if level.predicted_error is None else f"{level.predicted_error:.1e}"
            rows.append((level.stage, level.level, error, level.why))
        widths = [max(len(row[i]) for row in rows) for i in range(3)]
        return "\n".join("  ".join([*(c.ljust(w) for c, w in zip(r, widths, strict=False)), r[3]]) for r in rows)


def requested_fidelity(rays_per_receptor: float | str, eyes: Eyes) -> Fidelity | None:
    """Return a fidelity with this number of rays per receptor; None for "auto".

    The fidelity includes only light that is reflected once ("direct"). Its number of spectral bands is `eyes.bands`.

    Raises:
        ValueError: the value is neither a positive number nor "auto".
    """
    if not isinstance(rays_per_receptor, str):
        return Fidelity(rays_per_receptor, eyes.bands)
    if rays_per_receptor != "auto":
        raise ValueError(f"rays_per_receptor = {shown(rays_per_receptor)}: must be positive, or 'auto'")
    return None
