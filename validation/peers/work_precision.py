"""Error against time of `optics.psf` and other diffraction codes, on ideal lenses and a near-field aperture

The reference is the first Rayleigh-Sommerfeld integral. A peer starts from a sampled field, its preparations are not
timed, and its overall scale is fitted. `optics.psf` starts from radius and focal length, and is not fitted. Without
--peers, the peers' points are the stored ones, with their date and machine. The goals are ratios of times, so they are
only indicative in that case.

    python -m validation.peers.work_precision [--peers [PEER ...] [--write]] [--rounds N] [--cases f/2 ...]

The script prints tables and goals, draws the figure, and exits with 1 if a goal is missed. `pip install .[peers]`
installs the peers.
"""

from __future__ import annotations

import argparse
import os
import platform
import sys
from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path

from validation.pages.work_precision_chart import OURS, OURS_TOO, Curve, Region, draw_work_precision, front
from validation.peers import installed
from validation.peers.goals import ACCURATE, CONVERGED_PEER, FASTER, SINGLE, own_best, verdicts
from validation.peers.measure import one_thread, our_points, peer_points, quickest
from validation.peers.points import STORED, Point, read_points, write_points
from validation.peers.problem import CASES, Case, Peer

COLORS = {"float32": OURS, "float64": OURS_TOO}


def measure(
    cases: Sequence[Case], machine: str, rounds: int, rivals: Mapping[Peer, str]
) -> tuple[list[Point], list[Point]]:
    """Return points of this package and of the peers, measured alternately.

    The time of a point is the smallest of its medians over the rounds.
    """
    ours, peers = [], []
    if rivals:
        print(f"peers: {', '.join(f'{peer.distribution} {at}' for peer, at in rivals.items())}", file=sys.stderr)
    for number in range(rounds):
        for case in cases:
            print(f"round {number + 1} of {rounds}: {case.name}", file=sys.stderr, flush=True)
            with one_thread():
                ours.append(list(our_points(case, machine)))
                peers.append(list(peer_points(case, machine, rivals)))
    return quickest(ours), quickest(peers)


def table(points: Sequence[Point]) -> str:
    """Return a table of the best error of every method of every code, with its time."""
    series: dict[tuple[str, ...], list[Point]] = defaultdict(list)
    for point in points:
        series[point.case, point.peer, point.method, point.dtype].append(point)
    lines = [f"{'case':<11} {'code':<14} {'method':<38} {'dtype':<11} {'samples':>7}  {'best error':<10} {'ms':>9}"]
    for (case, peer, method, dtype), found in sorted(series.items()):
        best = min(found, key=lambda point: (point.error, point.seconds))
        lines.append(
            f"{case:<11} {peer:<14} {method:<38} {dtype:<11} {best.samples:>7}  {best.error:<10.1e} "
            f"{1e3 * best.seconds:>9.3g}"
        )
    return "\n".join(lines)


def curves(ours: Sequence[Point], peers: Sequence[Point]) -> list[Curve]:
    """Return the Pareto front of each code; for this package, a front for each dtype, and all methods as dots."""
    found = []
    for peer in sorted({point.peer for point in peers}):
        kept = front((point.seconds, point.error) for point in peers if point.peer == peer)
        if kept:
            found.append(Curve(peer, *zip(*kept, strict=True)))
    psfs = [point for point in ours if point.kind != "angular spectrum"]
    for dtype, color in COLORS.items():
        mine = [point for point in psfs if point.dtype == dtype]
        every = [(point.seconds, point.error) for point in mine if point.error > 0]
        chosen = front((point.seconds, point.error) for point in mine if point.method.startswith("auto"))
        if chosen:
            found.append(Curve("", *zip(*every, strict=True), color, joined=False))
            found.append(Curve(f"rhabdom, {dtype}", *zip(*chosen, strict=True), color))
    return found


def regions(peers: Sequence[Point]) -> list[Region]:
    """Return the regions of the goals for this package, given the peers' points of a case."""
    found = []
    converged = [point.seconds for point in peers if point.error <= CONVERGED_PEER]
    if converged:
        found.append(Region("goal 2", min(converged), SINGLE))
    best = own_best(peers)
    if best:
        found.append(Region("goal 1", min(point.seconds for point in best) / FASTER, ACCURATE))
    return found


def _power(value: float) -> str:
    mantissa, exponent = f"{value:.0e}".split("e")
    factor = "" if mantissa == "1" else rf"{mantissa}\times"
    return rf"${factor}10^{{{int(exponent)}}}$"


