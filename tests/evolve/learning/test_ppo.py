"""The learner on a world that takes seconds: it learns, is exactly reproducible, stops in time, and names its
failures.
"""

import tempfile
from dataclasses import replace

import numpy as np
import pytest
import torch

from evolve.config.run_config import LearningConfig
from evolve.learning.played_episodes import play
from evolve.learning.policy import Brain, TrainingDiverged, learnt
from evolve.learning.ppo import AdaptingPPO, Worlds, stuck, train
from evolve.learning.training_rewards import ramped_share
from tests.evolve.learning.bright_spot import BrightSpot

QUICK = LearningConfig(total_steps=8192, n_envs=16, n_steps=32, batch_size=128, eval_interval=2048, patience=100)
SMALL = Brain(neurons=16)


def learn(config=QUICK, seed=0, worlds=None, progress=None, **eyes):
    both = Worlds(worlds or BrightSpot(config.n_envs, **eyes), BrightSpot(16, **eyes))
    return train(both, SMALL, config, seed, progress)


@pytest.mark.fast_cases(1)
@pytest.mark.parametrize("memory", [1, 4])
def test_learns_to_reach_what_it_sees(memory):
    """Share of episodes in which the spot is reached after 8000 steps, for three seeds: 1.0 with sight, 0.0 without."""
    training = learn(memory=memory)
    assert training.steps == QUICK.total_steps
    assert play(training.policy, BrightSpot(64, memory=memory), 99).successes.mean() > 0.9


@pytest.mark.slow
def test_the_blind_do_not():
    assert play(learn(blind=True).policy, BrightSpot(64, blind=True), 99).successes.mean() < 0.2


def test_same_seed_same_policy_bit_for_bit():
    def weights(seed):
        torch.rand(3), np.random.rand(3)  # noqa: NPY002 (whatever the process did before must not matter)
        config = LearningConfig(total_steps=1024, n_envs=16, n_steps=32, batch_size=128, eval_interval=512)
        training = learn(config, seed, memory=3)
        return torch.cat([tensor.flatten() for tensor in training.policy.state_dict().values()]), training.curve

    (a, curve_a), (b, curve_b), (c, _) = weights(2**40 + 1), weights(2**40 + 1), weights(1)
    assert torch.equal(a, b)
    assert curve_a == curve_b
    assert not torch.equal(a, c)


def test_progress_is_told_after_every_rollout():
    told = []
    learn(LearningConfig(total_steps=1024, n_envs=16, n_steps=32, batch_size=128), progress=lambda *p: told.append(p))
    assert told == [(512, 1024), (1024, 1024)]


def test_stops_when_evaluations_stop_improving():
    """The second evaluation is by far the best: training stops after `patience` more evaluations."""
    config = LearningConfig(total_steps=20_000, n_envs=16, n_steps=32, batch_size=128, eval_interval=512, patience=3)
    training = train(Worlds(BrightSpot(16), Favouring(kind_evaluation=2)), SMALL, config, 0)
    assert [steps for steps, _ in training.curve] == [512, 1024, 1536, 2048, 2560]


@pytest.mark.parametrize(
    ("returns", "expected"),
    [((), False), ((1, 1), False), ((1, 1, 1), True), ((1, 0, 2), False), ((3, 2, 2, 2.5), True), ((3, 2, 3.1), False)],
)
def test_stuck_means_patience_evaluations_without_a_new_best(returns, expected):
    assert stuck([(i, r) for i, r in enumerate(returns)], patience=2) is expected


class Poisoned(BrightSpot):
    def step_wait(self):
        observation, reward, done, infos = super().step_wait()
        return observation, reward * np.nan, done, infos


def test_rewards_that_are_no_numbers_end_the_training():
    with pytest.raises(TrainingDiverged, match="rewards not finite after 512 steps"):
        learn(worlds=Poisoned(16))


def test_a_loss_that_overflows_ends_the_training():
    """The critic's squared error is infinite. Gradient clipping would turn this into a training run without effect."""
    model = AdaptingPPO(BrightSpot(16), SMALL, QUICK, 0)
    model.learn(512)
    model.rollout_buffer.returns[:] = 1e30
    with pytest.raises(TrainingDiverged, match="loss not finite after 512 steps"):
        model.train()


