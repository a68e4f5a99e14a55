"""Normal distribution of a policy's actions.

If the mean of the distribution is outside the bounds of actions, gradients that would move it further out are set to 0.
"""

from __future__ import annotations

from typing import Any

import torch
from stable_baselines3.common.distributions import DiagGaussianDistribution
from torch import Tensor, nn


class Within(torch.autograd.Function):
    """Identity function on the means of actions. Gradients that would move a mean further out of [-1, 1] become 0.

    Actions beyond the bounds are clipped. If the mean is far outside, all actions are clipped to the same value.
    Exploration then has no effect, and no gradient would move the mean back. The remedy is "zeroing gradients"
    (Hausknecht and Stone 2016, section 5.2).
    """

    @staticmethod
    def forward(ctx: Any, mean: Tensor) -> Tensor:
        ctx.save_for_backward(mean)
        return mean.clone()

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> Tensor:
        (mean,) = ctx.saved_tensors
        # Gradient descent increases the mean if the gradient is negative.
        return gradient * torch.where(gradient < 0, mean < 1, mean > -1)


class Gaussian(DiagGaussianDistribution):
    """SB3's normal distribution of actions. Its tensor of log standard deviations is filled with the initial value.

    SB3 instead multiplies a tensor of ones by the initial value. In `load_policy`, on torch's "meta" device, this
    multiplication would import torch's compiler, which takes a second.
    """

    def proba_distribution_net(self, latent_dim: int, log_std_init: float = 0.0) -> tuple[nn.Module, nn.Parameter]:
        return nn.Linear(latent_dim, self.action_dim), nn.Parameter(torch.full((self.action_dim,), log_std_init))
