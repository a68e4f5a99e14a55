"""Signals of one kind of eyes, with stand-ins for renderers, receptors and noise: order of steps, states and bounds."""

from types import SimpleNamespace

import numpy as np
import pytest
from gymnasium import spaces

import optics
from sim.envs import eyes_of_kind
from sim.envs.eyes_of_kind import EyesOfKind
from sim.envs.observation import Memory
from sim.envs.ommatidia_space import OmmatidiaBox
from sim.render.pending_frame import PendingFrame
from sim.render.receptor_noise import NoiseModel


def pending(value):
    frame = PendingFrame.__new__(PendingFrame)
    frame.wait = lambda: value
    frame.then = lambda function: pending(function(value))
    return frame


class Worlds:
    """Stand-in for a simulation of three worlds."""

    n, variation = 3, None

    def __init__(self, seconds=0.2, passed=("early", "late")):
        self.physics = SimpleNamespace(substeps=12, frames=1, seconds=seconds)
        if passed is not None:
            self.physics.passed = list(passed)

    def light(self, wavelengths):
        return "light"


def eye(**changes):
    given = {
        "spectral_bands": SimpleNamespace(wavelengths=[5e-7]),
        "noise_sigma": 0.0,
        "receptor_photons": None,
        "channels": 3,
        "resolution": (2, 4),
        "photon_budget": None,
    }
    return SimpleNamespace(**{**given, **changes})


def kind(worlds=None, frames=2, memory=2, brightest=1.0, **changes):
    """Return the signals of two eyes, each with three channels and 2 x 4 receptors."""
    renderer = SimpleNamespace(
        eye=eye(**changes),
        mounts=["a", "b"],
        fidelity=SimpleNamespace(frames=frames),
        brightest=brightest,
        only_directional=True,
    )
    keys = np.arange(3, dtype=np.uint64)
    return EyesOfKind(worlds or Worlds(), renderer, keys, memory)


# --- space


@pytest.mark.parametrize("brightest", [1.0, 4.0])
def test_bounds_of_noiseless_signals(brightest):
    """The limit is twice the signal of a white surface that faces all lights. float32 rounds by 1e-4 at most."""
    space = kind(brightest=brightest).space
    assert isinstance(space, spaces.Box)
    assert space.shape == (2, 2, 3, 2, 4)
    margin = 1e-4 * brightest
    np.testing.assert_allclose([space.low.min(), space.low.max()], -margin, rtol=1e-6)
    np.testing.assert_allclose([space.high.min(), space.high.max()], 2 * brightest + margin, rtol=1e-6)


def test_noise_widens_the_bounds_by_ten_standard_deviations():
    found = kind(noise_sigma=0.3, receptor_photons=np.full((3, 2, 4), 50.0))
    spread = np.sqrt(0.3**2 + 2 / 50)
    np.testing.assert_allclose(found.space.low.min(), -10 * spread - 1e-4, rtol=1e-6)
    np.testing.assert_allclose(found.space.high.max(), 2 + 10 * spread + 1e-4, rtol=1e-6)


def test_signals_near_a_point_light_have_no_bounds():
    found = kind()
    found.renderer.only_directional = False
    space = found._space((2, 3))
    assert (space.low == -np.inf).all()
    assert (space.high == np.inf).all()


@pytest.mark.parametrize(
    ("changes", "bounded"),
    [
        ({}, True),
        ({"adaptation": "logarithmic"}, False),
        ({"motion": "barlow_levick"}, False),
        ({"event_threshold": 0.1}, False),
    ],
)
def test_adapting_receptors_have_no_bounds(changes, bounded):
    """Motion detectors double the number of channels. Shot noise in each of two frames adds to the margin."""
    found = kind(dynamics=optics.ReceptorDynamics(50.0, **changes), noise_sigma=0.1)
    channels = 6 if "motion" in changes else 3
    assert found.space.shape == (2, 2, channels, 2, 4)
    if bounded:
        np.testing.assert_allclose(found.space.low.max(), -10 * 0.1 - 1e-4, rtol=1e-5)
    else:
        assert (found.space.low == -np.inf).all()
        assert (found.space.high == np.inf).all()


