"""Frames keep their own values in whatever order they are awaited, and return them once."""

import numpy as np
import pytest

from sim.render.pending_frame import FrameSlot, PendingFrame


class Device:
    """A device with one buffer, which a kernel reads as late as a device may: when its output is requested."""

    def __init__(self):
        self.slot, self.buffer = FrameSlot(), np.zeros(3)

    def begin(self, value):
        def launch():
            self.buffer[:] = value
            return self.buffer.copy

        return self.slot.launch(launch)


def test_a_frame_keeps_its_values_when_the_next_one_is_begun():
    device = Device()
    first, second = device.begin(1), device.begin(2)
    np.testing.assert_array_equal(second.wait(), np.full(3, 2))
    np.testing.assert_array_equal(first.wait(), np.ones(3))


def test_a_frame_that_nobody_waits_for_is_in_nobodys_way():
    device = Device()
    device.begin(1)
    np.testing.assert_array_equal(device.begin(2).wait(), np.full(3, 2))


def test_a_launch_that_fails_leaves_the_frame_before_it_alone():
    device = Device()
    first = device.begin(1)
    with pytest.raises(ValueError, match="wrong number"):
        device.slot.launch(_failing)
    np.testing.assert_array_equal(first.wait(), np.ones(3))
    np.testing.assert_array_equal(device.begin(3).wait(), np.full(3, 3))


def _failing():
    raise ValueError("wrong number of worlds")


def test_values_are_handed_over_once():
    """A second caller might otherwise get values that the first one has overwritten."""
    frame = PendingFrame(lambda: np.zeros(3))
    frame.wait()[:] = 1
    with pytest.raises(RuntimeError, match="was waited for before"):
        frame.wait()


def test_what_is_made_of_a_frame_is_made_when_it_is_waited_for():
    made = []
    frame = PendingFrame(lambda: np.ones(3)).then(lambda values: made.append("made") or 2 * values)
    assert not made
    np.testing.assert_array_equal(frame.wait(), np.full(3, 2))
    assert made == ["made"]
