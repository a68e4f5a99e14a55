"""Search for a lens by gradient and by CMA-ES

python -m experiments.lens_search [--run SEED ...] [--methods METHOD ...] [--docs DIR]
"""

from __future__ import annotations

import statistics
import sys
from argparse import Namespace
from collections.abc import Sequence
from itertools import product
from pathlib import Path

import numpy as np

from experiments.lens_optimizers import (
    BOUNDS,
    METHODS,
    POPULATION,
    RADIUS,
    RELIEF_HEIGHT,
    SPOTS,
    WAVELENGTH,
    Row,
    best_lens,
    searched,
)
from experiments.page import Figure, Page, exit_code, markdown_table, new_figure, parser, save
from experiments.store import Origin, read_rows, write_rows

__all__ = ["found_after", "page"]

GOOD = 0.8  # Strehl ratio from which an image counts as diffraction-limited (Maréchal)
COMPARED = ("gradient, shrinking spot", "gradient, Strehl ratio", "CMA-ES, Strehl ratio")
COLORS = ("#0072B2", "#56B4E9", "#D55E00", "#E69F00")


def searches(rows: Sequence[Row], method: str) -> list[list[Row]]:
    """Return a method's searches, one per seed, with rows in order of evaluations."""
    seeds = sorted({row.seed for row in rows if row.method == method})
    return [sorted((r for r in rows if (r.method, r.seed) == (method, s)), key=lambda r: r.evaluations) for s in seeds]


def found_after(search: Sequence[Row]) -> Row | None:
    """Return the row of a search from which on all rows have a good lens; None if the last row has none."""
    kept = None
    for row in reversed(search):
        if row.strehl < GOOD:
            break
        kept = row
    return kept


def page(rows: Sequence[Row], origin: Origin) -> Page:
    """Return the page of results, made from stored searches."""
    paraboloid, refined = (next(row.strehl for row in rows if row.method == bound) for bound in BOUNDS)
    ours, direct, theirs = (searches(rows, method) for method in COMPARED)
    (pictures, seconds), (their_pictures, their_seconds) = (_medians(runs) for runs in (ours, theirs))
    return Page(
        name="lens_search",
        command="python -m experiments.lens_search --run 0 1 2 3 4",
        values={
            "gradient_pictures": f"{pictures:.0f}",
            "gradient_seconds": f"{seconds:.1f}",
            "cma_pictures": f"{their_pictures:.0f}",
            "cma_seconds": f"{their_seconds:.0f}",
            "seeds": str(len(ours)),
            "good": f"{GOOD:g}",
            "stuck": str(sum(found_after(search) is None for search in direct)),
            "direct": str(len(direct)),
            "methods": table(rows),
            "paraboloid": f"{paraboloid:.5f}",
            "bound": f"{refined:.5f}",
            "radius_um": f"{1e6 * RADIUS:g}",
            "wavelength_nm": f"{1e9 * WAVELENGTH:g}",
            "relief_um": f"{1e6 * RELIEF_HEIGHT:g}",
            "spots_um": ", ".join(f"{1e6 * s:g}" for s in SPOTS),
            "population": str(POPULATION),
        },
        figures=[Figure("lens_search", lambda path: draw(rows, path))],
        origin=origin,
    )


def _medians(runs: Sequence[Sequence[Row]]) -> tuple[float, float]:
    """Return the median evaluations and seconds to a good lens, over the searches that found one."""
    found = [row for search in runs if (row := found_after(search))]
    if not found:
        return float("nan"), float("nan")
    return statistics.median(row.evaluations for row in found), statistics.median(row.cpu_seconds for row in found)


def table(rows: Sequence[Row]) -> str:
    """Return a table of the searches' results, with a row per method."""
    lines = []
    for method in METHODS:
        runs = searches(rows, method)
        if not runs:
            continue
        evaluations, seconds = _medians(runs)
        good = sum(found_after(search) is not None for search in runs)
        of = "" if good == len(runs) else f" (of the {good})"
        ends = ", ".join(f"{search[-1].strehl:.3f}" for search in runs)
        lines.append([method, f"{good} of {len(runs)}", f"{evaluations:.0f}{of}", f"{seconds:.1f}{of}", ends])
    header = ["method", f"above {GOOD:g}", "PSFs until then", "core seconds", "Strehl ratio at the end, all seeds"]
    return markdown_table(header, lines)


def draw(rows: Sequence[Row], path: Path) -> None:
    """Draw the Strehl ratio over the number of PSFs and over time."""
    figure, axes = new_figure(10, 4.1, columns=2, sharey=True)
    for method, color in zip(METHODS, COLORS, strict=True):
        for number, search in enumerate(searches(rows, method)):
            strehl = np.array([row.strehl for row in search])
            for place, cost in zip(axes[0], ("evaluations", "cpu_seconds"), strict=True):
                spent = [getattr(row, cost) for row in search]
                place.semilogx(spent, strehl, color=color, lw=1.3, label=method if number == 0 else None)
    for place in axes[0]:
        place.axhline(GOOD, color="#777777", ls=":", lw=1)
    axes[0, 0].set(xlabel="PSFs computed", ylabel="Strehl ratio", ylim=(0, 1.03))
    axes[0, 1].set(xlabel="time of one core [s]", xlim=(0.3, None))
    axes[0, 0].legend(frameon=False, fontsize=9, loc="upper left", bbox_to_anchor=(0.0, 0.77))
    figure.suptitle("A gradient finds a lens with a fraction of the PSFs if the loss has a slope")
    save(figure, path)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run and store searches if requested; make the page from the stored rows."""
    options = parser(__doc__ or "")
    options.add_argument("--run", type=int, nargs="+", metavar="SEED", help="run searches from these seeds")
    options.add_argument("--methods", nargs="+", choices=METHODS, default=list(METHODS), help="methods (default: all)")
    chosen = options.parse_args(arguments)
    return exit_code("lens_search", lambda: _made(chosen))


def _made(chosen: Namespace) -> None:
    data, origin = (chosen.docs / "data" / f"lens_search.{kind}" for kind in ("csv", "json"))
    if chosen.run:
        import drjit as dr

        dr.set_thread_count(1)
        for method, seed in product(chosen.methods, chosen.run):
            found = searched(method, seed)
            print(f"{method}, seed {seed}: {found[-1].evaluations} PSFs, {found[-1].strehl:.3f}", flush=True)
            rows = [row for row in read_rows(Row, data) if (row.method, row.seed) != (method, seed)] + found
            write_rows(rows, data)
        bounds = [Row(name, 0, 1, 0.0, value) for name, value in zip(BOUNDS, best_lens(), strict=True)]
        rows = [row for row in read_rows(Row, data) if row.method not in BOUNDS]
        write_rows([*rows, *bounds], data)
        ends = {(row.method, row.seed): row.cpu_seconds for row in rows}
        Origin.here(sum(ends.values()) / 3600).write(origin)
    rows = read_rows(Row, data)
    if not rows:
        raise ValueError(f"{data} holds no searches; search with --run SEED ...")
    page(rows, Origin.read(origin)).publish(chosen.docs)


if __name__ == "__main__":
    sys.exit(main())
