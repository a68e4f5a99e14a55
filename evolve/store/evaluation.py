"""What became of one candidate."""

from __future__ import annotations

import math
from dataclasses import dataclass

__all__ = ["Evaluation"]


@dataclass(frozen=True)
class Evaluation:
    """Outcome of one candidate's learning and evaluation episodes.

    fitness: mean of `returns`; -inf where the evaluation failed
    steps: agent steps trained
    seconds: wall time
    curve: (training steps, mean evaluation return), ...
    failure: one line that says what went wrong; None if nothing did
    """

    fitness: float
    returns: tuple[float, ...] = ()
    success_rate: float = 0.0
    steps: int = 0
    seconds: float = 0.0
    curve: tuple[tuple[int, float], ...] = ()
    failure: str | None = None

    @classmethod
    def failed(cls, failure: str, seconds: float = 0.0) -> Evaluation:
        """The evaluation of a candidate that has none, in one line."""
        told = failure.encode(errors="backslashreplace").decode()  # a file's name in it may be no text at all
        return cls(fitness=-math.inf, seconds=seconds, failure=" ".join(told.split()))
