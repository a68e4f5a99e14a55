"""Equal brightness of goal and adversary to a single receptor

Can a single photoreceptor distinguish goal from adversary by brightness? At distances of 2 m or more it cannot: the
signals from goal and adversary differ by at most 0.04 of the receptor noise, in the mean over directions.

**Method.** In detection and tracking, objects are spheres with black and white stripes. A goal has vertical sectors of
30°, and an adversary has horizontal bands. Light comes from above. If all bands had the same width, adversaries would
therefore be brighter or darker than goals, and one photoreceptor could distinguish them. To prevent this, the edges of
the bands are fitted by least squares, so that an adversary is as bright as a uniformly grey sphere. The fit covers 24
directions, and distances at which an eye of 45° sees (nearly) all of an object. The fit starts from edges that are 30°
apart, and penalises deviations from them. The two lowest edges can hardly be seen and are not fitted.

The light of one illuminated sphere is computed by tracing rays, without the renderer.
`tests/sim/worlds/test_balance.py` computes the same difference from rendered signals.

**Table.** The table states the signal of an adversary minus that of a goal, in units of the receptor noise (a standard
deviation of 0.01), for one receptor that looks straight at the object. Each cell is a mean or a root mean square over
24 directions. The first pair of columns is for the built-in adversaries, which have seven bands. The edges of these
bands ("shipped") are stored in `sim.worlds.detection`. The second pair of columns is for adversaries with six bands of
30°.

**Bounds.** The script fails if, at a distance of 2 m or more, the mean difference with the shipped edges exceeds a
fifth of the noise, or exceeds that with the fitted edges by more than a tenth of the noise. (The shipped edges differ
from the fitted ones by up to 3.0°.)

**Limits.** At distances below 2 m, an eye does not see the top of an object, and the difference grows to several times
the noise. At such short distances, the brightness of an object also depends more on whether the eye sees its lit or its
shaded side.

    python -m validation.sim.equal_brightness [--out DIR] [--docs DIR]
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from sim.eyes.eyes import BODY_RADIUS, EYE_HEIGHT, Eyes
from sim.worlds import materials
from sim.worlds.detection import BAND_EDGES_DEG, OBJECT_RADIUS, STRIPES
from validation.pages.page import Page, parser
from validation.pages.work_precision_chart import MUTED, OURS, OURS_TOO

FITTED = 4  # number of fitted edges, from the top
DISTANCES = (2.0, 2.4, 3.2, 5.2)  # [m] from the agent's centre, used in the fit
NEAR = (1.1, 1.3, 1.5, 1.7)
BEARINGS_DEG = (0.0, 10.0)  # of the object, relative to straight ahead
DIRECTIONS = np.arange(24) * 2 * np.pi / 24
BINS, RAYS = 720, 240  # bins of latitude and longitude; rays along either side of the receptor's field
EVEN = tuple(20.0 + 30.0 * i for i in range(FITTED))  # [deg] initial edges
STIFFNESS = 1.0  # penalty: an edge 30° off counts as much as a difference of this fraction of the noise


@cache
def light_seen(distance: float, bearing_deg: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the light of a white object in one receptor, by latitude and by longitude on the object.

    Both arrays are (direction, BINS). The object reflects the world's directional lights by Lambert's law. The receptor
    is equally sensitive over its square field.
    """
    edge = np.tan(np.radians(Eyes().fov_deg) / 2)
    along = (2 * (np.arange(RAYS) + 0.5) / RAYS - 1) * edge
    x, y = (a.ravel() for a in np.meshgrid(along, along))
    ray = np.stack([np.ones_like(x), x, y], axis=1) / np.sqrt(1 + x**2 + y**2)[:, None]
    bearing = np.radians(bearing_deg)
    center = np.array(
        [distance * np.cos(bearing) - BODY_RADIUS, distance * np.sin(bearing), OBJECT_RADIUS - EYE_HEIGHT]
    )
    nearest = ray @ center
    under_root = nearest**2 - center @ center + OBJECT_RADIUS**2
    hit = under_root > 0
    normal = ((nearest[hit] - np.sqrt(under_root[hit]))[:, None] * ray[hit] - center) / OBJECT_RADIUS
    latitude = np.arccos(normal[:, 2]) / np.pi
    rows = []
    for heading in DIRECTIONS:
        cos, sin = np.cos(heading), np.sin(heading)
        world = normal @ np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]])
        irradiance = sum(level * np.maximum(world @ towards, 0) for towards, level in _lights())
        longitude = np.arctan2(world[:, 1], world[:, 0]) / (2 * np.pi) % 1
        rows.append([np.bincount((BINS * part).astype(int) % BINS, irradiance, BINS) for part in (latitude, longitude)])
    by_latitude, by_longitude = np.array(rows).transpose(1, 0, 2) / len(ray)
    return by_latitude, by_longitude


