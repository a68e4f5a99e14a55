"""Claims of other codes' tests and of textbooks

Do the claims of other codes' tests and of textbooks also hold for the results of `optics`? All 89 claims hold.

**Method.** The test suites of prysm, poppy and hcipy compare results with closed forms, and textbooks contain tables of
values. Each of these values is computed with the functions of `optics`.

**Table.** Each row shows the value from the source ("theirs"), our value, and the largest difference that is allowed
between them. If a test suite states a bound, the same bound is used. Most claims are paraxial approximations, which
agree with the exact integral only at large F-numbers. Most systems therefore have f/100. At smaller F-numbers, the
bound is wider. Lengths are in units of λf/D.

**Limits.** The claims listed below the table cannot be tested with `optics`. Each one is followed by the reason.

    python -m validation.peers.peer_claims [--out DIR] [--docs DIR]
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

from validation.pages.page import Page, parser
from validation.peers.claims.claim import Case
from validation.peers.claims.suite_claims import of_hcipy, of_poppy, of_prysm
from validation.peers.claims.textbook_aberrations import of_strehl_ratios, of_wavefronts
from validation.peers.claims.textbook_apertures import of_circles, of_openings, on_the_axis
from validation.peers.claims.unexpressed import UNEXPRESSED

FEWEST = 50


def cases() -> Iterator[Case]:
    for family in (of_prysm, of_hcipy, of_poppy, of_circles, of_openings, on_the_axis, of_strehl_ratios, of_wavefronts):
        yield from family()


def answered(asked: list[Case]) -> tuple[list[float], str, list[str]]:
    """Return the differences divided by their bounds, the table, and the claims that do not hold."""
    shares, broken, lines = [], [], []
    source = ""
    for case in asked:
        ours = case.ours()
        off = abs(ours - case.theirs)
        shares.append(off / case.bound if case.bound else float(off > 0) * 2)
        if off > case.bound:
            broken.append(f"{case.source}: {case.says}: {case.theirs:.4g} there, {ours:.4g} here")
        if case.source != source:
            lines.append(case.source)
            source = case.source
        lines.append(f"  {case.says:<70}{case.theirs:>9.4f}{ours:>9.4f}{case.bound:>9.0e}")
    head = f"{'':<72}{'theirs':>9}{'ours':>9}{'bound':>9}"
    named = [f"{where}\n  {why}" for where, why in UNEXPRESSED]
    foot = f"{len(asked)} claims, {len(asked) - len(broken)} hold"
    return shares, "\n".join([head, *lines, "", foot, "", "claims without a counterpart here:", *named]), broken


def draw(path: Path, shares: list[float]) -> None:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
    axes.semilogy([max(share, 1e-6) for share in shares], "o", ms=4)
    axes.axhline(1.0, color="black", lw=1)
    axes.set(xlabel="claim", ylabel="difference over its bound", title="Claims of other codes' tests and of textbooks")
    axes.grid(True, alpha=0.3)
    figure.savefig(path, dpi=120)
    plt.close(figure)


def main() -> int:
    chosen = parser(__doc__).parse_args()
    asked = list(cases())
    shares, table, broken = answered(asked)
    if len(asked) < FEWEST:
        broken.append(f"{len(asked)} claims: must be at least {FEWEST}")
    return Page("peer_claims", __doc__, table, broken).publish(chosen, lambda path: draw(path, shares))


if __name__ == "__main__":
    sys.exit(main())
