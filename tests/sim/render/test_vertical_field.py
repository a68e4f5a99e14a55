"""Eyes of any height in worlds: high receptors see the mean of the square receptors that they cover."""

from dataclasses import replace

import numpy as np
import pytest

import optics
import sim
from sim.render.one_ray import receptor_direction
from sim.tasks.registry import task_of
from sim.tasks.simulation import Simulation
from tests.slow_part import slow

LENS = optics.Pupil(60e-6, thin_lens_focal_length=240e-6)
WORLDS = 8


def random_state(task, seed, n_worlds=WORLDS):
    world = sim.build_world(task, seed=seed)
    simulation = Simulation(task_of(world), n_worlds, seed)
    state = simulation.reset()
    simulation.close()
    return world, state


def chosen(world, eyes):
    """Return the chosen fidelity; behind a lens, with the eyes' own bands, because choosing bands is most of the
    work."""
    return sim.choose_fidelity(world, eyes, bands="own" if eyes.optics else "auto")


@pytest.mark.parametrize(
    ("task", "pupil", "rows", "ratio"),
    [
        ("maze", None, 1, 4),
        slow("tracking", LENS, 1, 4),
        slow("navigation", None, 3, 2),
        slow("detection", LENS, 3, 2),
    ],
)
def test_high_receptors_see_the_mean_of_square_ones(task, pupil, rows, ratio):
    world, state = random_state(task, 3)
    square = sim.Eyes(2, (rows * ratio, 5), 50.0, 70.0, optics=pupil, noise_sigma=0.01)
    high = replace(square, resolution=(rows, 5), vertical_fov_deg=square.fovy_deg)
    assert high.fovy_deg == pytest.approx(square.fovy_deg)
    renderers = [sim.BatchedRenderer(world, eyes, WORLDS, chosen(world, eyes)) for eyes in (high, square)]
    found, fine = (renderer.signals(state) for renderer in renderers)
    means = fine.reshape(*fine.shape[:3], rows, ratio, 5).mean(axis=4)
    allowed = sum(renderer.fidelity.tolerance for renderer in renderers)
    assert np.sqrt(np.mean((found - means) ** 2)) < allowed / 2
    low = sim.BatchedRenderer(world, replace(high, vertical_fov_deg=None), WORLDS, renderers[0].fidelity).signals(state)
    assert np.sqrt(np.mean((low - means) ** 2)) > 2 * np.sqrt(np.mean((found - means) ** 2))


@pytest.mark.slow
@pytest.mark.parametrize("pupil", [None, LENS])
def test_the_reference_renderer_agrees(pupil):
    world, state = random_state("detection", 5, n_worlds=3)
    eyes = sim.Eyes(1, (2, 4), 40.0, optics=pupil, noise_sigma=0.01, vertical_fov_deg=60.0)
    wide = np.tan(np.radians(20)) * 2 * 2 / 4  # receptors 1.5 times as high as wide
    eyes = replace(eyes, vertical_fov_deg=float(2 * np.degrees(np.arctan(1.5 * wide / 2))))
    reference = sim.ReferenceRenderer(world, eyes, {"type": "path", "max_depth": 3}, spp=400, samples_per_receptor=8)
    renderer = sim.BatchedRenderer(world, eyes, 3, chosen(world, eyes))
    found, expected = renderer.signals(state), reference.signals(state)
    assert np.sqrt(np.mean((found - expected) ** 2)) < renderer.fidelity.tolerance
    with pytest.raises(ValueError, match="must be a ratio of whole numbers up to 16"):
        sim.ReferenceRenderer(world, replace(eyes, vertical_fov_deg=61.2345))


def test_the_outermost_receptors_look_to_the_rim():
    eyes = sim.Eyes(1, (3, 2), 40.0, vertical_fov_deg=70.0)
    top = receptor_direction(eyes, np.array([1.0, 0, 0]), 0, 0)
    assert top[2] / top[0] == pytest.approx(np.tan(np.radians(35)) * 2 / 3)
    assert top[1] / top[0] == pytest.approx(np.tan(np.radians(20)) / 2)


@pytest.mark.parametrize("wrong", [0, -1, 180, float("nan"), "high"])
def test_bad_vertical_field(wrong):
    with pytest.raises(ValueError, match=r"Eyes: vertical_fov_deg = .*: must be in \[0.001, 170\], or None"):
        sim.Eyes(vertical_fov_deg=wrong)


def test_the_former_method_still_answers():
    with pytest.warns(FutureWarning, match="Eyes.fovy_deg"):
        assert sim.Eyes(resolution=(3, 6), fov_deg=50.0).fov_vertical_deg() == pytest.approx(26.2485, abs=1e-4)
