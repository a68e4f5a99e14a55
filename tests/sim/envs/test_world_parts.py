"""Parts of all worlds: stored states, memories, senses, renderers and prepared tasks, with stand-ins."""

from types import SimpleNamespace

import numpy as np
import pytest
from gymnasium import spaces

from sim.envs import auxiliary, senses
from sim.envs.auxiliary import Auxiliary
from sim.envs.held_state import checked, chosen_worlds
from sim.envs.observation import Memory
from sim.envs.ommatidia_space import OmmatidiaBox
from sim.envs.senses import Senses
from sim.physics.mujoco_worlds import MODELS

# --- stored states

LIKE = {"steps": np.zeros(2), "physics": np.zeros((2, 3))}
ONE = {"steps": np.zeros(1), "physics": np.zeros((1, 3)), MODELS: np.zeros((1, 5))}


def test_states_with_the_same_entries_are_accepted():
    assert checked(LIKE, LIKE) is LIKE
    assert checked({"steps": [1, 2], "physics": [[0.0] * 3] * 2}, LIKE)["steps"] == [1, 2]
    for state in (ONE, {name: ONE[name] for name in ("steps", "physics")}):
        assert checked(state, ONE) is state, "the model of a single world is optional"


@pytest.mark.parametrize(
    ("state", "like", "reason"),
    [
        (7, LIKE, "must be the return value of get_state, with the entries steps, physics"),
        ({"steps": LIKE["steps"]}, LIKE, "must be the return value of get_state"),
        ({**LIKE, "more": LIKE["steps"]}, LIKE, "must be the return value of get_state"),
        ({**LIKE, MODELS: LIKE["steps"]}, LIKE, "must be the return value of get_state"),
        ({"steps": ONE["steps"], MODELS: ONE[MODELS]}, ONE, "must be the return value of get_state"),
        ({**LIKE, "physics": np.zeros((2, 4))}, LIKE, r"physics has shape \(2, 4\): must be \(2, 3\)"),
        ({**ONE, MODELS: np.zeros((1, 4))}, ONE, r"has shape \(1, 4\): must be \(1, 5\)"),
    ],
)
def test_other_states_are_refused(state, like, reason):
    with pytest.raises(ValueError, match=reason):
        checked(state, like)


def test_chosen_worlds():
    for worlds, expected in ((None, [0, 1, 2]), (0, [0]), ([2, 0], [2, 0]), (np.array([1], np.uint8), [1])):
        assert chosen_worlds(worlds, 3).tolist() == expected
    for worlds in (3, -1, [0, 3], [-1, 0], [0.0], ["a"], [[0, 1]], [True]):
        with pytest.raises(ValueError, match=r"^worlds = .*: must be numbers of worlds, from 0 to 2"):
            chosen_worlds(worlds, 3)


# --- memories


def frame(*values):
    return np.array(values)[:, None]


def test_memories_of_past_frames():
    """The first frame of an episode fills the memory. The axes are world, memory and the frame's own."""
    memory, nobody = Memory(3), np.array([], int)
    assert not memory.begun
    assert memory.remember(frame(1, 2), nobody).shape == (2, 3, 1)
    assert memory.begun
    memory.remember(frame(3, 4), nobody)
    found = memory.remember(frame(5, 6), np.array([1]))
    assert found[..., 0].tolist() == [[1, 3, 5], [6, 6, 6]]
    np.testing.assert_array_equal(memory.frames_held, found)
    assert memory.newest[:, 0].tolist() == [5, 6]
    preview = memory.preview(frame(7), np.array([0]))
    assert preview[..., 0].tolist() == [[3, 5, 7]]
    np.testing.assert_array_equal(memory.frames_held, found, "a preview stores nothing")
    memory.restore(found + 1)
    assert memory.frames_held[..., 0].tolist() == [[2, 4, 6], [7, 7, 7]]


def test_a_memory_of_one_frame():
    memory, given = Memory(1), frame(1, 2)
    found = memory.remember(given, np.array([0]))
    assert found.tolist() == [[[1]], [[2]]]
    found += 5
    assert memory.newest[:, 0].tolist() == [1, 2]
    assert memory.preview(frame(7), np.array([0])).tolist() == [[[7]]]
    assert memory.frames_held.shape == (2, 1, 1)


# --- senses


def agent(**changes):
    given = {"n_actions": 2, "first_action": np.array([0.5, -0.5], np.float32), "auxiliary": (), "name": "prey"}
    return SimpleNamespace(**{**given, **changes})


