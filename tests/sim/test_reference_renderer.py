"""The batched renderer against the reference: Mitsuba's integrators on the mirror, and optics' convolution."""

import dataclasses

import numpy as np
import pytest

import optics
import sim
from sim import agent, fields
from sim.simulation import Simulation

EYES = sim.Eyes(n_eyes=2, resolution=(5, 7), fov_deg=60, placement_range_deg=70, bands=3, noise_sigma=0)
BATCHES, SPP = 12, 96  # 1152 samples a receptor by Mitsuba, with their standard error
RAYS = 1024
PSF_TOLERANCE = 0.01  # Eye's own; both sides integrate PSFs over cells, but not over the same
# Ten random worlds: fields in which agent and objects are anywhere, and mazes.
WORLDS = (
    [("detection", s) for s in (1, 2, 3)] + [("tracking", s) for s in (4, 5)] + [("navigation", s) for s in range(5)]
)


def random_world(task, seed):
    """One agent that looks at something near: at an object where there are any."""
    world = sim.build_world(task, seed=seed)
    rng = np.random.default_rng(seed)
    simulation = Simulation(world, 1, seed, "training", 1)
    state = simulation.reset()
    simulation.close()
    position, heading = state.position + rng.uniform(-0.7, 0.7, (1, 2)), state.heading
    if world.objects:
        towards = rng.uniform(-np.pi, np.pi)
        away = np.array([np.cos(towards), np.sin(towards)])
        position = state.objects[:, rng.integers(3), :2] - rng.uniform(1.2, 3.0) * away
        heading = np.array([towards + rng.uniform(-0.5, 0.5)])
    return world, dataclasses.replace(state, position=position, heading=heading)


def seeds(renderer, method, state):
    """What BATCHES independent renderings of the first world give."""
    batches = []
    for renderer.seed in range(BATCHES):
        batches.append(getattr(renderer, method)(state)[0])
    return np.array(batches)


def z_scores(ours, batches, floor=1e-5):
    """floor: of the standard error; by default what float32 leaves of a uniformly lit receptor, where the reference has
    no variance either."""
    error = batches.std(axis=0, ddof=1) / np.sqrt(len(batches))
    return (ours - batches.mean(axis=0)) / (error + floor)


@pytest.fixture(scope="module")
def seen():
    """Per world: the renderer's pictures and the reference's, (batch, eye, band, y, x)."""
    found = []
    for task, seed in WORLDS:
        world, state = random_world(task, seed)
        ours = sim.BatchedRenderer(world, EYES, 1, RAYS).receptor_radiance(state)
        theirs = seeds(sim.ReferenceRenderer(world, EYES, "direct", SPP), "pictures", state)
        found.append((np.moveaxis(ours[:, 0], 0, 1), theirs))
    return found


def test_ten_random_worlds_look_as_they_do_to_mitsuba(seen):
    """Image by image and band by band within standard errors; all bands of a receptor share Mitsuba's samples."""
    beyond = np.concatenate([np.abs(z_scores(o, t)).max(axis=1).ravel() > 3 for o, t in seen])
    # P(|t_11| > 3) = 1.2 %; receptors that an edge crosses add our own sampling error.
    assert beyond.mean() < 0.04
    means = [z_scores(o.mean(axis=(2, 3)), t.mean(axis=(3, 4))) for o, t in seen]
    # Twenty images: one |t_11| beyond 5 has p = 8e-3.
    assert np.abs(means).max() < 5
    assert min(t.std() for _, t in seen) > 0.03  # there was something to see


def prism(eyes):
    """A pupil whose PSF is off centre, to the side and up."""
    slope = np.linspace(-1, 1, 65)
    relief = 6e-6 * np.add.outer(0.5 * slope, slope)
    return dataclasses.replace(eyes, optics=optics.Pupil(0.15 * eyes.sensor_width, height=relief, n=1.5))


@pytest.fixture(scope="module")
def through_a_prism():
    world, state = random_world("detection", 1)
    eyes = prism(EYES)
    return world, state, eyes, seeds(sim.ReferenceRenderer(world, eyes, "direct", 32), "signals", state)


def departs(through_a_prism):
    """Whether the signals differ from the reference's by more than its standard errors and PSF_TOLERANCE allow."""
    world, state, eyes, batches = through_a_prism
    found = sim.BatchedRenderer(world, eyes, 1, 256).signals(state)[0]
    floor = PSF_TOLERANCE * batches.mean()
    each = z_scores(found, batches, floor)
    images = z_scores(found.mean(axis=(2, 3)), batches.mean(axis=(3, 4)), floor)
    # Root mean square of t_11: 1.1; P(|t_11| > 5) = 4e-4 for each of six images, which share their samples in threes.
    return np.sqrt(np.mean(each**2)) > 1.5 or np.abs(images).max() > 5


def test_signals_behind_a_pupil_are_the_reference_convolutions(through_a_prism):
    assert not departs(through_a_prism)


def flipped_field(monkeypatch):
    of = fields._averaged
    monkeypatch.setattr(fields, "_averaged", lambda kernel, cells: of(kernel, cells)[:, :, ::-1])


def misweighted_band(monkeypatch):
    uniform = optics.SpectralBands.uniform

    def wrong(*args):
        bands = uniform(*args)
        return dataclasses.replace(bands, weights=bands.weights * [1, 1.1, 1])

    monkeypatch.setattr(optics.SpectralBands, "uniform", wrong)


def swapped_eyes(monkeypatch):
    azimuths = agent.Eyes.azimuths
    monkeypatch.setattr(agent.Eyes, "azimuths", lambda self: -azimuths(self))


@pytest.mark.parametrize("sabotage", [flipped_field, misweighted_band, swapped_eyes])
def test_parity_is_lost_when_something_is_wrong(through_a_prism, monkeypatch, sabotage):
    sabotage(monkeypatch)
    assert departs(through_a_prism)


def test_shapes_and_light_levels():
    """(env, eye, ray, band) as the batched renderer has it; light that is reflected twice makes scenes brighter."""
    world, state = random_world("navigation", 0)
    direct, path = (sim.ReferenceRenderer(world, EYES, kind, 64) for kind in ("direct", "path"))
    dark, light = direct.radiance(state), path.radiance(state)
    assert dark.shape == (1, 2, 5 * 7, 3)
    assert direct.signals(state).shape == (1, 2, 3, 5, 7)
    assert 1.01 < light.mean() / dark.mean() < 1.3


def test_scalar_variant_needs_no_llvm():
    world, state = random_world("navigation", 0)
    eyes = dataclasses.replace(EYES, resolution=(2, 3), n_eyes=1)
    slow = sim.ReferenceRenderer(world, eyes, "direct", 4096, variant="scalar_spectral").radiance(state).mean()
    exact = sim.BatchedRenderer(world, eyes, 1, 4096).receptor_radiance(state).mean()
    assert slow == pytest.approx(exact, rel=0.04)  # four standard errors
