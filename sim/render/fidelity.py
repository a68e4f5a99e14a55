"""How finely a world is rendered for given eyes, and why so."""

from __future__ import annotations

import math
from dataclasses import dataclass
from numbers import Real

from optics.numerics.arguments import one_of, shown, whole
from sim.eyes.depth_layers import ONE_PSF, DepthLayers
from sim.eyes.eyes import Eyes
from sim.tracing.lighting import ALL, DIRECT, LEVELS

RAYS, AREAS, EDGES = SAMPLES = ("rays", "areas", "edges")
MOST_RAYS = 1e7  # per receptor: what is more was a slip, and its arithmetic overflows
MOST_BANDS = 4096


@dataclass(frozen=True)
class Level:
    """What was chosen for one stage, and why. predicted_error: of a signal, root mean square (of the eyes' own bands a
    bound: the worst measured reflectance and type of receptor, which may exceed any tolerance); None where unknown."""

    stage: str
    level: str
    predicted_error: float | None
    why: str


@dataclass(frozen=True)
class Fidelity:
    """How finely a world is rendered for given eyes; printed, it is a table.

    rays_per_receptor: on average; behind a pupil it may be below 1, since receptors share rays and may share areas
    bands: spectral bands, in the place of the eye's own
    depth: distances for which the eye has a PSF
    light: what of it is followed: "direct"; "bounce", which adds light that is reflected twice; or, with areas, "all"
    samples: what eyes look along: "rays", or "areas", which cut each receptor's square into rays_per_receptor
        rectangles and find the mean of each in closed form, behind a pupil of some around the receptors', too, and
        below 1 of larger ones; upright worlds only; or "edges": a few rays per receptor, and rays_per_receptor where
        these differ; models of one's own through perfect lenses only
    tolerance: error allowed to a receptor's signal (root mean square); None where nothing was chosen. At edges, rays
        whose signals are within it of each other do not differ
    levels: what was chosen for each stage, and why

    Raises:
        ValueError: bands, rays_per_receptor or a tolerance that are no numbers or out of range, unknown light or
            samples, and rays that would follow all light.
    """

    rays_per_receptor: float
    bands: int
    depth: DepthLayers = ONE_PSF
    tolerance: float | None = None
    levels: tuple[Level, ...] = ()
    light: str = DIRECT
    samples: str = RAYS

    def __post_init__(self) -> None:
        rays = self.rays_per_receptor
        if not (isinstance(rays, Real) and 0 < rays <= MOST_RAYS):
            most = f"{MOST_RAYS:g}"
            raise ValueError(f"rays_per_receptor = {shown(rays)}: must be positive and at most {most}, or 'auto'")
        whole("bands", self.bands, 1, MOST_BANDS)
        if self.tolerance is not None and not (isinstance(self.tolerance, Real) and 0 < self.tolerance < math.inf):
            raise ValueError(f"tolerance = {shown(self.tolerance)}: must be positive, or None")
        one_of("light", self.light, LEVELS)
        one_of("samples", self.samples, SAMPLES)
        if self.light == ALL and self.samples != AREAS:
            raise ValueError("light = 'all': must go with samples = 'areas'; rays follow two reflections at most")

    @property
    def predicted_error(self) -> float | None:
        """Of a receptor's signal, all stages together (root mean square); None where nothing was predicted."""
        known = [level.predicted_error for level in self.levels if level.predicted_error is not None]
        return math.hypot(*known) if known else None

    @property
    def why(self) -> str:
        """The reasons, one line per stage."""
        return "\n".join(f"{level.stage}: {level.why}" for level in self.levels) or "as asked"

    def __str__(self) -> str:
        levels = self.levels or (
            Level("bands", f"{self.bands}", None, "as asked"),
            Level("depth", f"{self.depth}", None, "as asked"),
            Level("light", self.light, None, "as asked"),
            Level(self.samples, f"{self.rays_per_receptor:g} per receptor", None, "as asked"),
        )
        rows = [("stage", "level", "error", "why")]
        for level in levels:
            error = "" if level.predicted_error is None else f"{level.predicted_error:.1e}"
            rows.append((level.stage, level.level, error, level.why))
        widths = [max(len(row[i]) for row in rows) for i in range(3)]
        return "\n".join("  ".join([*(c.ljust(w) for c, w in zip(r, widths, strict=False)), r[3]]) for r in rows)


def fidelity_asked(rays_per_receptor: float | str, eyes: Eyes) -> Fidelity | None:
    """So many rays in direct light; None where that is left to be chosen, "auto".

    Raises:
        ValueError: neither a positive number nor "auto".
    """
    if not isinstance(rays_per_receptor, str):
        return Fidelity(rays_per_receptor, eyes.bands)
    if rays_per_receptor != "auto":
        raise ValueError(f"rays_per_receptor = {shown(rays_per_receptor)}: must be positive, or 'auto'")
    return None
