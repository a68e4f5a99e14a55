"""Learning within a lifetime: PPO (stable-baselines3) on batched worlds, until it is solved, stuck or out of steps.

Its settings, with their ranges, are `evolve.config.settings.LearningConfig`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.buffers import RolloutBuffer
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger
from stable_baselines3.common.vec_env import VecEnv

from evolve.config.run_config import LearningConfig
from evolve.learning.adam import Adam
from evolve.learning.checkpoint import Checkpoint
from evolve.learning.policy import FIRST_SPREAD, Brain, EyePolicy, TrainingDiverged, learnt, set_learnt
from evolve.learning.rollout_buffer import FrameRolloutBuffer
from evolve.learning.schedule import first_step_size, schedule
from evolve.learning.training_rewards import RewardsInUnits, ramped_share
from sim.tasks.batch_task import BatchTask

UNIT_RATE = 0.2  # of the way to the spread of the last returns, per rollout
SPEED = "speed"  # the command that `learning.first_speed` is for
VERDICTS = {True: 1, False: -1, None: 0}
FLAT = 1e-6  # spread of returns that all are the same

Progress = Callable[[int, int], None]  # (steps trained, steps planned)


@dataclass(frozen=True)
class Training:
    """What became of a training.

    policy: as it was at the best evaluation
    steps: environment steps taken, in whole rollouts
    curve: (steps, mean return of the evaluation episodes), every `eval_interval` steps
    end: as it stands at its end, for a training that goes on from there
    """

    policy: EyePolicy
    steps: int
    curve: tuple[tuple[int, float], ...]
    end: Checkpoint


@dataclass(frozen=True)
class Episodes:
    """One whole episode of each world.

    returns (world,) · verdicts (world,): +1 solved, -1 not solved, 0 undecided, see `BatchTask.solved`
    """

    returns: np.ndarray
    verdicts: np.ndarray

    @property
    def successes(self) -> np.ndarray:
        """Worlds whose episode was solved, (world,) bool."""
        return self.verdicts > 0


class AdaptingPPO(PPO):
    """PPO whose policy adapts to the signals it meets, and which stops at the first rollout or update that is not
    finite, instead of learning nonsense from it.

    It sees rewards in units of the spread of its discounted returns, so that an agent's first minutes at a wall, a
    hundred times as bad as anything later, do not swamp the critic.
    """

    rollout_buffer: FrameRolloutBuffer
    policy: EyePolicy

    def __init__(self, worlds: VecEnv, brain: Brain, config: LearningConfig, seed: int) -> None:
        self.config, self.task = config, batch_task_of(worlds)
        torch.set_num_threads(1)
        seed = int(np.random.SeedSequence(seed).generate_state(1)[0])  # SB3 takes 32 bits
        super().__init__(
            EyePolicy,
            RewardsInUnits(worlds),
            n_steps=config.n_steps,
            batch_size=config.batch_size,
            n_epochs=config.n_epochs,
            learning_rate=first_step_size(config.learning_rate, brain.neurons),
            gamma=config.gamma,
            gae_lambda=config.gae_lambda,
            vf_coef=config.value_weight,
            seed=seed,
            device="cpu",
            policy_kwargs={**asdict(brain), "first_actions": first_actions(self.task, config)},
            rollout_buffer_class=FrameRolloutBuffer,
            rollout_buffer_kwargs={"seed": seed},
        )
        self.set_logger(Logger(None, []))

    def _update_learning_rate(self, optimizers: Adam) -> None:
        """And the passes of the update that follows. Not by the part of a plan that is done, as SB3 does: a training
        goes the same way whatever is planned."""
        self.n_epochs, share = schedule(self.config, self.num_timesteps)
        optimizers.param_groups[0]["lr"] = self.learning_rate * share

    def collect_rollouts(
        self, env: VecEnv, callback: BaseCallback, rollout_buffer: RolloutBuffer, n_rollout_steps: int
    ) -> bool:
        if self.num_timesteps == 0:
            self._adapt(self._last_obs["eyes"][:, -1], self._last_obs)
        share = ramped_share(self.num_timesteps, self.config.contact_ramp)
        self.env.shares = dict.fromkeys(self.task.ramped, share)
        return super().collect_rollouts(env, callback, rollout_buffer, n_rollout_steps)

    def train(self) -> None:
        for name in ("rewards", "values", "log_probs"):
            _require_finite(name, getattr(self.rollout_buffer, name), self.num_timesteps)
        super().train()
        # A loss that overflows leaves the weights alone (SB3 clips its gradient to zero), and nothing is learnt.
        _require_finite("loss", np.asarray(self.logger.name_to_value["train/value_loss"]), self.num_timesteps)
        for name, parameter in self.policy.named_parameters():
            _require_finite(f"policy's {name}", parameter.detach().numpy(), self.num_timesteps)
        # Not before: the update compares the policy with what it was when it acted. Neighbouring frames are alike.
        self._adapt(self.rollout_buffer.new_frames[:, ::8], self.rollout_buffer.beside)
        self._adapt_unit()

    def _adapt(self, frames: np.ndarray, beside: Mapping[str, np.ndarray]) -> None:
        features = self.policy.features_extractor
        felt = {name: torch.from_numpy(beside[name]) for name in features.normalised}
        features.adapt(torch.from_numpy(frames), felt)

    @torch.no_grad()
    def _adapt_unit(self) -> None:
        """Measure rewards in units of the spread of returns; what the critic says of the worlds stays the same
        (Pop-Art: van Hasselt et al. 2016, eq. 5). A rollout without any reward says nothing of their spread: its
        returns are what the critic says, discounted, and the unit would shrink without end."""
        if not self.env.paid:
            return
        self.env.paid = False
        change = max(float(self.rollout_buffer.returns.std()), FLAT)
        if self.env.unit != 1:  # not the first rollout that pays: forget gradually
            change **= UNIT_RATE
        self.env.unit *= change
        for parameter in self.policy.value_net.parameters():
            parameter.div_(change)

    def checkpoint(self, curve: list[tuple[int, float]], best: dict[str, torch.Tensor]) -> Checkpoint:
        """The training as it stands; curve and best are kept outside."""
        now = {name: tensor.detach().clone() for name, tensor in learnt(self.policy).items()}
        adam = self.policy.optimizer.state_dict()
        return Checkpoint(self.num_timesteps, tuple(curve), float(self.env.unit), now, best, adam)

    def restore(self, begun: Checkpoint) -> None:
        """Go on from there; worlds and chance are this learner's own."""
        self.num_timesteps = begun.steps
        self.env.unit = begun.unit
        set_learnt(self.policy, begun.now)
        self.policy.optimizer.load_state_dict(begun.adam)


