"""Old names continue to work, warn once, and name the new one."""

import warnings

import numpy as np
import pytest

import optics
import sim
from evolve.store.candidate import Candidate
from optics.numerics import renamed
from optics.point_spread.psf_result import PSFResult
from sim.render.eye_renderer import EyeRenderer


@pytest.fixture(autouse=True)
def no_warnings_yet(monkeypatch):
    monkeypatch.setattr(renamed, "_warned", set())


@pytest.mark.parametrize(
    ("owner", "old", "new"),
    [
        (PSFResult, "can_be_seen_anew", "can_recompute"),
        (PSFResult, "through", "recompute_on"),
        (PSFResult, "held", "window_sums"),
        (optics.SpectralBands, "of", "band_values"),
        (sim.Poses, "of", "from_data"),
        (EyeRenderer, "begin", "launch"),
        (EyeRenderer, "begin_some", "launch_some"),
        (Candidate, "of", "from_evaluation"),
    ],
)
def test_old_names_are_the_new_ones(owner, old, new):
    with pytest.warns(FutureWarning, match=rf"{owner.__name__}\.{old} is now called {new}"):
        found = getattr(owner, old)
    assert found == getattr(owner, new)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        getattr(owner, old)


def test_old_names_of_instances():
    result = optics.psf(optics.Pupil(20e-6), wavelengths=[550e-9], sensor_distance=500e-6, dx=2e-6, shape=(9, 9))
    with pytest.warns(FutureWarning, match="window_sums"):
        assert np.array_equal(result.held, result.window_sums)
    with pytest.warns(FutureWarning, match="can_recompute"):
        assert result.can_be_seen_anew is result.can_recompute


@pytest.mark.parametrize("base", [sim.Task, sim.BatchTask])
def test_a_task_with_the_old_method_is_served(base):
    def feels(self, worlds):
        return np.ones(2)

    with pytest.warns(FutureWarning, match=r"Old\.feels is now called proprioception"):
        old = type("Old", (base,), {"feels": feels})
    assert old.proprioception is feels


def test_a_task_with_both_methods_uses_the_new_one():
    methods = {"feels": lambda self, data: np.zeros(1), "proprioception": lambda self, data: np.ones(1)}
    both = type("Both", (sim.Task,), methods)
    assert both.proprioception is methods["proprioception"]
