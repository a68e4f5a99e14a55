"""Parts of batched environments: rows of agents, infos, states and arguments, with stand-ins for worlds and eyes."""

import warnings
from collections import Counter
from types import SimpleNamespace

import numpy as np
import pytest
from gymnasium import spaces

import sim
from sim.envs import animals
from sim.envs.animals import Advanced, Animals
from sim.envs.assembly import _check, _fidelity_of, _require_eyes, in_bands, refuse
from sim.envs.calls import CallOrder
from sim.envs.senses import Senses, _part
from sim.envs.vec_env import EyesVecEnv, _require_alike, _rows

EYES = sim.Eyes(n_eyes=1, resolution=(1, 3))


def test_observations_of_learners_are_rows_one_after_another():
    one, other = {"a": np.zeros((2, 3))}, {"a": np.ones((2, 3))}
    assert _rows([one]) is one
    np.testing.assert_array_equal(_rows([one, other])["a"], [[0] * 3] * 2 + [[1] * 3] * 2)


def test_learners_of_one_policy_are_alike():
    def learner(size, actions):
        space = spaces.Dict({"eyes": spaces.Box(0, 1, (size,))})
        return SimpleNamespace(observation_space=space, action_space=spaces.Box(0, 1, (actions,)))

    encounter = SimpleNamespace(names=["prey", "hunter"])
    _require_alike(encounter, [learner(3, 2), learner(3, 2)])
    for other in (learner(4, 2), learner(3, 1)):
        with pytest.raises(
            ValueError, match=r"Encounter: prey has .*, hunter has .*: must be alike to learn one policy"
        ):
            _require_alike(encounter, [learner(3, 2), other])


def environment(learners=2, worlds=3, varied=True, more=None):
    found = EyesVecEnv.__new__(EyesVecEnv)
    found._returns, found.num_envs = np.arange(learners * worlds, dtype=float), learners * worlds
    found._everyone, found._learners = np.arange(worlds), [None] * learners
    found.failures, found.task = Counter(), "task"
    task = SimpleNamespace(first_info=lambda physics, chosen: more and [{"extra": int(world)} for world in chosen])
    found.simulation = SimpleNamespace(
        varied=varied, variation_info=lambda world: {"light": int(world)}, steps=[7, 8, 9], task=task, physics="physics"
    )
    return found


def step(**changes):
    flags = {name: np.zeros(6, bool) for name in ("success", "done", "truncated", "given_up")}
    given = {"reward": np.full(6, 0.5), "terms": SimpleNamespace(rows=[{"t": k} for k in range(6)]), "info": None}
    return SimpleNamespace(**{**given, **flags, "failure": {}, **changes})


@pytest.mark.parametrize("varied", [False, True])
def test_infos_of_a_step(varied):
    """Rows 1 and 5 end: the second world of the first learner, and the third world of the second one."""
    done, truncated, given_up = (np.zeros(6, bool) for _ in range(3))
    done[[1, 5]], truncated[5], given_up[5] = True, True, True
    success = np.arange(6) == 1
    found = environment(varied=varied)
    infos = found._infos(step(done=done, truncated=truncated, given_up=given_up, success=success))
    for row, info in enumerate(infos):
        expected = {"reward_terms": {"t": row}, "is_success": row == 1}
        if varied:
            expected["light"] = row % 3
        if row in (1, 5):
            expected["TimeLimit.truncated"] = row == 5
            expected["episode"] = {"r": row + 0.5, "l": 8 if row == 1 else 9}
        if row == 5:
            expected["given_up"] = "least return"
        assert info == expected
    assert found._infos(step(info=[{"own": k} for k in range(6)]))[4]["own"] == 4


def test_failures_are_in_the_infos_of_all_agents_of_a_world_and_warn_once():
    found = environment()
    with pytest.warns(UserWarning, match="str: broken; its episode ends here"):
        infos = found._infos(step(failure={1: "broken"}))
    assert [info.get("failure") for info in infos] == [None, "broken", None, None, "broken", None]
    with warnings.catch_warnings(action="error"):
        found._infos(step(failure={0: "broken", 2: "broken"}))
    assert found.failures == {"broken": 3}


@pytest.mark.parametrize("more", [None, True])
def test_infos_before_the_first_action(more):
    infos = environment(more=more)._first_infos(np.array([2, 0]))
    extra = [{"extra": world} if more else {} for world in (2, 0, 2, 0)]
    expected = [
        {"reward_terms": {}, "is_success": False, "light": world, **own}
        for world, own in zip((2, 0, 2, 0), extra, strict=True)
    ]
    assert infos == expected


def test_new_episodes_replace_infos_and_returns():
    found = environment()
    found.animals = SimpleNamespace(start_episodes=lambda ended: ("pending", list(ended)))
    found.reset_infos = [None] * 6
    assert found._start_episodes(np.array([0, 2])) == ("pending", [0, 2])
    assert found._returns.tolist() == [0, 1, 0, 0, 4, 0]
    assert [info and info["light"] for info in found.reset_infos] == [0, None, 2, 0, None, 2]


