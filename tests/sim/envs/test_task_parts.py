"""Prepared tasks, their renderers and the test of batch tasks, with stand-ins for worlds."""

from types import SimpleNamespace

import numpy as np
import pytest

from sim.envs import batch_task_checker, prepared_task, renderers
from sim.envs.batch_task_checker import _actions, _played, _require_equal, _require_own_reset, _require_restored, _step
from sim.envs.prepared_task import PreparedTask
from sim.envs.renderers import AgentRenderers, renderers_for, scenes_for
from sim.render.fidelity import Fidelity
from sim.tasks.batch_task import BatchTask
from sim.tasks.built_in import AgentTask

# --- prepared tasks

EIGHT, TWO = Fidelity(8, 2), Fidelity(2, 2)


def built_in(**changes):
    """Return a built-in task of a learner, a frozen animal and an animal without eyes."""
    task = AgentTask.__new__(AgentTask)
    task.vary, task.world = None, "world"

    def agent(learns, policy, *kinds):
        return SimpleNamespace(
            learns=learns, policy=policy, kinds=[SimpleNamespace(name=name, fidelity=of) for name, of in kinds]
        )

    agents = [agent(True, None, ("a", "auto"), ("b", EIGHT)), agent(False, "policy", ("a", "auto")), agent(False, None)]
    task.agents = lambda: agents
    task.in_mode = lambda mode: f"in {mode}"
    vars(task).update(changes)
    return task


@pytest.fixture
def prepare(monkeypatch):
    """Return a function that prepares tasks. A scene is chosen with two rays; other models have eight."""
    monkeypatch.setattr(prepared_task, "scenes_for", lambda task: {"a": f"scene of {task.world}", "b": "other"})
    monkeypatch.setattr(prepared_task, "chosen_fidelity", lambda scene: TWO if scene == "scene of world" else None)
    monkeypatch.setattr(prepared_task, "with_frames", lambda task, fidelities, scenes: list(fidelities))
    monkeypatch.setattr(prepared_task, "fidelities_among", lambda task, number: {"a": number, "b": number})
    monkeypatch.setattr(prepared_task, "Variation", lambda vary: SimpleNamespace(of_appearances="appearance" in vary))
    return PreparedTask


@pytest.mark.parametrize("vary", [None, {}, {"light": (0, 1)}])
def test_fidelities_of_a_built_in_task(prepare, vary):
    """A fidelity that a task specifies has priority over the chosen one. Animals without eyes have none."""
    found = prepare(built_in(vary=vary))
    assert found._scenes == {"a": "scene of world", "b": "other"}
    assert found.fidelities == [{"a": TWO, "b": EIGHT}, {"a": TWO}, None]
    assert found.fidelity is TWO


def test_a_requested_fidelity_is_that_of_learners(prepare):
    found = prepare(built_in(), Fidelity(3, 3))
    assert found.fidelities == [{"a": Fidelity(3, 3), "b": Fidelity(3, 3)}, {"a": TWO}, None]


def test_models_and_varied_appearances_have_no_scene(prepare):
    user = BatchTask.__new__(type("User", (BatchTask,), {}))
    user.agents, user.vary = built_in().agents, None
    for task in (built_in(vary={"appearance": 1}), user):
        found = prepare(task)
        assert found._scenes is None
        assert found.fidelities == [{"a": 0, "b": 0}, {"a": 1, "b": 1}, None]
        assert found.elsewhere(built_in(world="there"))._scenes is None
    found = prepare(built_in())
    assert found.elsewhere(built_in(world="there"))._scenes["a"] == "scene of there"
    assert found.elsewhere(user)._scenes is None
    assert found.elsewhere(user).fidelities is found.fidelities


@pytest.mark.parametrize(("n_envs", "threads"), [(2, 2), (64, 5)])
def test_a_batch_has_at_most_one_thread_per_world(prepare, monkeypatch, n_envs, threads):
    made = []
    monkeypatch.setattr(prepared_task.dr, "thread_count", lambda: 5)
    monkeypatch.setattr(
        prepared_task, "Simulation", lambda *given: made.append(given) or SimpleNamespace(agents="agents")
    )
    monkeypatch.setattr(prepared_task, "renderers_for", lambda simulation, *given: given)
    monkeypatch.setattr(prepared_task, "EyesVecEnv", lambda simulation, *given: given)
    found = prepare(built_in())
    environment = found.vec_env(n_envs, 3, least_return=-2, episode_steps=9, render_mode="eyes")
    assert made == [(found.task, n_envs, 3, threads, -2, 9)]
    assert environment == (("agents", found.fidelities, found._scenes), 1, "eyes")
    assert found.vec_env(n_envs, 3, 4)[1:] == (4, None)


