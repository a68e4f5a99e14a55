"""The number of frames per action for receptors with dynamics, with stand-ins for worlds and eyes."""

from types import SimpleNamespace

import numpy as np
import pytest

import optics
from sim.envs import frame_choice
from sim.envs.frame_choice import _chosen, _played, _responses, dynamics_of, require_frames, with_frames
from sim.render.fidelity import Fidelity, Level

PHYSICS = {"substeps": 12, "frames": 1, "passed": []}


@pytest.mark.parametrize(
    ("physics", "frames", "reason"),
    [
        (PHYSICS, 4, None),
        (PHYSICS, 5, r"frames = 5: must be a divisor of the 12 physics steps of an action"),
        ({**PHYSICS, "frames": 4}, 4, None),
        ({**PHYSICS, "frames": 4}, 6, r"frames = 6 and 4: must be the same for all eyes of a world"),
        ({}, 1, None),
        ({}, 2, r"frames = 2: must be 1, the physics SimpleNamespace has no poses within an action"),
    ],
)
def test_frames_of_physics(physics, frames, reason):
    simulation = SimpleNamespace(physics=SimpleNamespace(**physics))
    if reason is not None:
        with pytest.raises(ValueError, match=f"^{reason}$"):
            require_frames(simulation, frames)
        return
    require_frames(simulation, frames)
    assert getattr(simulation.physics, "frames", frames) == frames