def test_terminal_observations():
    found, infos = environment(), [{} for _ in range(6)]
    found._learners = [SimpleNamespace(preview=lambda seen, ended, k=k: {"eyes": seen[ended] + k}) for k in range(2)]
    seen, last = [np.arange(3) * 10, np.arange(3) * 100], [{"own": np.array([5, 6])}, {"own": np.array([7, 8])}]
    found._add_terminal_observations(infos, seen, np.array([0, 2]), last)
    expected = {0: (0, 5), 2: (20, 6), 3: (1, 7), 5: (201, 8)}
    for row, info in enumerate(infos):
        if row in expected:
            eyes, own = expected[row]
            assert info["terminal_observation"] == {"eyes": eyes, "own": own}
        else:
            assert info == {}


@pytest.mark.parametrize("learners", [1, 2])
def test_actions_are_divided_among_learners(learners):
    found, taken = environment(learners), []
    found._calls = SimpleNamespace(take=lambda: taken.append("taken"))
    found._commanded = np.arange(learners * 3.0)[:, None]
    found.animals = SimpleNamespace(advance=lambda actions: actions)
    actions = found._advance()
    assert taken == ["taken"]
    assert [action.ravel().tolist() for action in actions] == [[0, 1, 2], [3, 4, 5]][:learners]


def test_names_of_parts_of_states():
    assert _part(0, "left", "noise") == "noise"
    assert _part(1, "left", "noise") == "left.noise"
    found = Animals.__new__(Animals)
    found.seeing = [SimpleNamespace(agent=SimpleNamespace(name=name)) for name in ("prey", "hunter")]
    assert (found._key(0, "noise"), found._key(1, "noise")) == ("noise", "hunter.noise")


def test_auxiliary_entries_of_new_episodes_replace_only_theirs():
    found = Senses.__new__(Senses)
    frames = iter([{"depth": np.arange(first, first + 3)} for first in (1, 4, 7)])
    found._auxiliary = [SimpleNamespace(render=lambda poses, fresh: next(frames))]
    found._last_auxiliary = {}
    assert found.has_auxiliary
    found.update_auxiliary(None, np.array([0]))
    assert found._last_auxiliary["depth"].tolist() == [1, 2, 3]
    found.update_auxiliary(None, np.array([0, 2]))
    assert found._last_auxiliary["depth"].tolist() == [4, 2, 6]
    found.update_auxiliary(None, np.array([], int))
    assert found._last_auxiliary["depth"].tolist() == [7, 8, 9]
    assert not Senses.has_auxiliary.fget(SimpleNamespace(_auxiliary=[]))


class Agents(Animals):
    """Two learners and two animals with frozen policies, of which one has no eyes, with 1, 2, 3 and 4 actions."""

    def __init__(self, early):
        self.log = []
        agents = [SimpleNamespace(n_actions=k, first_action=k) for k in (1, 2, 3, 4)]
        self.simulation = SimpleNamespace(
            n=2,
            agents=agents,
            task=SimpleNamespace(renders_early=early),
            taken=np.tile(np.arange(10.0), (2, 1)),
            poses=lambda: "poses",
            move=lambda actions: self.log.append(actions) or "failed",
            judge=lambda failed: self.log.append(failed) or "step",
        )

        def senses(k):
            return SimpleNamespace(
                action=None,
                now=f"now {k}",
                agent=agents[k],
                has_auxiliary=k == 1,
                own=k,
                update_auxiliary=lambda poses, fresh: self.log.append((k, poses, len(fresh))),
                launch=lambda poses, worlds: self.log.append("launched") or f"frame {k}",
            )

        self.learners = [senses(0), senses(1)]
        frozen = SimpleNamespace(actions=lambda now, shape: np.full(shape, 9.0) if now == "now 3" else None)
        self._frozen = [(None, None), (frozen, senses(3))]
        self._of_agents = [*self.learners, *(own for _, own in self._frozen)]
        self.seeing = [*self.learners, self._frozen[1][1]]
        self._with_auxiliary = [self.learners[1]]


@pytest.mark.parametrize("early", [True, False])
def test_actions_of_all_animals(early):
    """Animals without eyes rest. Frames are launched before the step is judged, if the task permits it."""
    found = Agents(early)
    advanced = found.advance([np.ones((2, 1)), np.full((2, 2), 2.0)])
    np.testing.assert_array_equal(found.log[0], [[1, 2, 2, 0, 0, 0, 9, 9, 9, 9]] * 2)
    launched = ["launched"] * 3
    assert found.log[1:5] == ([*launched, "failed"] if early else ["failed", *launched])
    assert found.log[5:] == [(1, "poses", 0)]
    assert (advanced.step, advanced.pending) == ("step", ["frame 0", "frame 1", "frame 3"])
    assert [senses.action[0].tolist() for senses in found.seeing] == [[0], [1, 2], [6, 7, 8, 9]]


