"""Temporal properties of photoreceptors: integration, latency, adaptation, events at changes of light, and motion."""

from __future__ import annotations

from dataclasses import dataclass

from optics.numerics.arguments import in_range, one_of, whole

__all__ = ["ADAPTATIONS", "LEAST_EVENT", "MOTION", "ReceptorDynamics"]

ADAPTATIONS = ("none", "naka_rushton", "logarithmic")
MOTION = ("none", "hassenstein_reichardt", "barlow_levick")
LEAST_EVENT = 1e-3  # smallest step of the logarithm that counts as an event


@dataclass(frozen=True)
class ReceptorDynamics:
    """Temporal properties of all receptors of an eye, in the order in which a signal s(t) passes them.

    time_constant_ms: time constant τ of the low-pass filter [ms]
    order: order n of the filter, 1 or 2: h(t) = tⁿ⁻¹ exp(-t/τ) / τⁿ
    latency_ms: additional delay [ms], rounded to whole frames
    adaptation: gain control. In the formulas, m is the exponentially weighted mean of the signal s over the time
        `adaptation_ms`, and d is `dark_light`. "none": no gain control; "naka_rushton": s / (s + m + d), about 1/2 in
        constant bright light (Naka & Rushton 1966, J. Physiol. 185:536); "logarithmic": ln((s + d) / (m + d)), which is
        0 in constant light
    adaptation_ms: time constant of the mean m [ms]
    dark_light: signal that is equivalent to the receptor's spontaneous activity, relative to the signal of white in
        daylight
    event_threshold: θ, at least 1e-3. A receptor then signals the number of positive events minus that of negative
        events since the last observation. A positive (negative) event occurs whenever ln(s + dark_light) has increased
        (decreased) by θ since the last event (Lichtsteiner et al. 2008, IEEE J. Solid-State Circuits 43:566). None: no
        events
    motion: elementary motion detectors between neighbours in a row. Their outputs are channels that follow those of the
        receptors. The inputs are a, the signal of the left receptor, and b, the signal of the right one. D is a
        low-pass filter, which delays a signal. "hassenstein_reichardt" (1956): D(a) b - a D(b). "barlow_levick" (1965):
        max(a - D(b), 0) - max(b - D(a), 0). In each term, the delayed signal of one neighbour inhibits the other. An
        object that moves in the other direction reaches this neighbour first, so the term is suppressed. "none": no
        detectors. Motion to the right gives positive output
    motion_ms: time constant of D [ms]
    frames: number of frames per action that environments render, a divisor of the number of physics steps per action.
        None: the smallest number for which the error of the signals is acceptable, see the tolerance of `sim.Fidelity`

    Raises:
        ValueError: an argument is outside its range, or events are combined with adaptation.
    """

    time_constant_ms: float = 10.0
    order: int = 1
    latency_ms: float = 0.0
    adaptation: str = "none"
    adaptation_ms: float = 1000.0
    dark_light: float = 1e-3
    event_threshold: float | None = None
    motion: str = "none"
    motion_ms: float = 35.0
    frames: int | None = None

    def __post_init__(self) -> None:
        for name, low, high in (
            ("time_constant_ms", 1e-3, 1e5),
            ("latency_ms", 0.0, 1e4),
            ("adaptation_ms", 1e-3, 1e7),
            ("dark_light", 1e-9, 1.0),
            ("motion_ms", 1e-3, 1e5),
        ):
            in_range(f"ReceptorDynamics: {name}", getattr(self, name), low, high)
        whole("ReceptorDynamics: order", self.order, 1, 2)
        one_of("ReceptorDynamics: adaptation", self.adaptation, ADAPTATIONS)
        one_of("ReceptorDynamics: motion", self.motion, MOTION)
        if self.frames is not None:
            whole("ReceptorDynamics: frames", self.frames, 1, 10**6)
        if self.event_threshold is not None:
            in_range("ReceptorDynamics: event_threshold", self.event_threshold, LEAST_EVENT, 1e2)
            if self.adaptation != "none":
                raise ValueError("ReceptorDynamics: event_threshold: must be None with adaptation; events adapt, too")

    @property
    def integration_ms(self) -> float:
        """Duration [ms] of a rectangular window with the same shot noise as the filter h(t), 1 / ∫h² dt.

        It is 2 time constants for a filter of order 1, and 4 for order 2.
        """
        return self.time_constant_ms * (2 if self.order == 1 else 4)
