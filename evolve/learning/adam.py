"""The optimizer Adam on a single vector, in which all tensors of weights are joined.

A step needs a few operations on this vector, instead of a few operations on each tensor. torch.optim would need ten
times as many operations. Its first use also imports torch's compiler, which takes seconds in every worker process.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import torch
from torch import Tensor, nn

BETAS = (0.9, 0.999)  # decay per step of the running means of the gradient and of its square
EPSILON = 1e-5  # the value that stable-baselines3 uses in PPO


class Adam:
    """Adam (Kingma and Ba 2015, algorithm 1), with the interface that stable-baselines3 needs.

    All parameters become views of one vector, and all gradients views of another. Parameters and gradients must
    therefore be changed in place.

    parameters: parameters to optimise
    lr: step size
    """

    def __init__(self, parameters: Iterable[nn.Parameter], lr: float) -> None:
        self.parameters = list(parameters)
        self.param_groups: list[dict[str, Any]] = [{"lr": lr, "params": self.parameters}]
        # torch.cat is avoided, because it imports torch's compiler on the "meta" device of `load_policy`.
        self.values = self.parameters[0].new_empty(sum(p.numel() for p in self.parameters), requires_grad=False)
        self.gradient = torch.zeros_like(self.values)
        self.mean, self.square = torch.zeros_like(self.values), torch.zeros_like(self.values)
        self.steps = 0
        first = 0
        for parameter in self.parameters:
            piece = slice(first, first + parameter.numel())
            self.values[piece].copy_(parameter.detach().reshape(-1))
            parameter.data = self.values[piece].view_as(parameter)
            parameter.grad = self.gradient[piece].view_as(parameter)
            first = piece.stop

    def zero_grad(self) -> None:
        """Set all gradients to zero, before the next backward pass adds to them."""
        self.gradient.zero_()

    @torch.no_grad()
    def step(self) -> None:
        """Update all parameters with their gradients."""
        self.steps += 1
        decay_mean, decay_square = BETAS
        self.mean.lerp_(self.gradient, 1 - decay_mean)
        self.square.mul_(decay_square).addcmul_(self.gradient, self.gradient, value=1 - decay_square)
        unbias_mean, unbias_square = 1 - decay_mean**self.steps, 1 - decay_square**self.steps
        spread = (self.square / unbias_square).sqrt_().add_(EPSILON)
        self.values.addcdiv_(self.mean, spread, value=-self.param_groups[0]["lr"] / unbias_mean)

    def state_dict(self) -> dict[str, Tensor | int]:
        """Return the state that later steps need in addition to the parameters, by name.

        It consists of the running means of the gradient ("mean") and of its square ("square"), and the number of
        "steps".
        """
        return {"mean": self.mean, "square": self.square, "steps": self.steps}

    @torch.no_grad()
    def load_state_dict(self, state: Mapping[str, Tensor | int]) -> None:
        """Restore a state from `state_dict`."""
        for name in ("mean", "square"):
            getattr(self, name).copy_(state[name])
        self.steps = int(state["steps"])
