"""Area sampling behind a pupil against very many rays through the same pupil in the same worlds."""

import dataclasses

import numpy as np
import pytest

import optics
import sim
from sim.eyes import field_areas
from sim.worlds.world import build_world
from tests.sim.tracing.area_views import EYES, ROW, Case, views

BANDS = 4


def behind_lens(eyes, a):
    focal_length = eyes.eye().sensor_distance
    return dataclasses.replace(
        eyes, optics=optics.Pupil(a * eyes.sensor_width / 2, thin_lens_focal_length=focal_length)
    )


# An open pinhole: light of one direction falls on several receptors, and red light on more of them than blue light.
HOLE = dataclasses.replace(EYES, optics=optics.Pupil(6e-6))


@pytest.fixture(scope="module")
def cases():
    worlds = {
        "detection, a = 1/4": ("detection", behind_lens(EYES, 0.25), 256),
        "detection, a = 1/2": ("detection", behind_lens(EYES, 0.5), 256),
        "detection, hole": ("detection", HOLE, 64),
        "maze, a = 0.8": ("maze", behind_lens(ROW, 0.8), 1024),
    }
    found = {}
    for name, (task, eyes, rays) in worlds.items():
        found[name] = Case.of(build_world(task), eyes, rays)
    return found


# Largest errors over all receptors and over receptors that see an object, about a quarter more than measured with these
# views.
TOLERANCE = {
    ("detection, a = 1/4", 1): (0.224, 0.51),
    ("detection, a = 1/2", 1): (0.156, 0.38),
    ("detection, a = 1/2", 4): (0.096, 0.236),
    ("detection, hole", 1): (0.605, 1.28),
    ("detection, hole", 4): (0.255, 0.52),
    ("maze, a = 0.8", 1): (0.82, 0.0),
    ("maze, a = 0.8", 4): (0.18, 0.0),
}


@pytest.mark.parametrize(("name", "areas"), list(TOLERANCE))
def test_areas_see_what_very_many_rays_see(cases, name, areas):
    everywhere, on_objects = cases[name].errors(areas)
    assert everywhere <= TOLERANCE[name, areas][0]
    assert on_objects <= TOLERANCE[name, areas][1]


@pytest.mark.parametrize(("name", "rays"), [("detection, a = 1/4", 8), ("detection, a = 1/2", 8), ("maze, a = 0.8", 8)])
def test_one_area_errs_less_than_many_rays(cases, name, rays):
    """The limits are for all receptors and for receptors that see an object."""
    pairs = zip(cases[name].errors(1), cases[name].errors(rays, "rays"), strict=True)
    assert all(by_areas < by_rays / 2 for by_areas, by_rays in pairs if by_rays)


def sharp(self, fields, receptors, right=field_areas.FieldAreas.weights):
    """A mutant without the blur of the pupil."""
    weights = right(self, fields, receptors)
    return (weights == weights.max(axis=2, keepdims=True)) * fields.power[:, None, None]


def of_another_band(self, fields, receptors, right=field_areas.FieldAreas.weights):
    return right(self, fields, receptors)[::-1]


@pytest.mark.parametrize(
    ("mutant", "name", "areas"),
    [
        (sharp, "detection, hole", 1),
        (sharp, "detection, a = 1/4", 1),
        (of_another_band, "detection, hole", 4),
    ],
)
def test_wrong_matrices_are_noticed(cases, monkeypatch, mutant, name, areas):
    monkeypatch.setattr(field_areas.FieldAreas, "weights", mutant)
    everywhere, on_objects = cases[name].errors(areas)
    tolerance = TOLERANCE[name, areas]
    assert everywhere > tolerance[0] or on_objects > tolerance[1], (everywhere, on_objects)


def test_the_kernel_is_recorded_once(cases):
    case = cases["detection, a = 1/2"]
    renderer = sim.BatchedRenderer(case.world, case.eyes, case.state.n, sim.Fidelity(1, BANDS, samples="areas"))
    first = renderer.signals(case.state)
    other = renderer.signals(views(case.world, seed=1))
    assert renderer.recordings == 1
    assert np.abs(first - other).max() > 0.02
    np.testing.assert_array_equal(renderer.signals(case.state), first)
