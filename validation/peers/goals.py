"""Goals of `optics` relative to its peers, evaluated from measured points."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from validation.peers.points import Point

__all__ = ["ACCURATE", "CONVERGED_PEER", "FASTER", "SINGLE", "Verdict", "own_best", "verdicts"]

ACCURATE, FASTER = 2e-7, 10.0  # goal 1: this error, this many times faster than a peer reaches its own best
SINGLE, CONVERGED_PEER = 1e-5, 1e-3  # goal 2: this error in float32, sooner than any peer reaches the other
COMPARABLE = 2.0  # goal 3: largest ratio between errors of plain angular spectra
NO_SLOWER = 1.0


@dataclass(frozen=True)
class Verdict:
    goal: int
    case: str
    passed: bool
    sentence: str

    def __str__(self) -> str:
        return f"{'pass' if self.passed else 'FAIL'}  goal {self.goal}  {self.case:<11} {self.sentence}"


def verdicts(ours: Sequence[Point], peers: Sequence[Point]) -> list[Verdict]:
    """Evaluate every goal on every case of our points."""
    found = []
    for case in dict.fromkeys(point.case for point in ours):
        mine, others = ([point for point in points if point.case == case] for points in (ours, peers))
        psfs = [point for point in mine if point.kind != "angular spectrum"]
        found += [_accuracy(case, psfs, others), _single_precision(case, psfs, others)]
        found += _angular_spectra(case, mine, others)
    return sorted(found, key=lambda verdict: verdict.goal)


def _accuracy(case: str, ours: Sequence[Point], peers: Sequence[Point]) -> Verdict:
    best = own_best(peers)
    rival, mine = min(best, key=_seconds, default=None), _fastest(ours, ACCURATE)
    if rival is None:
        return Verdict(1, case, False, "no peer to compare with")
    if mine is None:
        return Verdict(1, case, False, f"{ACCURATE:g} not reached; best is {min(map(_error, ours), default=1):.1e}")
    most = min(best, key=_error)
    ratio = rival.seconds / mine.seconds
    return Verdict(
        1,
        case,
        ratio >= FASTER,
        f"{_named(mine)}; {ratio:.3g}x faster than the fastest peer at its own best ({_named(rival)}), "
        f"{most.seconds / mine.seconds:.3g}x than the most accurate ({_named(most)})",
    )


def _single_precision(case: str, ours: Sequence[Point], peers: Sequence[Point]) -> Verdict:
    mine = _fastest([point for point in ours if point.dtype == "float32"], SINGLE)
    rival = _fastest(peers, CONVERGED_PEER)
    if mine is None:
        return Verdict(2, case, False, f"{SINGLE:g} not reached in float32")
    if rival is None:
        return Verdict(2, case, True, f"{_named(mine)}; no peer reaches {CONVERGED_PEER:g}")
    passed = mine.seconds < rival.seconds
    return Verdict(2, case, passed, f"{_named(mine)}; {rival.seconds / mine.seconds:.3g}x faster than {_named(rival)}")


def _angular_spectra(case: str, ours: Sequence[Point], peers: Sequence[Point]) -> list[Verdict]:
    """Compare angular spectra with equal samples.

    Errors are relative to the smallest error of the peers. Times are relative to the time of the fastest peer with a
    comparable error.
    """
    found = []
    spectra = [[point for point in points if point.kind == "angular spectrum"] for points in (ours, peers)]
    for samples in sorted({point.samples for point in spectra[0]} & {point.samples for point in spectra[1]}):
        mine, others = ([point for point in points if point.samples == samples] for points in spectra)
        least = min(map(_error, others))
        rival = min((point for point in others if point.error <= COMPARABLE * least), key=_seconds)
        good = [point for point in mine if point.error <= COMPARABLE * least]
        best = min(good or mine, key=_seconds)
        passed = bool(good) and best.seconds <= NO_SLOWER * rival.seconds
        sentence = f"{samples} samples: {_named(best)}; {best.error / least:.2g}x the error in "
        found.append(
            Verdict(3, case, passed, sentence + f"{best.seconds / rival.seconds:.2g}x the time of {_named(rival)}")
        )
    return found


def own_best(peers: Iterable[Point]) -> list[Point]:
    """Return the point with the smallest error of each peer, without paraxial methods.

    Paraxial methods solve another problem, and by chance they are most accurate with a handful of samples.
    """
    found: dict[str, Point] = {}
    for point in peers:
        if point.kind != "paraxial" and (point.peer not in found or point.error < found[point.peer].error):
            found[point.peer] = point
    return list(found.values())


def _fastest(points: Iterable[Point], error: float) -> Point | None:
    return min((point for point in points if point.error <= error), key=_seconds, default=None)


def _named(point: Point) -> str:
    return f"{point.peer} {point.method}: {point.error:.1e} in {1e3 * point.seconds:.3g} ms"


def _error(point: Point) -> float:
    return point.error


def _seconds(point: Point) -> float:
    return point.seconds
