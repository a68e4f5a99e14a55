"""Levels with given errors: an error at the limit is allowed, and a larger one causes a warning."""

import warnings
from dataclasses import dataclass

import numpy as np
import pytest

import optics
import sim
from sim.eyes.depth_layers import ONE_PSF
from sim.render import fidelity_stages
from sim.render.fidelity import Level
from sim.render.fidelity_choice import Samples, Shares, cheapest

EYE = sim.Eyes(n_eyes=1, resolution=(5, 5)).eye()
ALLOWED = 0.01


@dataclass(frozen=True)
class Given:
    """Stages with one level each; its name is that of a level of light.

    errors: predicted error of each level, as a multiple of the allowed error; 0 if missing
    has_depth: False if there is no choice of depth layers
    """

    errors: dict[str, float]
    has_depth: bool = True
    eye = EYE
    allowed = ALLOWED
    shares = None

    def _level(self, stage):
        return Level(stage, "direct", self.errors.get(stage, 0) * ALLOWED, "given")

    def bands(self):
        return self._level("bands")

    def depth(self, allowed):
        return ONE_PSF, self._level("depth") if self.has_depth else None

    def light(self, depth, allowed):
        return self._level("light")

    def samples(self, depth, light, allowed):
        return Samples("rays", light, 1, self._level("samples"), enough=True)


@pytest.mark.parametrize(
    ("stage", "has_depth"),
    [("depth", True), ("light", True), ("samples", True), ("light", False), ("samples", False)],
)
def test_a_stage_whose_error_is_too_large_causes_a_warning(stage, has_depth):
    with pytest.warns(sim.FidelityWarning, match=rf"1\.5 times the allowed 1\.0e-02, mostly from {stage}: direct"):
        cheapest(Given({stage: 1.5}, has_depth))


def test_errors_at_the_limit_and_the_bound_of_the_bands_cause_no_warning():
    with warnings.catch_warnings(action="error"):
        cheapest(Given({"bands": 9, "depth": 1, "light": 1, "samples": 1}))


class Distances:
    """Trials in which surfaces are visible from 1 m to 20 m, and depth layers must not be tried."""

    def distances(self):
        return np.linspace(1, 20, 1000)

    def errors_of_layers(self, finest, counts):
        pytest.fail("depth layers are tried although one PSF is accurate enough")


def test_one_psf_is_chosen_if_its_error_equals_the_allowed_one():
    eyes = sim.Eyes(n_eyes=1, resolution=(5, 5), optics=optics.Pupil(1e-4))
    bound = fidelity_stages.depth(Distances(), eyes.eye(), np.inf)[1].predicted_error
    assert bound > 0
    depth, level = fidelity_stages.depth(Distances(), eyes.eye(), bound)
    assert (depth, level.predicted_error) == (ONE_PSF, bound)


@pytest.mark.parametrize("has_layers", [True, False])
@pytest.mark.parametrize("light", [0.0, 0.1, 0.5])
def test_samples_may_use_the_rest_of_the_allowed_error(has_layers, light):
    """Squares of errors add up; omitted light counts with its error, but at most with its share."""
    found = Shares(bands=0.3, depth=0.4, light=0.5).left(0.5, has_layers, light)
    spent = 0.09 + 0.16 * has_layers
    assert found.without_light == pytest.approx(0.5 * np.sqrt(1 - spent))
    assert found.error == pytest.approx(0.5 * np.sqrt(1 - spent - min(2 * light, 0.5) ** 2))
