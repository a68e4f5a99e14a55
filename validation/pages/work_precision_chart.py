"""The work-precision chart: error against time, both logarithmic. Better is lower and further left.

Our curves are in colour, curves of other codes in grey. Every curve is labelled directly instead of in a legend. Labels
stand to the right of the axes without overlaps, with a thin line to their curve's end.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

__all__ = ["MUTED", "OURS", "OURS_TOO", "Curve", "Region", "draw_work_precision", "front"]

OURS, OURS_TOO, MUTED = "#D55E00", "#0072B2", "#9A9A9A"
NAME_HEIGHT = 0.052  # of the axes, per line of text


@dataclass(frozen=True)
class Curve:
    """A curve of errors over seconds, in any order.

    joined: True for a line through the points, False for dots.
    label: name; "" for none.
    """

    label: str
    seconds: Sequence[float]
    errors: Sequence[float]
    color: str = MUTED
    joined: bool = True

    @property
    def strong(self) -> bool:
        return self.color != MUTED


@dataclass(frozen=True)
class Region:
    """Region of a goal: at most these seconds and at most this error."""

    label: str
    seconds: float
    error: float


def front(points: Iterable[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return the Pareto front of (seconds, error) pairs, fastest first."""
    kept: list[tuple[float, float]] = []
    for seconds, error in sorted(points):
        if math.isfinite(error) and (not kept or error < kept[-1][1]):
            kept.append((seconds, error))
    return kept


def draw_work_precision(axes: Any, curves: Sequence[Curve], regions: Sequence[Region] = (), title: str = "") -> None:
    """Draw all curves and goals into one pair of matplotlib axes.

    Raises:
        ValueError: a curve is empty, or has values without a logarithm.
    """
    for curve in curves:
        _check(curve)
    axes.set(xscale="log", yscale="log", title=title, xlabel="time [s]", ylabel="relative L2 error of intensity")
    low, high = _limits(curves, regions)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    for shade, region in enumerate(regions):
        _shade(axes, region, low, shade)
    for curve in sorted(curves, key=lambda curve: curve.strong):
        _line(axes, curve)
    _names(axes, [curve for curve in curves if curve.label])
    axes.grid(True, which="major", color="#E6E6E6", lw=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def _check(curve: Curve) -> None:
    if len(curve.seconds) != len(curve.errors) or not len(curve.errors):
        raise ValueError(f"{curve.label}: {len(curve.seconds)} seconds, {len(curve.errors)} errors; must be equal")
    for name, values in (("seconds", curve.seconds), ("errors", curve.errors)):
        if not all(math.isfinite(value) and value > 0 for value in values):
            raise ValueError(f"{curve.label}: {name} = {list(values)}: must be finite and above 0")


def _limits(curves: Sequence[Curve], regions: Sequence[Region]) -> tuple[np.ndarray, np.ndarray]:
    points = [pair for curve in curves for pair in zip(curve.seconds, curve.errors, strict=True)]
    points += [(region.seconds, region.error) for region in regions]
    logs = np.log10(points)
    return 10 ** (logs.min(axis=0) - 0.35), 10 ** (logs.max(axis=0) + 0.35)


def _shade(axes: Any, region: Region, low: np.ndarray, shade: int) -> None:
    from matplotlib.patches import Rectangle

    width, height = region.seconds - low[0], region.error - low[1]
    fill = (0, 0.62, 0.45, 0.10 + 0.05 * shade)
    axes.add_patch(Rectangle((low[0], low[1]), width, height, fc=fill, ec="#009E73", lw=0.8, zorder=0))
    axes.text(low[0] * 1.12, region.error * 0.75, region.label, fontsize=7.5, color="#00694D", va="top")


def _line(axes: Any, curve: Curve) -> None:
    order = np.argsort(curve.seconds)
    seconds, errors = np.asarray(curve.seconds)[order], np.asarray(curve.errors)[order]
    style = {"color": curve.color, "zorder": 3 if curve.strong else 2}
    if not curve.joined:
        axes.plot(seconds, errors, ".", ms=3.5, alpha=0.45, mew=0, **style)
        return
    axes.plot(seconds, errors, "o-", lw=2.2 if curve.strong else 1, ms=5 if curve.strong else 2.6, **style)


def _names(axes: Any, curves: Sequence[Curve]) -> None:
    """Place labels next to the axes, in the order of the curves' last points, at least a line of text apart."""
    ends = [min(zip(curve.errors, curve.seconds, strict=True)) for curve in curves]
    heights = [axes.transAxes.inverted().transform(axes.transData.transform((s, e)))[1] for e, s in ends]
    for index, height in zip(np.argsort(heights), _apart(sorted(heights)), strict=True):
        curve, (error, seconds) = curves[index], ends[index]
        axes.annotate(
            curve.label,
            (seconds, error),
            xytext=(1.02, height),
            textcoords=axes.transAxes,
            fontsize=8.5 if curve.strong else 7,
            fontweight="bold" if curve.strong else "normal",
            color=curve.color if curve.strong else "#666666",
            va="center",
            arrowprops={"arrowstyle": "-", "color": curve.color, "lw": 0.4, "alpha": 0.7, "shrinkB": 3},
            annotation_clip=False,
        )


def _apart(heights: Sequence[float]) -> list[float]:
    """Move ascending heights up just enough to separate them, then all down into the axes."""
    placed: list[float] = []
    for height in heights:
        placed.append(max(height, placed[-1] + NAME_HEIGHT) if placed else max(height, 0.02))
    for i in range(len(placed) - 1, -1, -1):
        limit = 0.98 if i == len(placed) - 1 else placed[i + 1] - NAME_HEIGHT
        placed[i] = min(placed[i], limit)
    return placed
