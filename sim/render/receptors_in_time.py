"""Filters between the renderer and the observation: the dynamics of receptors (`optics.ReceptorDynamics`).

The input of each filter is treated as constant within a frame. For such inputs, the filters are exact for any length of
the frames; only the latency is rounded to whole frames. The state of all filters of a world is one array, so that it
can be stored and restored.
"""

from __future__ import annotations

import math

import numpy as np

from optics import ReceptorDynamics

MOST_DELAYED = 1000  # chosen: largest number of frames of latency


class ReceptorsInTime:
    """Temporal filters of the receptors' signals in `n` worlds.

    dynamics: temporal properties of the receptors
    n: number of worlds
    shape: shape of one world's signals, (eye, channel, height, width)
    seconds: duration of a frame [s]
    state: attribute, the state of all filters, (world, filter, *shape) float32

    Raises:
        ValueError: the latency is longer than 1000 frames.
    """

    def __init__(self, dynamics: ReceptorDynamics, n: int, shape: tuple[int, ...], seconds: float) -> None:
        self.dynamics, self._ms = dynamics, 1e3 * seconds
        self._delay = round(dynamics.latency_ms / self._ms)
        if self._delay > MOST_DELAYED:
            raise ValueError(
                f"latency_ms = {dynamics.latency_ms:g}: must be at most {MOST_DELAYED} frames of {self._ms:g} ms"
            )
        low = dynamics.order
        self._low, self._delayed = slice(0, low), slice(low, low + self._delay)
        # The remaining rows are the adaptation's mean, or the events' reference and count, and then the mean of the
        # motion detectors.
        self._others = low + self._delay
        self._moved = self._others + (2 if dynamics.event_threshold else int(dynamics.adaptation != "none"))
        self.state = np.zeros((n, self._moved + int(dynamics.motion != "none"), *shape), np.float32)
        self._before = self.state.copy()

    @property
    def channels(self) -> int:
        """Number of output channels per channel of the signals: 2 with motion detectors."""
        return 1 if self.dynamics.motion == "none" else 2

    def start(self, signals: np.ndarray, worlds: np.ndarray) -> None:
        """Start these worlds in the steady state for constant signals (len(worlds), *shape)."""
        rows = np.repeat(signals[:, None], self.state.shape[1], axis=1)
        if self.dynamics.event_threshold:
            rows[:, self._others] = self._logarithm(signals)
            rows[:, self._others + 1] = 0
        if self.dynamics.motion != "none":
            rows[:, self._moved] = self._steady(signals)
        self.state[worlds] = rows

    def store(self, worlds: np.ndarray) -> None:
        """Store the state of the filters in these worlds, so that `undo` can restore it."""
        self._before[worlds] = self.state[worlds]

    def undo(self, worlds: np.ndarray) -> None:
        """Restore the state that `store` kept for these worlds, so that their last frame can be rendered again."""
        self.state[worlds] = self._before[worlds]

    def step(self, signals: np.ndarray, worlds: np.ndarray) -> np.ndarray:
        """Advance these worlds by a frame with these signals (len(worlds), *shape), and return their responses.

        The responses are (len(worlds), eye, channel, height, width). Motion detectors double the number of channels.
        """
        rows = self.state[worlds]
        found = self._filtered(rows, signals)
        if self.dynamics.event_threshold:
            self._count_events(rows, found)
            found = rows[:, self._others + 1].copy()
        elif self.dynamics.adaptation != "none":
            found = self._adapted(rows, found)
        if self.dynamics.motion != "none":
            past = rows[:, self._moved]
            past += np.float32(-math.expm1(-self._ms / self.dynamics.motion_ms)) * (found - past)
            found = np.concatenate([found, self._motion(found, past)], axis=2)
        self.state[worlds] = rows
        return found

    def reset_counts(self, worlds: np.ndarray) -> None:
        """Set the number of events of each receptor to 0 after an observation.

        An event is a change of a signal's logarithm by `event_threshold`. Without a threshold, nothing changes.
        """
        if self.dynamics.event_threshold:
            self.state[worlds, self._others + 1] = 0

    def _filtered(self, rows: np.ndarray, signals: np.ndarray) -> np.ndarray:
        """Return the signals after the low-pass filter and a delay by the latency, (world, *shape).

        rows: states of the filters in the worlds of the signals, (world, filter, *shape). They are replaced by the
            states one frame later
        """
        x = self._ms / self.dynamics.time_constant_ms
        low, decay = rows[:, self._low], np.float32(math.exp(-x))
        away = low - signals[:, None]
        if self.dynamics.order == 2:
            low[:, 1] = signals + decay * (away[:, 1] + np.float32(x) * away[:, 0])
        low[:, 0] = signals + decay * away[:, 0]
        found = low[:, -1]
        if not self._delay:
            return found.copy()
        delayed = rows[:, self._delayed]
        out: np.ndarray = delayed[:, 0].copy()
        delayed[:, :-1], delayed[:, -1] = delayed[:, 1:].copy(), found
        return out

    def _adapted(self, rows: np.ndarray, signals: np.ndarray) -> np.ndarray:
        """Return the signals (world, *shape) after gain control, and update the mean that determines the gain.

        rows: see `_filtered`
        """
        mean = rows[:, self._others]
        if self.dynamics.adaptation == "naka_rushton":
            light = np.maximum(signals, 0)
            found = light / (light + np.maximum(mean, 0) + np.float32(self.dynamics.dark_light))
        else:
            found = self._logarithm(signals) - self._logarithm(mean)
        mean += np.float32(-math.expm1(-self._ms / self.dynamics.adaptation_ms)) * (signals - mean)
        return np.asarray(found)

    def _count_events(self, rows: np.ndarray, signals: np.ndarray) -> None:
        threshold = np.float32(self.dynamics.event_threshold)
        reference = rows[:, self._others]
        events = np.trunc((self._logarithm(signals) - reference) / threshold)
        reference += events * threshold
        rows[:, self._others + 1] += events

    def _motion(self, signals: np.ndarray, past: np.ndarray) -> np.ndarray:
        """Return the output of the motion detectors between each receptor and its right neighbour.

        In the last column, the output is 0.

        signals, past: present signals (world, *shape), and the same signals after the detectors' low-pass filter
        """
        found = np.zeros_like(signals)
        a, b, past_a, past_b = signals[..., :-1], signals[..., 1:], past[..., :-1], past[..., 1:]
        if self.dynamics.motion == "hassenstein_reichardt":
            found[..., :-1] = past_a * b - a * past_b
        else:
            found[..., :-1] = np.maximum(a - past_b, 0) - np.maximum(b - past_a, 0)
        return found

    def _steady(self, signals: np.ndarray) -> np.ndarray:
        """Return the constant responses to constant signals, before any motion detectors, array (world, *shape)."""
        if self.dynamics.event_threshold or self.dynamics.adaptation == "logarithmic":
            return np.zeros_like(signals)
        if self.dynamics.adaptation == "none":
            return signals
        light = np.maximum(signals, 0)
        return np.asarray(light / (2 * light + np.float32(self.dynamics.dark_light)))

    def _logarithm(self, signals: np.ndarray) -> np.ndarray:
        return np.log(np.maximum(signals, 0) + np.float32(self.dynamics.dark_light))
