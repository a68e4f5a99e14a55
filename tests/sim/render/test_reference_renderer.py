"""The batched renderer against the reference: Mitsuba's integrators on the mirror, and the convolution of optics."""

import dataclasses

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

import optics
import sim
from sim.eyes import eyes, receptive_fields
from sim.scene.variant import variant
from sim.tasks.registry import task_of
from sim.tasks.simulation import Simulation
from sim.tracing import lighting, spheres

EYES = sim.Eyes(n_eyes=2, resolution=(5, 7), fov_deg=60, placement_range_deg=70, bands=3, noise_sigma=0)
BATCHES, SPP = 12, 96  # Mitsuba takes 1152 samples per receptor, with their standard error
RAYS = 1024
PSF_TOLERANCE = 0.01  # the tolerance of Eye; both sides integrate PSFs over cells, but over different ones
# Five random worlds: fields with agent and objects at random positions, and mazes. The tests of the batched renderer
# compare detection and navigation with Mitsuba.
WORLDS = (("tracking", 4), ("tracking", 5), ("maze", 0), ("maze", 1), ("foraging", 6))
OF_MUTANTS = slice(4)
LIGHTS = {"direct": "direct", "bounce": {"type": "path", "max_depth": 3}}  # our name and Mitsuba's


def random_world(task, seed):
    """Return a world with one agent that looks at something near, at an object if there is one."""
    world = sim.build_world(task, seed=seed)
    rng = np.random.default_rng(seed)
    simulation = Simulation(task_of(world), 1, seed)
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
    """Return BATCHES independent renderings of the first world."""
    batches = []
    for renderer.seed in range(BATCHES):
        batches.append(getattr(renderer, method)(state)[0])
    return np.array(batches)


def z_scores(ours, batches, floor=1e-5):
    """Return the deviations in standard errors.

    floor: a minimum added to the standard error. The default is float32's rounding in a uniformly lit receptor, for
    which the reference has no variance either.
    """
    error = batches.std(axis=0, ddof=1) / np.sqrt(len(batches))
    return (ours - batches.mean(axis=0)) / (error + floor)


def pictures(world, state, light, tracer="auto"):
    """Return the renderer's radiance (eye, band, y, x)."""
    renderer = sim.BatchedRenderer(world, EYES, 1, sim.Fidelity(RAYS, EYES.bands, light=light), tracer)
    return np.moveaxis(renderer.receptor_radiance(state)[:, 0], 0, 1)


@pytest.fixture(scope="module", params=LIGHTS)
def seen(request):
    """Return the light, and for each world its state and the reference's renderings (batch, eye, band, y, x)."""
    worlds = [random_world(*which) for which in WORLDS]
    return request.param, [
        (world, state, seeds(sim.ReferenceRenderer(world, EYES, LIGHTS[request.param], SPP), "pictures", state))
        for world, state in worlds
    ]


@dataclasses.dataclass(frozen=True)
class Disagreement:
    """Differences from the reference.

    They are the share of receptors beyond 3 standard errors in any band, and the largest and the root-mean-square |z|
    of image means. All bands of a receptor share Mitsuba's samples. With bounced light, our samples are as random as
    Mitsuba's, and equal in number.
    """

    beyond: float
    largest: float
    usual: float

    @classmethod
    def of(cls, light, ours, theirs):
        scale, both = (np.sqrt(2) if light == "bounce" else 1), list(zip(ours, theirs, strict=True))
        beyond = np.concatenate([np.abs(z_scores(o, t) / scale).max(axis=1).ravel() > 3 for o, t in both])
        means = np.array([z_scores(o.mean(axis=(2, 3)), t.mean(axis=(3, 4))) / scale for o, t in both])
        return cls(beyond.mean(), np.abs(means).max(), np.sqrt(np.mean(means**2)))

    @property
    def significant(self):
        """True if a difference is larger than chance explains.

        By chance, |t| with 11 degrees of freedom exceeds 3 in 1.2 % of receptors, and receptors at an edge add our own
        sampling error. One of ten images exceeds 5 with p = 4e-3. The root mean square of images is 1.1 ± 0.2.
        """
        return self.beyond > 0.04 or self.largest > 5 or self.usual > 1.8


def test_random_worlds_look_as_they_do_to_mitsuba(seen):
    """Images agree within standard errors, band by band, for each kind of light."""
    light, worlds = seen
    ours, theirs = [pictures(world, state, light) for world, state, _ in worlds], [t for *_, t in worlds]
    found = Disagreement.of(light, ours, theirs)
    assert not found.significant, found
    assert min(t.std() for t in theirs) > 0.03  # the images are not uniform


def left_out(monkeypatch):
    monkeypatch.setattr(lighting, "BOUNCE", None)


def bodies_in_each_others_place(monkeypatch):
    nearest = spheres.nearest

    def swapped(spheres, centres, ray, t):
        return nearest(spheres, centres[::-1], ray, t)

    monkeypatch.setattr(spheres, "nearest", swapped)


def lights_without_shadows(monkeypatch):
    monkeypatch.setattr(spheres, "blocks", lambda radii, centres, ray: dr.zeros(mi.Bool))


@pytest.mark.parametrize("seen", ["bounce"], indirect=True)  # test_batched_renderer.py has the mutants of direct light
@pytest.mark.parametrize("sabotage", [left_out, bodies_in_each_others_place, lights_without_shadows])
def test_a_wrong_bounce_is_noticed(seen, monkeypatch, sabotage):
    light, worlds = seen
    with variant():
        sabotage(monkeypatch)
        ours = [pictures(world, state, light) for world, state, _ in worlds[OF_MUTANTS]]
    assert Disagreement.of(light, ours, [t for *_, t in worlds[OF_MUTANTS]]).significant


