"""Searches for compound eyes in bright and in dim light, as preregistered in docs/results/evolved_facets_plan.md

python -m experiments.facet_searches --list
python -m experiments.facet_searches DIR [--workers N]

DIR holds the runs, each in its own folder. The second command continues unfinished runs and starts missing ones, one
after another, until all are complete. It can be interrupted at any time and called again.
"""

from __future__ import annotations

import itertools
import sys
from collections.abc import Sequence

from experiments import planned_searches
from experiments.planned_searches import PlannedSearch

__all__ = ["LIGHTS", "LOOKS", "main", "searches"]

LIGHTS = {"bright": 1e4, "dim": 30.0}  # illuminance in each group of searches [lx]
FIRST_SEEDS = {"bright": 0, "dim": 10}  # equal seeds would give equal first generations and dependent searches
LOOKS = (3, 6, 9)  # numbers of pairs of searches after which the test is computed
FROZEN = {
    "placement_range_deg": 45,
    "fov_deg": 60,
    "acute_zone": 1,
    "f_number": 2,
    "rhabdom_length_um": 200,
    "memory_frames": 4,
}
# Lowest, highest and start value of each gene that evolves. At the start, facets take 93 % of the surface.
OPEN = {
    "resolution_height": (4, 12, 6),
    "resolution_width": (4, 12, 7),
    "facet_diameter_um": (4, 16, 8),
    "rhabdom_diameter_um": (1, 4, 2),
}
# The learner has the settings of experiments.facets_and_light.
SETTINGS = (
    *("eye.facet_area=5e-9", "eye.noise_sigma=0.002", "eye.rays_per_receptor=8"),
    *("search.population=8", "search.generations=5", "search.sigma=0.4", "search.active=false"),
    *("learning.total_steps=131072", "learning.eval_interval=65536"),
    *("learning.n_epochs=10", "learning.decay_after=75000"),
)


def searches() -> list[PlannedSearch]:
    """Return all searches in the order in which they run: each search in dim light follows one in bright light."""
    return [_search(light, pair) for pair, light in itertools.product(range(max(LOOKS)), LIGHTS)]


def _search(light: str, pair: int) -> PlannedSearch:
    seed = FIRST_SEEDS[light] + pair
    frozen = (f"genome.{name}.{part}" for name, v in FROZEN.items() for part in ("open=false", f"start={v}"))
    ranges = (
        f"genome.{name}.{end}={value}"
        for name, values in OPEN.items()
        for end, value in zip(("low", "high", "start"), values, strict=True)
    )
    own = (f"eye.illuminance={LIGHTS[light]:g}", f"seed={seed}")
    return PlannedSearch(f"facets-{light}-{pair}", "detection", "compound", (*SETTINGS, *frozen, *ranges, *own))


def main(arguments: Sequence[str] | None = None) -> int:
    """List the searches, or carry them out."""
    return planned_searches.main(__doc__ or "", searches(), arguments)


if __name__ == "__main__":
    sys.exit(main())