@pytest.mark.parametrize("reward", [1e30, -1e30, 1e38, -1e38])
@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_huge_rewards_end_the_training_without_warnings(reward):
    class Huge(BrightSpot):
        def step_wait(self):
            observation, earned, done, infos = super().step_wait()
            return observation, np.float32(reward) + earned, done, infos

    with pytest.raises(TrainingDiverged, match="not finite"):
        learn(worlds=Huge(16))


class Dear(BrightSpot):
    def step_wait(self):
        observation, reward, done, infos = super().step_wait()
        return observation, 1000 * reward, done, infos


@pytest.mark.slow
def test_the_unit_of_rewards_does_not_matter():
    training = learn(worlds=Dear(16))
    assert play(training.policy, BrightSpot(64), 99).successes.mean() > 0.9


class Poor(BrightSpot):
    """A world without rewards before its `first` step."""

    first, taken = np.inf, 0

    def step_wait(self):
        observation, reward, done, infos = super().step_wait()
        self.taken += self.num_envs
        return observation, reward * (self.taken > self.first), done, infos


def test_the_unit_stays_where_nothing_is_paid_and_is_that_of_the_first_rewards():
    """Without rewards, returns are the critic's discounted predictions. A unit that followed them would halve with each
    rollout.
    """
    model = AdaptingPPO(Poor(16), SMALL, QUICK, 0)
    model.learn(6 * 512)
    assert model.env.unit == 1
    late = Poor(16)
    late.first = 3 * 512
    model = AdaptingPPO(late, SMALL, QUICK, 0)
    model.learn(3 * 512)
    assert model.env.unit == 1
    model.learn(512, reset_num_timesteps=False)
    spread = model.env.unit
    assert spread == pytest.approx(float(model.rollout_buffer.returns.std()), rel=1e-6)
    model.learn(512, reset_num_timesteps=False)
    assert model.env.unit == pytest.approx(spread * float(model.rollout_buffer.returns.std()) ** 0.2, rel=1e-6)


@pytest.mark.parametrize(
    ("steps", "ramp", "share"),
    [(0, 0, 1.0), (0, 900, 0.1), (300, 900, 0.1), (600, 900, 0.1**0.5), (900, 900, 1.0), (5000, 900, 1.0)],
)
def test_contact_costs_a_tenth_at_first_and_its_whole_price_at_the_end_of_the_ramp(steps, ramp, share):
    assert ramped_share(steps, ramp) == pytest.approx(share)


PACED = LearningConfig(n_epochs=10, least_epochs=6, decay_after=640)


class Touching(BrightSpot):
    """A world in which every action touches a wall, and has no other cost."""

    def step_wait(self):
        observation, reward, done, infos = super().step_wait()
        for info in infos:
            info["reward_terms"]["contact"] = -1.0
        return observation, np.full_like(reward, -1), done, infos


@pytest.mark.parametrize(("ramp", "cost"), [(0, 1.0), (10_000, 0.1)])
def test_learners_pay_their_share_of_contact(ramp, cost):
    model = AdaptingPPO(Touching(16), SMALL, replace(QUICK, contact_ramp=ramp), 0)
    model.learn(512)
    # The critic's estimate of later rewards is added to the last reward of truncated episodes.
    assert np.median(-model.rollout_buffer.rewards) == pytest.approx(cost, rel=1e-6)


