"""What a result promises: the plan, its predicted error, and the refusal where nothing can meet a tolerance."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["FLOAT_NOISE", "MOST_SAMPLES", "AccuracyError", "Option", "Plan"]


# Choice. Largest square array: 4096² complex64 is 134 MB, and a handful of such arrays live at once.
MOST_SAMPLES = 4096


FLOAT_NOISE = {"float32": 1e-6, "float64": 3e-13}  # of a method's sums, relative to the field's root mean square


STEEP = 1e-2  # choice: error of scalar theory from which on a plan names it, at NA 0.16


class AccuracyError(ValueError):
    """Asked for more than any method can give here; the message says what can be had.

    what: is wrong. remedy: what to ask for instead, where only who asked can.
    """

    def __init__(self, what: str, remedy: str | None = None):
        super().__init__(what if remedy is None else f"{what}: {remedy}")
        self.what, self.remedy = what, remedy


@dataclass(frozen=True)
class Option:
    """A method that was weighed: what it would take, how wrong it would be, and why it lost (or "chosen")."""

    method: str
    samples: tuple[int, int]
    predicted_error: float
    seconds: float
    verdict: str


@dataclass(frozen=True)
class Plan:
    """What was chosen, and why.

    samples: (y, x) samples of the pupil; for nodes (radial, angular) or (count, 1).
    padding: period of the pupil's transform over its samples, where there is one.
    predicted_error: relative L2 error of the intensity over the window.
    scalar_error: what scalar theory itself errs by, at most, where rays as steep as these meet, in light of any
        polarisation, which no method here makes less: see `optics.vector_focus`. It is meant for windows that hold the
        brightest place of the light. Where all is dark nothing is promised.
    seconds: predicted time of a warm call on two cores; 0 where nobody predicts it.
    options: every method that was weighed.
    """

    method: str
    samples: tuple[int, int]
    dtype: str
    predicted_error: float
    why: str
    seconds: float = 0.0
    options: tuple[Option, ...] = ()
    padding: float = 1.0
    scalar_error: float = 0.0

    def __str__(self) -> str:
        rows = {
            "method": self.method,
            "samples": _size(self.samples),
            "padding": f"{self.padding:.2f}",
            "dtype": self.dtype,
            "predicted error": f"{self.predicted_error:.1e}",
            **({"scalar theory": f"errs by up to {self.scalar_error:.2g}"} if self.scalar_error >= STEEP else {}),
            **({"predicted time": f"{self.seconds:.2g} s"} if self.seconds else {}),
            "why": self.why,
        }
        head = [f"{name:<17}{value}" for name, value in rows.items()]
        if not self.options:
            return "\n".join(head)
        others = [
            f"  {option.method:<24}{_size(option.samples):>13}{option.predicted_error:>10.1e}{option.seconds:>9.2g} s"
            f"  {option.verdict}"
            for option in self.options
        ]
        return "\n".join([*head, "weighed", *others])


def _size(samples: tuple[int, int]) -> str:
    return f"{samples[0]} x {samples[1]}" if samples[1] > 1 else str(samples[0])