@pytest.mark.parametrize(("budget_s", "share"), [(None, 1.0), (0.05, 2.0)])
def test_shot_noise_belongs_to_frames(budget_s, share):
    """A frame lasts 0.1 s, half of an action. The remaining noise is added after the receptors' filters."""
    budget = None if budget_s is None else SimpleNamespace(integration_time=budget_s)
    photons = np.full((3, 2, 4), 50.0, np.float32)
    found = kind(
        dynamics=optics.ReceptorDynamics(50.0), noise_sigma=0.1, receptor_photons=photons, photon_budget=budget
    )
    assert found._in_time._ms == pytest.approx(100.0)
    np.testing.assert_allclose(found._shot.photons, 50.0 * share)
    assert found._noise == NoiseModel(0.1)
    spread = np.sqrt(2 / (50 * share)) + 0.1
    np.testing.assert_allclose(found.space.high.max(), 2 + 10 * spread + 1e-4, rtol=1e-5)
    assert found._simulation.physics.frames == 2


def test_receptors_with_dynamics_need_no_noise_and_one_frame_by_default():
    found = kind(dynamics=optics.ReceptorDynamics(50.0), frames=None)
    assert (found._shot, found._noise) == (None, None)
    assert found._in_time._ms == pytest.approx(200.0)


@pytest.mark.parametrize("of_light", [False, True])
def test_varied_light_is_as_bright_as_the_brightest_that_can_be_drawn(of_light):
    found = kind()
    found.renderer.brightest_in = {"dim": 0.5, "bright": 4.0, "mean": 2.0}.__getitem__
    variation = SimpleNamespace(of_light=of_light, extremes=lambda wavelengths: ["dim", "bright", "mean"])
    found._simulation = SimpleNamespace(variation=variation)
    assert found._brightest() == (4.0 if of_light else 1.0)
    found._simulation.variation = None
    assert found._brightest() == 1.0


def test_ommatidia_are_a_list(monkeypatch):
    """A compound eye with rows is observed as an image."""

    class Compound(SimpleNamespace):
        def as_frames(self, signals):
            return signals.reshape(*signals.shape[:-4], -1, 3)

        def directions_on(self, mounts):
            assert mounts == ["a", "b"]
            return np.eye(3)

    monkeypatch.setattr(eyes_of_kind, "CompoundEye", Compound)
    for rows in (None, 2):
        renderer = SimpleNamespace(
            eye=Compound(**vars(eye()), rows=rows), mounts=["a", "b"], brightest=1.0, only_directional=True
        )
        found = EyesOfKind(Worlds(), renderer, np.arange(3, dtype=np.uint64), 2)
        renderer.launch = lambda poses, light: pending(np.zeros((3, 2, 3, 2, 4)))
        assert isinstance(found.space, OmmatidiaBox) == (rows is None)
        assert found.space.shape == ((2, 16, 3) if rows is None else (2, 2, 3, 2, 4))
        assert found.launch("poses").wait().shape == ((3, 16, 3) if rows is None else (3, 2, 3, 2, 4))


# --- rendering


@pytest.mark.parametrize("worlds", [None, [0, 2]])
def test_noise_of_rendered_worlds(worlds):
    found, asked = kind(noise_sigma=0.25), []
    found.renderer.launch = lambda poses, light: pending((poses, light, None))
    found.renderer.launch_some = lambda poses, worlds, light: pending((poses, light, worlds))
    found._normals = SimpleNamespace(launch=lambda worlds: asked.append(worlds) or pending("normals"))
    found._noise = lambda signals, normals: (signals, normals)
    assert found.launch("poses", worlds).wait() == (("poses", "light", worlds), "normals")
    assert asked == [worlds]
    found._noise = None
    assert found.launch("poses", worlds).wait() == ("poses", "light", worlds)
    assert asked == [worlds], "without noise, no random numbers are drawn"


class Receptors:
    """Stand-in for receptors in time, which records its calls."""

    def __init__(self):
        self.calls, self.state = [], np.zeros((3, 2))

    def __getattr__(self, name):
        def record(*given):
            self.calls.append((name, *given[:-1], given[-1].tolist()))
            return np.zeros(2)

        return record