def _lights() -> list[tuple[np.ndarray, float]]:
    """Return the unit vectors towards the lights, and their levels."""
    found = []
    for azimuth_deg, elevation_deg, level in materials.LIGHTS:
        azimuth, elevation = np.radians([azimuth_deg, elevation_deg])
        towards = [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
        found.append((np.array(towards), level))
    return found


def contrast(light: np.ndarray, edges: Sequence[float]) -> np.ndarray:
    """Return the light of a striped object minus that of an object with the mean reflectance, (direction,).

    light: light of a white object (direction, BINS), see `light_seen`.

    edges: positions of the edges, as fractions of the whole
    """
    bounds = np.concatenate([[0], np.sort(edges), [1]])
    collected = np.array([np.interp(bounds * BINS, np.arange(BINS + 1), np.r_[0, np.cumsum(row)]) for row in light])
    sign = np.where(np.arange(len(bounds) - 1) % 2 == 0, 1, -1)
    return np.diff(collected, axis=1) @ sign * (materials.WHITE - materials.BLACK) / 2


def difference(edges_deg: Sequence[float], distance: float, bearing_deg: float = 0.0) -> np.ndarray:
    """Return the signal of an adversary with these edges minus that of a goal, in units of the noise, (direction,)."""
    by_latitude, by_longitude = light_seen(distance, bearing_deg)
    sectors = np.arange(1, 2 * STRIPES) / (2 * STRIPES)
    bands = np.asarray(edges_deg) / 180
    return (contrast(by_latitude, bands) - contrast(by_longitude, sectors)) / Eyes().noise_sigma


def fitted() -> np.ndarray:
    """Return edges [deg] that make adversaries as bright as grey, seen from any direction in the plane of the eyes."""
    rest = BAND_EDGES_DEG[FITTED:]

    def residuals(edges: np.ndarray) -> np.ndarray:
        bands = np.r_[edges, rest] / 180
        seen = [contrast(light_seen(d, b)[0], bands) / Eyes().noise_sigma for d in DISTANCES for b in BEARINGS_DEG]
        return np.r_[np.concatenate(seen) / np.sqrt(len(DIRECTIONS)), STIFFNESS * (edges - EVEN) / 30]

    return np.r_[least_squares(residuals, EVEN).x, rest]


def main(arguments: Sequence[str] | None = None) -> int:
    """Fit, compare with the shipped edges, and write the page."""
    options = parser(__doc__ or "").parse_args(arguments)
    fit, even = fitted(), np.arange(1, STRIPES) * 180 / STRIPES
    lines = [
        "edges [deg from the top], fitted:  " + "  ".join(f"{edge:.1f}" for edge in fit),
        "edges [deg from the top], shipped: " + "  ".join(f"{edge:.1f}" for edge in BAND_EDGES_DEG),
        f"{'distance':>10}{'shipped: mean':>16}{'rms':>8}{f'{STRIPES} even bands: mean':>24}{'rms':>8}",
    ]
    broken = []
    for distance in (*NEAR, *DISTANCES):
        found, others = difference(BAND_EDGES_DEG, distance), difference(even, distance)
        lines.append(
            f"{distance:8.1f} m{found.mean():16.2f}{np.sqrt((found**2).mean()):8.2f}"
            f"{others.mean():24.2f}{np.sqrt((others**2).mean()):8.2f}"
        )
        if distance in DISTANCES and abs(found.mean()) > min(0.2, 0.1 + abs(difference(fit, distance).mean())):
            broken.append(f"{distance} m: mean difference {found.mean():.2f} of the noise")
    return Page("equal_brightness", __doc__ or "", "\n".join(lines), broken).publish(options, _draw)


def _draw(path: Path) -> None:
    """Draw the mean difference over distance, for shipped and for even bands."""
    import matplotlib

    matplotlib.use("agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(6, 4), layout="constrained")
    distances = np.linspace(1.1, 6, 25)
    for edges, label, color in (
        (BAND_EDGES_DEG, "shipped bands", OURS),
        (np.arange(1, STRIPES) * 180 / STRIPES, "even bands", OURS_TOO),
    ):
        mean = [difference(edges, float(d)).mean() for d in distances]
        axes.plot(distances, mean, color=color)
        axes.annotate(label, (distances[0], mean[0]), fontsize=8, xytext=(4, 0), textcoords="offset points")
    axes.axhline(0, color=MUTED, lw=0.6)
    axes.set(xlabel="distance [m]", ylabel="adversary minus goal [noise]")
    axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=150)
    pyplot.close(figure)


if __name__ == "__main__":
    sys.exit(main())