@pytest.mark.fast_cases(1)
@pytest.mark.parametrize("pieces", [(2560,), (512, 2048), (512,) * 5])
def test_learning_slows_down_with_steps_in_whatever_pieces(pieces):
    """The rate of learning is constant for 640 steps. Then passes times step size falls inversely with the steps: when
    the step size has halved, the number of passes falls, to six at the lowest.
    """
    config = replace(PACED, n_envs=16, n_steps=32, batch_size=128, learning_rate=4e-3)
    model = AdaptingPPO(BrightSpot(16), SMALL, config, 0)
    update, rates, batches = model.train, [], [0]

    def noted():
        update()
        rates.append(model.policy.optimizer.param_groups[0]["lr"])
        batches.append(model.policy.optimizer.steps)

    model.train = noted
    for steps in pieces:
        model.learn(steps, reset_num_timesteps=False)
    passes = np.diff(batches) // (512 // 128)
    assert passes.tolist() == [10, 10, 9, 7, 6]
    assert passes * rates == pytest.approx(10 * 4e-3 * np.array([1, 5 / 8, 5 / 12, 5 / 16, 1 / 4]))
    assert max(rates) <= 4e-3


@pytest.mark.fast_cases(2)
@pytest.mark.parametrize(("neurons", "rate"), [(16, 4e-3), (64, 4e-3), (144, 4e-3 * 2 / 3), (256, 2e-3)])
def test_large_brains_take_smaller_steps(neurons, rate):
    config = LearningConfig(n_envs=16, n_steps=32, batch_size=128, learning_rate=4e-3)
    model = AdaptingPPO(BrightSpot(16), Brain(neurons), config, 0)
    model.learn(512)
    assert model.policy.optimizer.param_groups[0]["lr"] == pytest.approx(rate)


class Favouring(BrightSpot):
    """Evaluation worlds with a higher reward in a single evaluation."""

    def __init__(self, kind_evaluation):
        super().__init__(16)
        self.evaluations, self.kind_evaluation = 0, kind_evaluation

    def reset(self):
        self.evaluations += 1
        return super().reset()

    def step_wait(self):
        observation, reward, done, infos = super().step_wait()
        return observation, reward + 100 * (self.evaluations == self.kind_evaluation), done, infos


def test_the_best_policy_is_returned_not_the_last():
    """The policy equals, bit for bit, that of a training run that ends with this evaluation, including adaptation."""

    def policy(evaluations, kind_evaluation):
        config = LearningConfig(
            total_steps=512 * evaluations, n_envs=16, n_steps=32, batch_size=128, eval_interval=512, patience=100
        )
        training = train(Worlds(BrightSpot(16), Favouring(kind_evaluation)), SMALL, config, 0)
        assert training.steps == 512 * evaluations
        return torch.cat([tensor.flatten() for tensor in learnt(training.policy).values()])

    second = policy(4, kind_evaluation=2)
    assert torch.equal(second, policy(2, kind_evaluation=2))
    assert not torch.equal(second, policy(4, kind_evaluation=4))


class Blinding(BrightSpot):
    def step_wait(self):
        observation, reward, done, infos = super().step_wait()
        return {**observation, "eyes": observation["eyes"] * np.nan}, reward, done, infos


def test_signals_that_are_no_numbers_end_the_training():
    with pytest.raises(TrainingDiverged, match="not finite"):
        learn(worlds=Blinding(16))


def test_a_training_leaves_nothing_behind_in_the_temporary_folder(tmp_path, monkeypatch):
    """SB3's own logger creates a folder for each training run, which would be thousands in a long run."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    learn(LearningConfig(total_steps=512, n_envs=16, n_steps=32, batch_size=128))
    assert list(tmp_path.iterdir()) == []


def test_of_a_goal_and_an_adversary_in_one_action_the_first_counts():
    """The adversary is first in odd worlds. Objects that are reached later, here the other one, have no effect."""

    class Both(BrightSpot):
        steps = 0

        def step_wait(self):
            observation, reward, done, infos = super().step_wait()
            for world, info in enumerate(infos):
                goal = self.steps == 0 or world % 2
                info["reward_terms"] |= {"goal": 10.0 * goal, "adversary": -10.0 * (self.steps == 0 or not goal)}
                info |= {"adversary_first": True} if self.steps == 0 and world % 2 else {}
            self.steps += 1
            return observation, reward, done, infos

    worlds = Both(4)
    policy = AdaptingPPO(worlds, SMALL, QUICK, 0).policy
    found = play(policy, worlds, 0)
    assert found.verdicts.tolist() == [1, -1, 1, -1]
    assert found.successes.tolist() == [True, False, True, False]
