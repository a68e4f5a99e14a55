"""Borders that are shared by the areas of one column are computed once, with the same result as for each area
separately.
"""

import numpy as np
import pytest

import optics
import sim
from sim.tracing.areas import borders
from sim.tracing.areas.borders import Borders
from sim.worlds.world import build_world
from tests.sim.tracing.area_views import stairs, views

EYES = sim.Eyes(n_eyes=3, resolution=(6, 5))
LENS = sim.Eyes(n_eyes=2, resolution=(4, 4), optics=optics.Pupil(30e-6, thin_lens_focal_length=240e-6))


def signals(world, eyes, state, areas=2):
    fidelity = sim.Fidelity(areas, eyes.bands, light="all", samples="areas")
    return sim.BatchedRenderer(world, eyes, state.n, fidelity).signals(state)


@pytest.mark.fast_cases(2)
@pytest.mark.parametrize("task", ["detection", "stairs"])
@pytest.mark.parametrize("eyes", [EYES, LENS])
def test_shared_borders_change_nothing(monkeypatch, task, eyes):
    """Signals stay the same, except for float32's rounding of a border's direction, which decides between two walls at
    a corner.
    """
    world = stairs() if task == "stairs" else build_world(task)
    state = views(world, 8)
    shared = signals(world, eyes, state)
    monkeypatch.setattr(Borders, "shared", False)
    alone = signals(world, eyes, state)
    assert np.abs(shared - alone).max() < 1e-3
    assert np.mean(np.abs(shared - alone) < 1e-5) > 0.99


def test_borders_of_another_column_are_noticed(monkeypatch):
    world = build_world("detection")
    state = views(world, 8)
    right = signals(world, EYES, state)
    of = Borders.from_middles
    monkeypatch.setattr(
        borders.Borders,
        "from_middles",
        classmethod(lambda cls, *how: Borders(of(*how).x, np.roll(of(*how).sides, 1, axis=1))),
    )
    assert np.abs(signals(world, EYES, state) - right).max() > 1e-2


@pytest.mark.parametrize(("columns", "parts"), [(1, 1), (5, 1), (4, 2), (24, 3)])
def test_every_area_lies_between_its_borders(columns, parts):
    width = 0.31 / parts
    middles = (np.arange(columns * parts) + 0.5 - columns * parts / 2) * width
    found = Borders.from_middles(np.tile(middles, 3).astype(np.float32), width)
    assert len(found.x) == columns * parts + 1
    assert found.x[found.sides] == pytest.approx(np.tile(middles, 3)[:, None] + [-width / 2, width / 2], abs=1e-6)
    assert found.shared
    assert not Borders.from_middles(middles[:1], width).shared
    assert found.directions[:, 0] == pytest.approx(found.x)


def test_borders_of_areas_apart_stay_apart():
    found = Borders.from_middles(np.array([0.0, 5.0, 5.1]), 0.1)
    assert found.x == pytest.approx([-0.05, 0.05, 4.95, 5.05, 5.15])
    assert found.sides.tolist() == [[0, 1], [2, 3], [3, 4]]
