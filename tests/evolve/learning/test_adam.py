"""Adam against torch's own, and the imports that it avoids."""

import subprocess
import sys

import pytest
import torch

from evolve.learning.adam import EPSILON, Adam


def trained(optimizer_class, **options):
    torch.manual_seed(0)
    net = torch.nn.Sequential(torch.nn.Linear(5, 7), torch.nn.Tanh(), torch.nn.Linear(7, 2))
    inputs, targets = torch.randn(30, 5), torch.randn(30, 2)
    optimizer = optimizer_class(net.parameters(), lr=1e-2, **options)
    for step in range(60):
        optimizer.param_groups[0]["lr"] = 1e-2 / (1 + step)  # SB3's schedules set the rate in this way
        optimizer.zero_grad()
        (net(inputs) - targets).square().mean().backward()
        torch.nn.utils.clip_grad_norm_(net.parameters(), 0.5)
        optimizer.step()
    return torch.cat([p.detach().flatten() for p in net.parameters()])


def test_steps_are_those_of_torchs_adam():
    """Weights agree to float32 rounding over 60 steps. Another epsilon (torch's default of 1e-8) changes them by far
    more.
    """
    ours = trained(Adam)
    torch.testing.assert_close(ours, trained(torch.optim.Adam, eps=EPSILON), rtol=0, atol=2e-6)
    assert (ours - trained(torch.optim.Adam, eps=1e-2)).abs().max() > 1e-4


@pytest.mark.slow
def test_a_policy_is_built_and_read_without_torchs_compiler(tmp_path):
    """torch._dynamo takes seconds to import in every process."""
    file = tmp_path / "policy.safetensors"
    code = (
        "import sys; from evolve.learning.policy import PolicyConfig, build_policy, load_policy, save_policy\n"
        "policy = build_policy(PolicyConfig((1, 1, 1, 1, 1), 4)); policy.optimizer.zero_grad()\n"
        "sum(p.sum() for p in policy.parameters()).backward(); policy.optimizer.step()\n"
        f"save_policy(policy, {str(file)!r}); load_policy({str(file)!r})\n"
        "sys.exit('torch._dynamo' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