def draw(ours: Sequence[Point], peers: Sequence[Point], path: Path, caption: str) -> None:
    from matplotlib.figure import Figure

    cases = list(dict.fromkeys(point.case for point in ours))
    columns = min(3, len(cases))
    rows = -(-len(cases) // columns)
    figure = Figure(figsize=(6 * columns, 4.3 * rows + 0.6), layout="constrained")
    every = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes, case in zip(every, cases, strict=False):
        mine, others = ([point for point in points if point.case == case] for points in (ours, peers))
        draw_work_precision(axes, curves(mine, others), regions(others), TITLES.get(case, case))
    for axes in every[len(cases) :]:
        axes.set_visible(False)
    figure.suptitle("Error against time: lower left is better", fontsize=13)
    figure.supxlabel(f"{LEGEND}\n{caption}", fontsize=8.5, color="#444444")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)


LEGEND = (
    "thick lines: methods that the planner chooses; dots: all exact methods, selected by name; "
    "grey: the best methods of each other code\n"
    f"goal 1: an error of {_power(ACCURATE)}, at least {FASTER:g} times as fast as the first other code to reach its "
    f"own smallest error\n"
    f"goal 2: an error of {_power(SINGLE)} in float32, before any other code reaches {_power(CONVERGED_PEER)}"
)
TITLES = {
    case.name: f"ideal lens {case.name}, window ±10 λ f/#" if case.has_lens else "circular aperture, near field"
    for case in CASES
}


def main(arguments: list[str] | None = None) -> int:
    options = _options(arguments)
    cases = [case for case in CASES if case.name in options.cases]
    rivals = _rivals(options.peers)
    ours, peers = measure(cases, options.machine, options.rounds, rivals)
    if not rivals:
        peers = [point for point in read_points(options.stored) if point.case in options.cases]
    stamps = ", ".join(sorted({f"{point.date} on {point.machine}" for point in peers})) or "none"
    source = "measured in this run" if rivals else f"stored ({stamps})"
    print(table([*ours, *peers]))
    print(f"peers: {source}; one thread")
    if options.write:
        names = {peer.distribution for peer in rivals}
        others = [p for p in read_points(options.stored) if p.case not in options.cases or p.peer not in names]
        write_points([*others, *peers], options.stored)
        print(f"written: {options.stored}")
    path = options.out / "work_precision.png"
    draw(ours, peers, path, f"one thread of {options.machine}; peers {source}, overall scale fitted")
    print(f"figure: {path}")
    found = verdicts(ours, peers)
    print("\n".join(map(str, found)))
    if not rivals:
        print("ratios to stored points are indicative only; --peers measures both in one run")
    missed = [verdict for verdict in found if not verdict.passed]
    print(f"{len(missed)} of {len(found)} goals missed" if missed else "all goals hold")
    return 1 if missed else 0


def _rivals(names: list[str] | None) -> Mapping[Peer, str]:
    """Return peers to run, with their versions: all that are installed for an empty list, none for None."""
    if names is None:
        return {}
    return {peer: at for peer, at in installed().items() if not names or peer.distribution in names}


def _options(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    names = [case.name for case in CASES]
    parser.add_argument("--peers", nargs="*", metavar="PEER", help="run all installed peers, or only these")
    parser.add_argument("--write", action="store_true", help="store the peers' points (with --peers)")
    parser.add_argument("--stored", type=Path, default=STORED, help="file of the stored points")
    parser.add_argument("--rounds", type=int, default=1, help="number of measurements; the fastest counts")
    parser.add_argument("--cases", nargs="+", default=names, choices=names, metavar="CASE", help=", ".join(names))
    parser.add_argument("--machine", default=f"{os.cpu_count()} cores {platform.machine()}", help="name of the machine")
    parser.add_argument("--out", type=Path, default=Path("validation/figures"), help="directory for the figure")
    options = parser.parse_args(arguments)
    unknown = set(options.peers or ()) - {peer.distribution for peer in installed()}
    if unknown:
        parser.error(f"--peers {' '.join(sorted(unknown))}: not installed, or unknown")
    if options.write and options.peers is None:
        parser.error("--write stores what --peers measures: give both")
    if options.rounds < 1:
        parser.error(f"--rounds {options.rounds}: must be at least 1")
    return options


if __name__ == "__main__":
    sys.exit(main())