def test_worlds_that_a_task_changed_are_rendered_again():
    def frame(*values):
        return SimpleNamespace(wait=lambda: np.array(values))

    found, asked = Agents(True), []
    found.launch = lambda worlds: asked.append(worlds) or [{"eyes": frame(7, 8)}]
    for changed, expected in (([], [1, 2, 3]), ([0, 2], [7, 2, 8])):
        advanced = Advanced(SimpleNamespace(changed=np.array(changed, int)), [{"eyes": frame(1, 2, 3)}])
        (seen,) = found.seen(advanced)
        assert seen["eyes"].tolist() == expected
        assert len(asked) == bool(changed)


@pytest.mark.parametrize("worlds", [[0, 1], [1]])
def test_new_episodes_start_with_first_actions(worlds):
    found, launched = Agents(True), []
    found.simulation.restart = lambda chosen: found.log.append(list(chosen))
    for senses in found.seeing:
        senses.action = np.full((2, senses.agent.n_actions), -1.0)
        senses.launch = lambda poses, chosen, fresh: launched.append((poses, chosen, fresh)) or "frame"
    before = found.seeing[0].action
    assert found.start_episodes(np.array(worlds)) == ["frame"] * 3
    assert found.log[0] == worlds
    for senses in found.seeing:
        expected = [senses.agent.first_action if world in worlds else -1 for world in (0, 1)]
        assert senses.action[:, 0].tolist() == expected
    assert (before == -1).all(), "former actions stay as they were"
    assert [(poses, fresh) for poses, _, fresh in launched] == [("poses", True)] * 3
    assert all(chosen is None if len(worlds) == 2 else chosen.tolist() == [1] for _, chosen, _ in launched)


def test_frozen_policies_fit_their_observations():
    def policy(*shape):
        return SimpleNamespace(policy=SimpleNamespace(observation_space=spaces.Dict({"eyes": spaces.Box(0, 1, shape)})))

    here = SimpleNamespace(
        observation_space=spaces.Dict({"eyes": spaces.Box(0, 1, (3,))}), agent=SimpleNamespace(name="prey")
    )
    animals._require_fit(policy(3), here)
    animals._require_fit(SimpleNamespace(policy=object()), here)
    with pytest.raises(ValueError, match=r"policy of 'prey' takes .*\(4,\).*, its task gives .*\(3,\)"):
        animals._require_fit(policy(4), here)


@pytest.mark.parametrize(
    ("rays", "fidelity", "expected"),
    [
        ("auto", None, None),
        ("auto", "auto", None),
        (8, None, sim.Fidelity(8, EYES.bands)),
        (sim.Fidelity(2, 3), None, sim.Fidelity(2, 3)),
        ("auto", sim.Fidelity(2, 3), sim.Fidelity(2, 3)),
    ],
)
def test_fidelities_from_either_argument(rays, fidelity, expected):
    assert _fidelity_of(rays, fidelity, EYES) == expected
    assert _fidelity_of(rays, fidelity, {"a": EYES, "b": EYES}) == expected


def test_bad_fidelities():
    for fidelity in ("fine", 8):
        with pytest.raises(ValueError, match=r"fidelity = .*: must be a sim\.Fidelity, 'auto' or None"):
            _fidelity_of("auto", fidelity, EYES)
    for fidelity in ("auto", sim.Fidelity(2, 3)):
        with pytest.raises(ValueError, match="rays_per_receptor = 8: must be left out if a fidelity is given"):
            _fidelity_of(8, fidelity, EYES)


def test_arguments_of_all_environments():
    _check(1, None, 1, "training", None)
    _check(1_000_000, 0, 1_000_000, "test", "eyes")
    for name, place in (("n_envs", 0), ("memory", 2)):
        for value in (0, True, 1.0, 1_000_001):
            given = [1, 0, 1, "training", None]
            given[place] = value
            with pytest.raises(ValueError, match=rf"^{name} = {value}"):
                _check(*given)
    for eyes in ({}, {"a": EYES, "b": 1}, 1):
        with pytest.raises(ValueError, match=r"^eyes = .*: must be sim\.Eyes"):
            _require_eyes(eyes)
    _require_eyes({"a": EYES, "b": EYES})
    assert in_bands(EYES, 7).bands == 7
    assert {name: eyes.bands for name, eyes in in_bands({"a": EYES, "b": EYES}, 7).items()} == {"a": 7, "b": 7}
    refuse({"vary": None}, {"x": "because"})
    with pytest.raises(ValueError, match=r"^x = None: must be left out, because$"):
        refuse({"x": None}, {"x": "because"})


def test_closed_worlds_are_not_seeded():
    found = environment()
    found._calls = CallOrder()
    found._calls.close()
    with pytest.raises(RuntimeError, match="close"):
        found.seed_worlds([1, 2, 3])