def _require_finite(name: str, values: np.ndarray, steps: int) -> None:
    if not np.isfinite(values).all():
        raise TrainingDiverged(f"{name} not finite after {steps} steps")


class _Report(BaseCallback):
    """Tells how far the training is, after every rollout."""

    def __init__(self, progress: Progress, planned: int) -> None:
        super().__init__()
        self.progress, self.planned = progress, planned

    def _on_step(self) -> bool:
        return True

    def _on_rollout_end(self) -> None:
        self.progress(self.num_timesteps, self.planned)


@dataclass(frozen=True)
class Worlds:
    """Where a training learns, and where it is evaluated meanwhile."""

    training: VecEnv
    evaluation: VecEnv


def train(
    worlds: Worlds,
    brain: Brain,
    config: LearningConfig,
    seed: int,
    progress: Progress | None = None,
    begun: Checkpoint | None = None,
) -> Training:
    """Learn to act: same arguments, same policy, bit for bit (on one machine). A training `begun` goes on from there,
    its steps counted.

    After every `eval_interval` steps the policy plays one episode in each of the evaluation worlds; learning ends
    after `patience` such evaluations without a better mean return, or after `total_steps`. The policy returned
    is the one with the best mean return (the earliest of them).

    Raises:
        TrainingDiverged: rewards, loss, weights or actions stop being finite.
    """
    model = AdaptingPPO(worlds.training, brain, config, seed)
    report = _Report(progress, config.total_steps) if progress else None
    curve: list[tuple[int, float]] = []
    best: dict[str, torch.Tensor] = {}
    if begun is not None:
        curve, best = list(begun.curve), dict(begun.best)
        model.restore(begun)
    while model.num_timesteps < config.total_steps and not stuck(curve, config.patience):
        steps = min(config.eval_interval, config.total_steps - model.num_timesteps)
        model.learn(steps, callback=report, reset_num_timesteps=False)
        mean_return = float(play(model.policy, worlds.evaluation, seed).returns.mean())
        if not curve or mean_return > max(value for _, value in curve):
            best = {name: tensor.detach().clone() for name, tensor in learnt(model.policy).items()}
        curve.append((model.num_timesteps, mean_return))
    end = model.checkpoint(curve, best)
    set_learnt(model.policy, best)
    return Training(model.policy, model.num_timesteps, tuple(curve), end)


def stuck(curve: list[tuple[int, float]], patience: int) -> bool:
    """Whether the last `patience` evaluations all failed to better the best one before them."""
    returns = [value for _, value in curve]
    return len(returns) > patience and max(returns[-patience:]) <= max(returns[:-patience])


def play(policy: EyePolicy, worlds: VecEnv, seed: int) -> Episodes:
    """One episode in each world, from a reset with this seed, the policy acting without exploration."""
    worlds.seed(seed)
    observation = worlds.reset()
    returns = np.zeros(worlds.num_envs)
    playing = np.ones(worlds.num_envs, bool)
    task = batch_task_of(worlds)
    verdicts: list[bool | None] = [None] * worlds.num_envs
    while playing.any():
        action, _ = policy.predict(observation, deterministic=True)
        observation, reward, done, infos = worlds.step(action)
        returns[playing] += reward[playing]
        for world in np.flatnonzero(playing):
            verdicts[world] = task.solved(verdicts[world], infos[world])
        playing &= ~done
    if not math.isfinite(returns.sum()):
        raise TrainingDiverged("returns of the evaluation episodes not finite")
    return Episodes(returns, np.array([VERDICTS[verdict] for verdict in verdicts]))


def batch_task_of(worlds: VecEnv) -> BatchTask:
    """The task of these worlds."""
    task: BatchTask = worlds.get_attr("batch_task")[0]
    return task


def first_actions(task: BatchTask, config: LearningConfig) -> list[tuple[float, float]]:
    """Mean and standard deviation of each number of the untrained policy's actions: a speed's are those of
    `learning.first_speed`."""
    speed = (2 * config.first_speed - 1, config.first_speed)
    return [speed if command.name == SPEED else (0.0, FIRST_SPREAD) for command in task.commands()]