# --- renderers


def test_scenes_of_each_kind_of_eyes(monkeypatch):
    monkeypatch.setattr(renderers, "WorldScene", lambda world, eyes: (world, eyes))
    for eyes, expected in (("one", {"eyes": "one"}), (None, {}), ({"a": "x", "b": None}, {"a": "x"})):
        found = scenes_for(SimpleNamespace(world="world", eyes=eyes))
        assert found == {name: ("world", of) for name, of in expected.items()}


class BuiltRenderer:
    def __init__(self, *given):
        self.given, self.labels = given, f"labels of {given[0]}"

    from_scene = classmethod(lambda cls, *given: cls("from scene", *given))


@pytest.mark.parametrize("scenes", [None, {"a": "scene a", "b": "scene b"}])
@pytest.mark.parametrize("auxiliary", [(), ("depth",)])
def test_renderers_of_agents(monkeypatch, scenes, auxiliary):
    monkeypatch.setattr(renderers, "EyeRenderer", BuiltRenderer)
    monkeypatch.setattr(renderers, "BatchedRenderer", BuiltRenderer)
    monkeypatch.setattr(renderers, "_scene_of_model", lambda simulation, kind, fidelity: f"model {kind.name}")
    kinds = [SimpleNamespace(name="a"), SimpleNamespace(name="b")]
    one = SimpleNamespace(name="prey", kinds=kinds, auxiliary=auxiliary)
    found, nothing = renderers_for(SimpleNamespace(n=3), [one, one], [{"a": EIGHT, "b": TWO}, None], scenes)
    assert nothing is None
    given = [of.given for of in found.eyes.values()]
    if scenes is None:
        assert given == [("model a", 3, EIGHT), ("model b", 3, TWO)]
    else:
        assert given == [("from scene", "scene a", 3, EIGHT), ("from scene", "scene b", 3, TWO)]
    assert list(found.eyes) == ["a", "b"]
    assert found.auxiliary == (tuple(of.labels for of in found.eyes.values()) if auxiliary else ())
    with pytest.raises(ValueError, match="zip"):
        renderers_for(SimpleNamespace(n=3), [one], [None, None], scenes)
    assert AgentRenderers({}).auxiliary == ()


@pytest.mark.parametrize(("samples", "tracer"), [("areas", "auto"), ("rays", "mitsuba")])
def test_a_model_is_a_scene_in_the_bands_of_its_fidelity(monkeypatch, samples, tracer):
    monkeypatch.setattr(renderers, "PreparedScene", lambda *given, **options: (given, options))
    monkeypatch.setattr(renderers, "replace", lambda eye, bands: (eye, bands))
    monkeypatch.setattr(renderers, "medium_of", lambda name, medium: f"{name} {medium}")
    simulation = SimpleNamespace(
        task=SimpleNamespace(spectra="spectra", medium="fog"), physics=SimpleNamespace(model="model", varied="varied")
    )
    kind = SimpleNamespace(eye="eye", mounts="mounts")
    given, options = renderers._scene_of_model(simulation, kind, Fidelity(1, 7, samples=samples))
    assert given == ("model", ("eye", 7), "mounts")
    assert options == {"spectra": "spectra", "varied": "varied", "medium": "medium fog", "tracer": tracer}


# --- the test of batch tasks


class Judged(SimpleNamespace):
    """Stand-in for a task with its own method `judge`."""

    def judge(self):
        pass


class Worlds:
    """Stand-in for a simulation of two agents. Its state counts actions; the second world ends in the third action."""

    def __init__(self, n=3, early=False):
        self.n, self.learners, self.agents = n, 2, [SimpleNamespace(n_actions=k) for k in (1, 2)]
        self.task, self.felt = Judged(renders_early=early), [{"feels": np.zeros((n, 1))}]
        self.log, self.count, self.places, self.changed = [], np.zeros(n), np.zeros((n, 2, 3)), []

    def seed(self, seed):
        self.log.append(("seed", seed))

    def reset(self):
        self.log.append("reset")
        self.count[:] = 0

    def poses(self):
        return SimpleNamespace(geom_xpos=self.places.copy())

    def move(self, action):
        self.action = action
        return {}

    def judge(self, failed):
        self.count += 1
        for world in self.moved if hasattr(self, "moved") else ():
            self.places[world, 1, 2] += 1
        done = np.tile((np.arange(self.n) == 1) & (self.count == 3), 2)
        return SimpleNamespace(
            reward=np.tile(self.count, 2), terminated=done, success=done, done=done, changed=np.array(self.changed, int)
        )

    def restart(self, worlds):
        self.log.append(("restart", worlds.tolist()))
        self.count[worlds] = 0

    def get_state(self):
        return {"count": self.count.copy(), "odd": np.full(self.n, np.nan)}

    def set_state(self, state, worlds):
        self.log.append(("restored", worlds.tolist()))
        self.count[:] = state["count"]