@pytest.mark.parametrize(
    ("worlds", "fresh", "calls"),
    [
        (None, False, ["early", "late", "store", "poses"]),
        ([0, 2], False, ["undo", "poses"]),
        ([0, 2], True, ["start", "poses"]),
        (None, True, ["start", "poses"]),
    ],
)
def test_receptors_see_all_frames_of_an_action(worlds, fresh, calls):
    """A frame that is rendered again replaces the last one, and the first frame of an episode has none before it."""
    found = kind(dynamics=optics.ReceptorDynamics(50.0))
    found._in_time = receptors = Receptors()
    asked = []
    found.renderer.launch = lambda poses, light: asked.append(None) or pending(poses)
    found.renderer.launch_some = lambda poses, worlds, light: asked.append(worlds.tolist()) or pending(poses)
    found.renderer.signals = lambda poses, light: poses
    chosen = None if worlds is None else np.array(worlds)
    found.launch("poses", chosen, fresh).wait()
    assert asked == [worlds]
    numbers = worlds or [0, 1, 2]
    steps = {
        "store": ("store", numbers),
        "undo": ("undo", numbers),
        "start": ("start", "poses", numbers),
    }
    assert receptors.calls == [
        *(steps.get(name, ("step", name, numbers)) for name in calls),
        ("reset_counts", numbers),
    ]


def test_an_action_without_earlier_frames():
    """A physics without poses within an action has one frame."""
    found = kind(Worlds(passed=None), frames=1, dynamics=optics.ReceptorDynamics(50.0))
    found._in_time = receptors = Receptors()
    found.renderer.launch = lambda poses, light: pending(poses)
    found.launch("poses").wait()
    assert [call[0] for call in receptors.calls] == ["store", "step", "reset_counts"]


def test_motion_detectors_add_no_noise():
    """The axes of signals are world, eye, channel, row and column."""
    found = kind()
    drawn = np.arange(2 * 2 * 3.0).reshape(2, 2, 3, 1, 1) + 1
    found._normals = SimpleNamespace(launch=lambda worlds: pending(drawn))
    np.testing.assert_array_equal(found._normals_of(None, drawn.shape), drawn)
    doubled = found._normals_of(None, (2, 2, 6, 1, 1))
    np.testing.assert_array_equal(doubled[:, :, :3], drawn)
    assert (doubled[:, :, 3:] == 0).all()
    assert doubled.shape == (2, 2, 6, 1, 1)
    found._shot, signals = None, np.ones(3)
    assert found._with_shot_noise(signals, None) is signals
    found._shot = lambda signals, normals: (signals, normals)
    assert found._with_shot_noise(signals, None) == (signals, drawn)


def test_noise_is_added_to_responses():
    found = kind(dynamics=optics.ReceptorDynamics(50.0), noise_sigma=0.1)
    found._in_time = Receptors()
    found.renderer.launch = lambda poses, light: pending(poses)
    found.renderer.signals = lambda poses, light: poses
    found._normals_of = lambda worlds, shape: (worlds.tolist(), shape)
    found._noise = lambda signals, normals: (signals.tolist(), normals)
    assert found.launch("poses").wait() == ([0, 0], ([0, 1, 2], (2,)))


# --- states


def test_states_of_signals():
    found = kind()
    restored = []
    found.memory = Memory(2)
    found._normals = SimpleNamespace(
        place="place", go_on_from=restored.append, restart=lambda keys: restored.append(("restart", keys))
    )
    found.memory.restore(np.arange(12.0).reshape(3, 2, 2))
    state = found.get_state()
    assert state.keys() == {"remembered", "noise"}
    assert state["noise"] == "place"
    found.set_state(state["remembered"] + 1, "elsewhere")
    np.testing.assert_array_equal(found.memory.frames_held, state["remembered"] + 1)
    found.restart("keys")
    assert restored == ["elsewhere", ("restart", "keys")]
    found._in_time = Receptors()
    state = found.get_state()
    state["receptors"] += 7
    assert (found._in_time.state == 0).all(), "a state is a copy"
    before = found._in_time.state
    found.set_state(**state)
    assert (before == 7).all(), "a state is restored in place"
    found.set_state(state["remembered"], "elsewhere")
    assert (before == 7).all()