@pytest.mark.parametrize("task", ["detection", "navigation", "foraging"])
def test_both_tracers_follow_the_same_bounces(task):
    """Single rays agree, for grey materials and others, except for rays that graze an edge at either end."""
    world, state = random_world(task, 3)
    fidelity = sim.Fidelity(16, EYES.bands, light="bounce")
    ours, theirs = (
        sim.BatchedRenderer(world, EYES, 1, fidelity, name).radiance(state) for name in ("closed_form", "mitsuba")
    )
    assert (np.abs(ours - theirs).max(axis=-1) > 2e-3).mean() < 4e-3


def prism(eyes):
    """Return eyes with a pupil whose PSF is off centre, to the side and up."""
    slope = np.linspace(-1, 1, 65)
    relief = 6e-6 * np.add.outer(0.5 * slope, slope)
    return dataclasses.replace(eyes, optics=optics.Pupil(0.15 * eyes.sensor_width, height=relief, n=1.5))


@pytest.fixture(scope="module")
def through_a_prism():
    world, state = random_world("detection", 1)
    eyes = prism(EYES)
    return world, state, eyes, seeds(sim.ReferenceRenderer(world, eyes, "direct", 32), "signals", state)


def departs(through_a_prism):
    """Return whether signals deviate from the reference by more than its standard errors and PSF_TOLERANCE."""
    world, state, eyes, batches = through_a_prism
    found = sim.BatchedRenderer(world, eyes, 1, sim.Fidelity(256, eyes.bands)).signals(state)[0]
    floor = PSF_TOLERANCE * batches.mean()
    each = z_scores(found, batches, floor)
    images = z_scores(found.mean(axis=(2, 3)), batches.mean(axis=(3, 4)), floor)
    # The root mean square of t_11 is 1.1. P(|t_11| > 5) = 4e-4 for each of six images, which share their samples in
    # threes.
    return np.sqrt(np.mean(each**2)) > 1.5 or np.abs(images).max() > 5


def test_signals_behind_a_pupil_are_the_reference_convolutions(through_a_prism):
    assert not departs(through_a_prism)


def flipped_field(monkeypatch):
    of = receptive_fields._averaged
    monkeypatch.setattr(receptive_fields, "_averaged", lambda kernel, cells: of(kernel, cells)[:, :, ::-1])


def misweighted_band(monkeypatch):
    uniform = optics.SpectralBands.uniform

    def wrong(*args):
        bands = uniform(*args)
        return dataclasses.replace(bands, weights=bands.weights * [1, 1.1, 1])

    monkeypatch.setattr(optics.SpectralBands, "uniform", wrong)


def swapped_eyes(monkeypatch):
    azimuths = eyes.Eyes.azimuths
    monkeypatch.setattr(eyes.Eyes, "azimuths", lambda self: -azimuths(self))


@pytest.mark.parametrize("sabotage", [flipped_field, misweighted_band, swapped_eyes])
def test_parity_is_lost_when_something_is_wrong(through_a_prism, monkeypatch, sabotage):
    sabotage(monkeypatch)
    assert departs(through_a_prism)


@pytest.fixture(scope="module")
def at_rhabdoms():
    """Return signals behind the same prism and rhabdoms whose width is a seventh of a receptor's pitch. The kernel is
    off centre.
    """
    world, state = random_world("detection", 1)
    eyes = dataclasses.replace(prism(EYES), waveguide=optics.Waveguide(4e-6))
    return world, state, eyes, seeds(sim.ReferenceRenderer(world, eyes, "direct", 32), "signals", state)


def test_rhabdoms_see_in_worlds_what_they_do_in_pictures(at_rhabdoms):
    assert at_rhabdoms[2].eye().white_signal < 0.3 * at_rhabdoms[2].eye().throughput
    assert not departs(at_rhabdoms)


@pytest.mark.parametrize("sabotage", ["averaged", "turned"])
def test_rhabdoms_parity_is_lost_when_something_is_wrong(at_rhabdoms, monkeypatch, sabotage):
    """The mutants average over squares as for other receptors, or flip the kernel."""
    of = receptive_fields._as_wide
    wrong = {
        "averaged": lambda kernels: receptive_fields._averaged(
            of(kernels), receptive_fields.cells_for(at_rhabdoms[2].eye())
        ),
        "turned": lambda kernels: of(kernels)[:, ::-1, ::-1],
    }
    monkeypatch.setattr(receptive_fields, "_as_wide", wrong[sabotage])
    assert departs(at_rhabdoms)


def test_shapes_and_light_levels():
    """Shapes agree with the batched renderer's, (env, eye, ray, band). Light that is reflected twice makes scenes
    brighter.
    """
    world, state = random_world("maze", 0)
    direct, path = (sim.ReferenceRenderer(world, EYES, kind, 64) for kind in ("direct", "path"))
    dark, light = direct.radiance(state), path.radiance(state)
    assert dark.shape == (1, 2, 5 * 7, 3)
    assert direct.signals(state).shape == (1, 2, 3, 5, 7)
    assert 1.01 < light.mean() / dark.mean() < 1.3


def test_scalar_variant_needs_no_llvm():
    world, state = random_world("maze", 0)
    eyes = dataclasses.replace(EYES, resolution=(2, 3), n_eyes=1)
    slow = sim.ReferenceRenderer(world, eyes, "direct", 4096, variant="scalar_spectral").radiance(state).mean()
    exact = sim.BatchedRenderer(world, eyes, 1, sim.Fidelity(4096, eyes.bands)).receptor_radiance(state).mean()
    assert slow == pytest.approx(exact, rel=0.04)  # four standard errors