def test_random_actions_are_the_same_in_all_worlds():
    many, one = _actions(Worlds(3), 4), _actions(Worlds(1), 4)
    assert (len(many), many[0].shape, many[0].dtype) == (4, (3, 3), np.float32)
    random = np.random.default_rng(0)
    for action, alone in zip(many, one, strict=True):
        np.testing.assert_array_equal(action, np.float32([random.uniform(-1, 1, 3)] * 3))
        np.testing.assert_array_equal(action[:1], alone)


def test_a_trial_restarts_worlds_that_end():
    worlds = Worlds()
    found = _played(worlds, 4)
    assert worlds.log == [("seed", 0), "reset", ("restart", [1])]
    assert [moment["reward"][:3].tolist() for moment in found] == [[1, 1, 1], [2, 2, 2], [3, 3, 3], [4, 1, 4]]
    assert set(found[0]) == {"reward", "terminated", "success", "feels feels", "places"}


@pytest.mark.parametrize(
    ("early", "moved", "changed", "named"),
    [
        (True, [], [], None),
        (True, [1], [1], None),
        (True, [1, 2], [1], 2),
        (True, [2, 0], [], 0),
        (False, [1], [], None),
    ],
)
def test_bodies_that_move_must_be_named(early, moved, changed, named):
    worlds = Worlds(early=early)
    worlds.moved, worlds.changed = moved, changed
    if named is None:
        _step(worlds, None)
        return
    with pytest.raises(ValueError, match=rf"judge: moved bodies of world {named}, which is not in Outcome.changed"):
        _step(worlds, None)


def test_a_reset_changes_only_its_world():
    worlds = Worlds()
    worlds.count[:] = 5
    _require_own_reset(worlds)
    assert worlds.log == [("restart", [2])]
    worlds.restart = lambda chosen: worlds.count.__setitem__([1, 2], 7)
    with pytest.raises(ValueError, match="reset: was given world 2 and changed count of world 1: must not"):
        _require_own_reset(worlds)


def test_a_restored_state_has_the_same_future():
    """The state is stored after one action, so that it differs from that of a reset."""
    worlds = Worlds()
    _require_restored(worlds, 4)
    assert worlds.log[-2:] == [("restored", [0, 1, 2]), ("restart", [1])]
    stored = []
    worlds.set_state = lambda state, chosen: stored.append(state["count"].tolist())
    with pytest.raises(ValueError, match="a restored state: reward differs after action 0"):
        _require_restored(worlds, 4)
    assert stored == [[1, 1, 1]]


def test_trials_are_compared_action_by_action():
    one = [{"a": np.zeros(2)}, {"a": np.ones(2)}]
    _require_equal("x", one, one, "must be y")
    with pytest.raises(ValueError, match="x: a differs after action 1: must be y"):
        _require_equal("x", one, [one[0], one[0]], "must be y")
    with pytest.raises(ValueError, match="zip"):
        _require_equal("x", one, one[:1], "must be y")


def test_all_comparisons_are_made(monkeypatch):
    """Four worlds and one world play twelve actions by default."""
    made, compared = [], []
    monkeypatch.setattr(batch_task_checker, "Simulation", lambda task, n, seed: made.append((n, seed)) or Closing(n))
    monkeypatch.setattr(batch_task_checker, "_played", lambda worlds, steps: [{"a": np.arange(worlds.n) + steps}])
    monkeypatch.setattr(
        batch_task_checker,
        "_require_equal",
        lambda what, one, other, right: compared.append((what, one[0]["a"].tolist(), other[0]["a"].tolist())),
    )
    monkeypatch.setattr(batch_task_checker, "_require_own_reset", lambda worlds: compared.append(("reset", worlds.n)))
    monkeypatch.setattr(batch_task_checker, "_require_restored", lambda *given: compared.append((given[0].n, given[1])))
    task = BatchTask.__new__(type("User", (BatchTask,), {}))
    batch_task_checker.check_batch_task(task)
    assert made == [(4, 0), (1, 0)]
    same = [12, 13, 14, 15]
    assert compared == [("the same seed", same, same), ("world 0", [12], [12]), ("reset", 4), (4, 12)]
    batch_task_checker.check_batch_task(task, 2, 3)
    assert made[2:] == [(2, 0), (1, 0)]


class Closing:
    def __init__(self, n):
        self.n = n

    def close(self):
        """Do nothing."""