class Sight:
    """Stand-in for the signals of one kind of eyes, which records its calls."""

    def __init__(self, simulation, renderer, keys, memory):
        self.renderer, self.keys, self.calls, self.memory = renderer, [keys], [], Memory(memory)
        self.space = spaces.Box(0, 1, (memory, 1))
        self.restart, self.state = self.keys.append, {}

    def launch(self, *given):
        self.calls.append(given)
        return f"frame of {self.renderer}"

    def get_state(self):
        return {"remembered": f"memory of {self.renderer}", "noise": f"noise of {self.renderer}"}

    def set_state(self, **state):
        self.state = state


@pytest.fixture
def two_kinds(monkeypatch):
    """Return the senses of the second agent, which has two kinds of eyes with auxiliary entries."""
    monkeypatch.setattr(senses, "EyesOfKind", Sight)
    monkeypatch.setattr(
        senses,
        "Auxiliary",
        lambda renderer, names, prefix: SimpleNamespace(
            spaces={f"{prefix}depth": spaces.Box(0, 9, (1,))}, poses=[], label=(renderer, names)
        ),
    )
    felt = {"feels": np.array([[1.0, 2, 3]] * 4), "contact": np.zeros((4, 1))}
    simulation = SimpleNamespace(
        n=4,
        agents=[None, agent(auxiliary=("depth",))],
        streams=SimpleNamespace(noise_keys=[None, ["key a", "key b"]]),
        felt=[None, felt],
        task=SimpleNamespace(proprioception_ranges={"contact": (0.0, 1.0)}),
        poses=lambda: "poses",
    )
    kinds = SimpleNamespace(eyes={"left": "A", "right": "B"}, auxiliary=("label a", "label b"))
    return Senses(simulation, 1, kinds, 2)


def test_spaces_of_senses(two_kinds):
    space = two_kinds.observation_space
    assert set(space) == {"left", "right", "left_depth", "right_depth", "previous_action", "feels", "contact"}
    for box in (space["previous_action"], two_kinds.action_space):
        assert (box.low.tolist(), box.high.tolist(), box.dtype) == ([-1, -1], [1, 1], np.float32)
    assert (space["feels"].low.tolist(), space["feels"].high.tolist()) == ([-np.inf] * 3, [np.inf] * 3)
    assert (space["contact"].low.tolist(), space["contact"].high.tolist()) == ([0], [1])
    assert two_kinds.action.tolist() == [[0.5, -0.5]] * 4
    assert two_kinds.renderer == "A"
    assert [one.label for one in two_kinds._auxiliary] == [("label a", ("depth",)), ("label b", ("depth",))]


def test_a_single_kind_of_eyes_needs_no_prefix(two_kinds):
    two_kinds._simulation.streams.noise_keys[1] = ["key a"]
    alone = Senses(two_kinds._simulation, 1, SimpleNamespace(eyes={"eyes": "A"}, auxiliary=("label",)), 2)
    assert "depth" in alone.observation_space.spaces
    plain = Senses(two_kinds._simulation, 1, SimpleNamespace(eyes={"eyes": "A"}, auxiliary=()), 2)
    assert not plain.has_auxiliary


def test_senses_restart_launch_and_observe(two_kinds):
    left, right = two_kinds.sights.values()
    two_kinds._simulation.streams.noise_keys[1] = ["new a", "new b"]
    two_kinds.restart()
    assert (left.keys, right.keys) == (["key a", "new a"], ["key b", "new b"])
    assert two_kinds.launch("poses") == {"left": "frame of A", "right": "frame of B"}
    two_kinds.launch("poses", "worlds", True)
    assert left.calls == right.calls == [("poses", None, False), ("poses", "worlds", True)]
    assert not two_kinds.begun
    left.memory.remember(frame(1, 2, 3, 4), np.arange(4))
    assert not two_kinds.begun, "all kinds of eyes need a frame"
    seen = {"left": frame(5, 6, 7, 8), "right": frame(9, 10, 11, 12)}
    found = two_kinds.observation(seen, np.array([3]))
    assert two_kinds.begun
    assert found["left"][..., 0].tolist() == [[1, 5], [2, 6], [3, 7], [8, 8]]
    assert found["feels"].shape == (4, 3)
    assert two_kinds.now.keys() == found.keys()
    np.testing.assert_array_equal(two_kinds.now["right"], found["right"])
    found["previous_action"] += 1
    assert two_kinds.action.tolist() == [[0.5, -0.5]] * 4
    preview = two_kinds.preview(seen, np.array([1]))
    assert preview["right"][..., 0].tolist() == [[10, 10]]
    assert two_kinds.other_entries(np.array([1]))["previous_action"].tolist() == [[0.5, -0.5]]


