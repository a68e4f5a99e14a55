"""The work-precision chart shows all given points, and refuses points that it cannot show."""

from itertools import pairwise

import matplotlib
import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

from validation.pages.work_precision_chart import MUTED, OURS, Curve, Region, draw_work_precision, front


@pytest.fixture
def axes():
    return Figure(figsize=(6, 4)).subplots()


CURVES = [
    Curve("rhabdom", [3e-3, 1e-3], [1e-9, 1e-6], OURS),
    *(Curve(f"peer {i}", [1e-2, 1e-1], [1e-3, 1e-5 * (1 + 0.01 * i)]) for i in range(8)),
    Curve("", [1e-2], [1e-4], OURS, joined=False),
]


def test_every_point_lies_inside_and_is_joined_in_order_of_time(axes):
    draw_work_precision(axes, CURVES, [Region("goal", 1e-4, 1e-7)])
    lines = {line.get_color(): line for line in axes.lines if line.get_linestyle() == "-"}
    assert list(lines[OURS].get_xdata()) == [1e-3, 3e-3]
    assert list(lines[OURS].get_ydata()) == [1e-6, 1e-9]
    assert len(axes.lines) == len(CURVES)
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    for curve in CURVES:
        assert all(left < s < right for s in curve.seconds)
        assert all(low < e < high for e in curve.errors)
    assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")


def test_ours_is_drawn_over_the_others_and_stronger(axes):
    draw_work_precision(axes, CURVES)
    ours = [line for line in axes.lines if line.get_color() == OURS and line.get_linestyle() == "-"]
    others = [line for line in axes.lines if line.get_color() == MUTED]
    assert ours[0].get_linewidth() > max(line.get_linewidth() for line in others)
    assert ours[0].get_zorder() > max(line.get_zorder() for line in others)


def test_names_are_beside_the_axes_and_do_not_touch(axes):
    """Labels of eight curves that end within 1 % of one another do not overlap."""
    draw_work_precision(axes, CURVES)
    names = [text for text in axes.texts if text.get_text()]
    assert sorted(text.get_text() for text in names) == sorted(curve.label for curve in CURVES if curve.label)
    axes.figure.canvas.draw()
    names.sort(key=lambda text: text.xyann[1])
    heights = [Text.get_window_extent(text).height for text in names]  # without the line to the curve
    middles = [text.xyann[1] * axes.bbox.height for text in names]
    for (low, below), (high, above) in pairwise(zip(middles, heights, strict=True)):
        assert high - low >= (below + above) / 2
    assert all(0 <= text.xyann[1] <= 1 for text in names)


@pytest.mark.parametrize(
    ("seconds", "errors", "word"),
    [([], [], "0 seconds"), ([1], [1, 2], "must be equal"), ([0], [1], "above 0"), ([1], [np.nan], "finite")],
)
def test_points_that_no_logarithm_takes_are_refused(axes, seconds, errors, word):
    with pytest.raises(ValueError, match=rf"mine: .*{word}"):
        draw_work_precision(axes, [Curve("mine", seconds, errors)])


def test_front_keeps_what_nothing_beats():
    points = [(1, 1e-2), (2, 1e-3), (3, 5e-3), (4, 1e-5), (1, 1e-1), (9, np.inf)]
    assert front(points) == [(1, 1e-2), (2, 1e-3), (4, 1e-5)]
    assert front([]) == []


def test_no_global_state_of_matplotlib_is_touched(axes):
    before = dict(matplotlib.rcParams)
    draw_work_precision(axes, CURVES)
    assert dict(matplotlib.rcParams) == before