@pytest.mark.parametrize("frames", [1, 2, 3, 6])
def test_responses_follow_from_the_last_frame_of_each_interval(frames):
    """Frames that are not rendered do not matter."""
    dynamics = optics.ReceptorDynamics(50.0)
    signals = np.random.default_rng(0).random((4, 6, 2, 1, 1, 2, 3))
    hidden = signals.copy()
    for k in range(6):
        if (k + 1) % (6 // frames):
            hidden[:, k] = np.nan
    hidden[0, 0] = signals[0, 0]  # from which receptors start
    found = _responses(dynamics, hidden, frames, 0.1)
    assert found.shape == (4, 2, 1, 1, 2, 3)
    assert np.isfinite(found).all()
    np.testing.assert_allclose(found, _responses(dynamics, signals, frames, 0.1))
    steady = np.broadcast_to(signals[:1, :1], signals.shape)
    np.testing.assert_allclose(_responses(dynamics, steady, frames, 0.1)[-1], signals[0, 0], rtol=1e-5)
    assert _responses(dynamics, signals[:0], frames, 0.1).tolist() == [0]


def test_events_are_counted_in_each_action():
    """The light rises by a factor of e in every action, which gives four events with a threshold of 1/4."""
    dynamics = optics.ReceptorDynamics(1e-3, event_threshold=0.2501, dark_light=1e-9)
    light = np.exp(np.arange(4.0) + 1)
    signals = np.broadcast_to(light[:, None, None, None, None, None, None], (4, 2, 1, 1, 1, 1, 1))
    found = _responses(dynamics, signals, 2, 0.1).ravel()
    assert found[0] == 0, "receptors start in the steady state"
    assert set(found[1:]) <= {3, 4}


class Worlds:
    """Stand-in for a simulation of two agents, which ends an episode in an action, by default the third one."""

    def __init__(self, task=None, worlds=4, seed=0, steps=12, passed=True, last=3):
        self.last = last
        self.n, self.agents = worlds, [SimpleNamespace(n_actions=2), SimpleNamespace(n_actions=1)]
        self.physics = SimpleNamespace(substeps=steps, frames=1, seconds=0.1)
        if passed:
            self.physics.passed = ["early", "late"]
        self.calls, self.closed = [], False

    def reset(self):
        self.calls.append("reset")

    def move(self, commanded):
        self.calls.append(commanded)

    def poses(self):
        return "end"

    def judge(self, infos):
        return SimpleNamespace(done=np.array([False, len(self.calls) == self.last + 1]))

    def close(self):
        self.closed = True


def test_random_actions_end_with_the_first_episode():
    worlds, codes = Worlds(), {"early": 1, "late": 2, "end": 3}
    renderers = [SimpleNamespace(signals=lambda poses, k=k: np.full((4, k), codes[poses])) for k in (1, 2)]
    one, two = _played(worlds, renderers)
    assert (one.shape, two.shape) == ((3, 3, 4, 1), (3, 3, 4, 2))
    np.testing.assert_array_equal(two[:, :, 0, 0], [[1, 2, 3]] * 3)
    first, *actions = worlds.calls
    assert first == "reset"
    assert np.array(actions).shape == (3, 4, 3)
    random = np.random.default_rng(0)
    numbers = [np.hstack([random.uniform(-1, 1, (4, 2)), random.uniform(-1, 1, (4, 1))]) for _ in range(3)]
    np.testing.assert_array_equal(actions, numbers)
    assert len(_played(Worlds(last=99), renderers)[0]) == 6, "a trial has six actions"


@pytest.mark.parametrize(
    ("steps", "passed", "numbers"),
    [
        (12, True, [1, 2, 3, 4, 6, 12]),
        (40, True, [1, 2, 4, 5, 8, 10, 20]),
        (42, True, [1, 2, 3, 6, 7, 14]),
        (1, True, [1]),
        (12, False, [1]),
    ],
)
def test_the_number_of_frames_suffices_for_all_eyes(monkeypatch, steps, passed, numbers):
    """The error of the first eye is 3 / frames, that of the second 6 / frames; 2 is allowed."""
    worlds = Worlds(steps=steps, passed=passed)
    eyes = [
        SimpleNamespace(eye=SimpleNamespace(dynamics=size), fidelity=SimpleNamespace(tolerance=1)) for size in (3, 6)
    ]
    plain = SimpleNamespace(eye=SimpleNamespace())
    monkeypatch.setattr(frame_choice, "Simulation", lambda *given: worlds if given == ("task", 4, 0) else None)
    kinds = [SimpleNamespace(eyes={"a": eyes[0], "plain": plain}), None, SimpleNamespace(eyes={"b": eyes[1]})]
    monkeypatch.setattr(frame_choice, "renderers_for", lambda *_: kinds)
    monkeypatch.setattr(frame_choice, "allowed_error", lambda eye, tolerance: 2.0)
    monkeypatch.setattr(frame_choice, "_played", lambda worlds, renderers: [np.zeros((5, 1))] * len(renderers))
    monkeypatch.setattr(
        frame_choice,
        "_responses",
        lambda size, signals, frames, seconds: np.array([0.0 if frames == numbers[-1] else size / frames * 1.0]),
    )
    frames, level = _chosen("task", [], None)
    assert worlds.closed
    if numbers == [1]:
        assert (frames, level) == (1, Level("frames", "1 per action", None, "an action is one physics step"))
        return
    assert worlds.physics.frames == numbers[-1]
    enough = next(n for n in numbers if 6 / n <= 2)
    assert (frames, level.level) == (enough, f"{enough} per action")
    assert level.predicted_error == pytest.approx(max(6 / enough, 3 / next(n for n in numbers if 3 / n <= 2)))
    listed = ", ".join(map(str, numbers))
    assert level.why == f"fewest of {listed} for the allowed error in 5 random actions"


LEVEL = Level("frames", "6 per action", 0.5, "a trial")
PLAIN = SimpleNamespace(name="plain", eye=SimpleNamespace())


def kind(frames=None, name="timed"):
    return SimpleNamespace(name=name, eye=SimpleNamespace(dynamics=SimpleNamespace(frames=frames)))


def task(*agents):
    return SimpleNamespace(agents=lambda: [SimpleNamespace(kinds=kinds) for kinds in agents])


def fidelity(frames=None, levels=()):
    return Fidelity(1, 2, frames=frames, levels=levels)


@pytest.fixture
def trials(monkeypatch):
    """Return the arguments of all trials. Each finds six frames."""
    found = []
    monkeypatch.setattr(frame_choice, "_chosen", lambda *given: found.append(given) or (6, LEVEL))
    return found


def test_eyes_without_dynamics_have_no_frames(trials):
    given = [{"plain": fidelity()}, None]
    found = with_frames(task([PLAIN], [kind()]), given, None)
    assert found == given
    assert found is not given
    assert trials == []
    assert dynamics_of(PLAIN.eye) is None


def test_a_trial_sets_the_frames_of_all_eyes(trials):
    """Fidelities that were chosen automatically record the reason."""
    other = Level("rays", "8", None, "other")
    given = [{"timed": fidelity(levels=(other,)), "plain": fidelity()}, None]
    worlds = task([kind(), PLAIN], [kind()])
    found = with_frames(worlds, given, "scenes")
    assert found == [{"timed": fidelity(6, (other, LEVEL)), "plain": fidelity(6)}, None]
    assert trials == [(worlds, given, "scenes")]


@pytest.mark.parametrize(("of_fidelity", "of_dynamics"), [(4, None), (None, 4), (4, 5)])
def test_frames_that_are_specified_need_no_trial(trials, of_fidelity, of_dynamics):
    """A fidelity has priority over the receptors of the same eye."""
    other = Level("rays", "8", None, "other")
    given = [{"timed": fidelity(of_fidelity, (other,)), "second": fidelity()}]
    (found,) = with_frames(task([kind(of_dynamics), kind(name="second")]), given, None)
    reason = Level("frames", "4 per action", None, "as requested")
    assert found == {"timed": fidelity(4, (other, reason)), "second": fidelity(4)}
    assert trials == []


def test_fidelities_that_all_specify_frames_stay_as_they_are(trials):
    given = [{"timed": fidelity(4)}]
    assert with_frames(task([kind()]), given, None) == given
    with pytest.raises(ValueError, match=r"^frames = 3 and 4: must be the same for all eyes of a world$"):
        with_frames(task([kind(), kind(3, "second")]), [{"timed": fidelity(4), "second": fidelity()}], None)
