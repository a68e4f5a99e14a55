"""Windows of memory against a plain loop."""

from types import SimpleNamespace

import pytest
import torch

from evolve.learning.eye_features import EyeFeatures


@pytest.mark.parametrize("memory", [1, 2, 4])
def test_windows_remember_no_frame_from_before_the_episode(memory):
    """Slot by slot: so many steps back, but never further than the episode's first frame, `age` steps back."""
    torch.manual_seed(0)
    segments, steps = 3, 6
    codes = torch.rand(2, 5, segments, memory - 1 + steps)
    age = torch.tensor([[0, 1, 2, 3, 4, 5], [9, 9, 9, 0, 1, 2], [2, 3, 0, 0, 1, 2]])
    windows = EyeFeatures._windows(SimpleNamespace(memory=memory), codes, age)
    assert windows.shape == (2, 5, memory, segments, steps)
    for slot in range(memory):
        for segment in range(segments):
            for step in range(steps):
                back = min(memory - 1 - slot, int(age[segment, step]))
                expected = codes[:, :, segment, memory - 1 + step - back]
                assert torch.equal(windows[:, :, slot, segment, step], expected)