def test_states_of_senses(two_kinds):
    """Optic flow continues from the poses of the restored state."""
    left, right = two_kinds.sights.values()
    for one in two_kinds._auxiliary:
        one.go_on_from = one.poses.append
    two_kinds._last_auxiliary = {"left_depth": np.zeros(4)}
    state = two_kinds.get_state()
    assert set(state) == {"remembered", "noise", "right.remembered", "right.noise", "left_depth", "action"}
    state["left_depth"] += 1
    state["action"] += 1
    assert (two_kinds._last_auxiliary["left_depth"] == 0).all(), "a state is a copy"
    assert two_kinds.action.tolist() == [[0.5, -0.5]] * 4
    two_kinds.set_state(state)
    assert left.state == {"remembered": "memory of A", "noise": "noise of A"}
    assert right.state == {"remembered": "memory of B", "noise": "noise of B"}
    assert two_kinds.action.tolist() == [[1.5, 0.5]] * 4
    assert two_kinds._last_auxiliary["left_depth"].tolist() == [1] * 4
    assert [one.poses for one in two_kinds._auxiliary] == [["poses"], ["poses"]]


# --- auxiliary entries


class Labels:
    """Stand-in for a renderer of depth and ids."""

    mounts = ("a", "b")
    eye, model = SimpleNamespace(resolution=(2, 3)), SimpleNamespace(ngeom=7)

    def __init__(self):
        self.calls = []

    def depth(self, poses):
        self.calls.append("depth")
        return np.array([[1.0, np.inf], [3.0, 4.0]])

    def ids(self, poses):
        self.calls.append("ids")
        return np.array([[5, -1], [6, 0]])


def test_spaces_of_auxiliary_entries():
    found = Auxiliary(Labels(), ("depth", "ids", "flow"), "left_").spaces
    depth, ids, flow = (found[f"left_{name}"] for name in ("depth", "ids", "flow"))
    assert [box.shape for box in (depth, ids, flow)] == [(2, 2, 3), (2, 2, 3), (2, 2, 2, 3)]
    bounds = [(box.low.min(), box.low.max(), box.high.min(), box.high.max()) for box in (depth, ids, flow)]
    assert bounds == [(0, 0, np.inf, np.inf), (-1, -1, 6, 6), (-np.inf, -np.inf, np.inf, np.inf)]
    assert set(Auxiliary(Labels(), ("ids",)).spaces) == {"ids"}


@pytest.mark.parametrize("names", [("depth",), ("ids",), ("flow",), ("depth", "ids"), ("flow", "depth")])
def test_auxiliary_entries(names):
    """Ids are rendered only if needed. The flow is zero at the beginning of an episode."""
    labels = Labels()
    found = Auxiliary(labels, names, "left_")
    found._flow = lambda poses, depth, ids: np.full((2, 2), 5.0)
    entries = found.render("poses", np.array([1]))
    assert set(entries) == {f"left_{name}" for name in names}
    assert labels.calls == (["depth"] if names == ("depth",) else ["depth", "ids"])
    expected = {"depth": [[1, 0], [3, 4]], "ids": [[5, -1], [6, 0]], "flow": [[5, 5], [0, 0]]}
    for name in names:
        assert entries[f"left_{name}"].tolist() == expected[name]
    assert found._before == "poses"
    found.go_on_from("earlier")
    assert found._before == "earlier"


def test_flow_is_the_reversed_motion_back_to_the_last_poses(monkeypatch):
    """Points have not moved in the first observation. Points that were not in front of the eye have no flow."""
    asked = []

    def flow(eye, depth, ids, poses, frames):
        asked.append((eye, depth, ids, poses, frames))
        return np.array([1.5, np.nan])

    monkeypatch.setattr(auxiliary, "flow_between", flow)
    labels = Labels()
    labels.eye_frames = lambda poses: f"frames of {poses}"
    found = Auxiliary(labels, ("flow",))
    assert found._flow("now", "depth", "ids").tolist() == [-1.5, 0]
    found.go_on_from("before")
    found._flow("now", "depth", "ids")
    assert asked == [
        (labels.eye, "depth", "ids", ("now", before), ("frames of now", f"frames of {before}"))
        for before in ("now", "before")
    ]


def test_spaces_with_other_directions_or_bounds_differ():
    own = OmmatidiaBox(-1, 1, (2, 3), np.eye(3))
    assert own == OmmatidiaBox(-1, 1, (2, 3), np.eye(3))
    for other in (OmmatidiaBox(-1, 1, (2, 3), -np.eye(3)), OmmatidiaBox(-1, 2, (2, 3), np.eye(3))):
        assert own != other
    assert own != spaces.Box(-1, 1, (2, 3), np.float32)
    assert (own.dtype, own.shape) == (np.float32, (2, 3))
