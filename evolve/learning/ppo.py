"""PPO of stable-baselines3 (SB3) in many worlds at once. Training ends early if returns no longer improve.

`evolve.config.settings.LearningConfig` defines the settings and their ranges.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

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
from evolve.learning.checkpoint_file import CheckpointError
from evolve.learning.played_episodes import batch_task_of, play
from evolve.learning.policy import (
    FIRST_SPREAD,
    Brain,
    EyePolicy,
    TrainingDiverged,
    learnt,
    require_same_shapes,
    set_learnt,
)
from evolve.learning.rollout_buffer import FrameRolloutBuffer
from evolve.learning.schedule import first_step_size, schedule
from evolve.learning.training_rewards import RewardsInUnits, ramped_share
from sim.tasks.batch_task import BatchTask

# In each rollout, log(unit of rewards) moves by this fraction of its distance to log(spread of returns).
UNIT_RATE = 0.2
SPEED = "speed"  # name of the command whose initial values follow from `learning.first_speed`
FLAT = 1e-6  # lower limit of the returns' spread, so that it is never 0

Progress = Callable[[int, int], None]  # (steps trained, steps planned)


@dataclass(frozen=True)
class Training:
    """Result of a training run.

    policy: policy at the best evaluation
    steps: number of agent steps; training stops only after a whole rollout
    curve: (steps, mean return) of each evaluation during training
    end: state at the end of training, from which it can continue
    """

    policy: EyePolicy
    steps: int
    curve: tuple[tuple[int, float], ...]
    end: Checkpoint


class AdaptingPPO(PPO):
    """PPO with normalised signals and rewards.

    Training ends with an error if rewards, the loss or weights are not finite.

    Rewards are divided by a number that follows the spread of the discounted returns. At the start of training,
    agents often touch walls, and the costs of contact are about a hundred times larger than all later rewards. Without
    normalisation, these costs would dominate the critic.
    """

    rollout_buffer: FrameRolloutBuffer
    policy: EyePolicy

    def __init__(self, worlds: VecEnv, brain: Brain, config: LearningConfig, seed: int) -> None:
        self.config, self.task = config, batch_task_of(worlds)
        torch.set_num_threads(1)
        seed = int(np.random.SeedSequence(seed).generate_state(1)[0])  # SB3 requires seeds of 32 bits
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
            policy_kwargs={"brain": brain, "first_actions": first_actions(self.task, config)},
            rollout_buffer_class=FrameRolloutBuffer,
            rollout_buffer_kwargs={"seed": seed},
        )
        self.set_logger(Logger(None, []))

    def _update_learning_rate(self, optimizers: Adam) -> None:
        """Set the step size and the number of passes of the next update.

        In SB3, the step size may depend on the completed fraction of the planned steps, and the number of passes is
        constant. Here both depend on the number of steps so far, so that the course of training is independent of its
        planned length.
        """
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
        with np.errstate(over="ignore", invalid="ignore"):  # the next lines report overflow as an error
            super().train()
        # If the loss overflows, SB3 clips the gradient to zero. The weights then remain finite, but nothing is learnt.
        _require_finite("loss", np.asarray(self.logger.name_to_value["train/value_loss"]), self.num_timesteps)
        for name, parameter in self.policy.named_parameters():
            _require_finite(f"policy's {name}", parameter.detach().numpy(), self.num_timesteps)
        # The update above needed the normalisation of the rollout. Successive frames are similar: an eighth is enough.
        self._adapt(self.rollout_buffer.new_frames[:, ::8], self.rollout_buffer.beside)
        self._adapt_unit()

    def _adapt(self, frames: np.ndarray, beside: Mapping[str, np.ndarray]) -> None:
        features = self.policy.features_extractor
        felt = {name: torch.from_numpy(beside[name]) for name in features.normalised}
        features.adapt(torch.from_numpy(frames), felt)

    @torch.no_grad()
    def _adapt_unit(self) -> None:
        """Adapt the unit of rewards to the spread of returns (Pop-Art: van Hasselt et al. 2016, eq. 5).

        The critic is rescaled, so that its predictions remain the same in the rewards' original units. A rollout
        without rewards does not change the unit. Its returns consist of the critic's own discounted predictions, so the
        unit would otherwise shrink without limit.
        """
        if not self.env.paid:
            return
        self.env.paid = False
        change = max(float(self.rollout_buffer.returns.std()), FLAT)
        if self.env.unit != 1:  # after the first rollout with rewards, the unit changes gradually
            change **= UNIT_RATE
        self.env.unit *= change
        for parameter in self.policy.value_net.parameters():
            parameter.div_(change)

    def checkpoint(self, curve: list[tuple[int, float]], best: dict[str, torch.Tensor]) -> Checkpoint:
        """Return the state of training, with the learning curve so far and the tensors at the best evaluation."""
        now = {name: tensor.detach().clone() for name, tensor in learnt(self.policy).items()}
        adam = self.policy.optimizer.state_dict()
        return Checkpoint(self.num_timesteps, tuple(curve), float(self.env.unit), now, best, adam)

    def restore(self, begun: Checkpoint) -> None:
        """Restore the state in a checkpoint. Training continues with new worlds and new random numbers.

        Raises:
            CheckpointError: the checkpoint does not have the tensors of this learner.
        """
        moments = {name: value for name, value in self.policy.optimizer.state_dict().items() if name != "steps"}
        try:
            require_same_shapes(learnt(self.policy), begun.now)
            require_same_shapes(learnt(self.policy), begun.best)
            require_same_shapes(moments, {name: value for name, value in begun.adam.items() if name != "steps"})
        except ValueError as error:
            raise CheckpointError(f"its tensors are not those of this network ({error})") from error
        self.num_timesteps = begun.steps
        self.env.unit = begun.unit
        set_learnt(self.policy, begun.now)
        self.policy.optimizer.load_state_dict(begun.adam)


def _require_finite(name: str, values: np.ndarray, steps: int) -> None:
    if not np.isfinite(values).all():
        raise TrainingDiverged(f"{name} not finite after {steps} steps")


class _Report(BaseCallback):
    """Callback that reports the number of steps after every rollout."""

    def __init__(self, progress: Progress, planned: int) -> None:
        super().__init__()
        self.progress, self.planned = progress, planned

    def _on_step(self) -> bool:
        return True

    def _on_rollout_end(self) -> None:
        self.progress(self.num_timesteps, self.planned)


@dataclass(frozen=True)
class Worlds:
    """Environments for training, and for the evaluations during training."""

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
    """Train a policy. On one machine, the same arguments give the same policy, bit for bit.

    After every `eval_interval` steps (rounded up to whole rollouts) and at the end, the policy plays one episode in
    each of the evaluation worlds. Training ends after `patience` evaluations without a better mean return, or after
    `total_steps`. The result is the policy at the evaluation with the highest mean return, or at the first of several
    such evaluations.

    seed: seed of initial weights, exploration and mini-batches, and of the evaluation worlds
    progress: function that is called with (steps trained, steps planned) after every rollout; None: training is not
        reported
    begun: checkpoint from which to continue; its steps count towards `total_steps`

    Raises:
        TrainingDiverged: rewards, loss, weights, actions or returns are not finite.
        CheckpointError: `begun` does not have the tensors of this learner.
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
    """Return whether the mean return has not improved in the last `patience` evaluations.

    It has not improved if none of these evaluations has a higher mean return than the best of the earlier evaluations.
    Without earlier evaluations, the result is False.

    curve: (training steps, mean return) of each evaluation so far
    """
    returns = [value for _, value in curve]
    return len(returns) > patience and max(returns[-patience:]) <= max(returns[:-patience])


def first_actions(task: BatchTask, config: LearningConfig) -> list[tuple[float, float]]:
    """Return (mean, standard deviation) of each element of the actions that an untrained policy draws.

    For the element "speed", the setting `learning.first_speed` determines both numbers. For the others, they are 0 and
    0.5.
    """
    speed = (2 * config.first_speed - 1, config.first_speed)
    return [speed if command.name == SPEED else (0.0, FIRST_SPREAD) for command in task.commands()]
