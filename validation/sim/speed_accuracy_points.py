"""Data of the chart of speed against accuracy: points, front and table."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

import sim
from validation.sim.scenes import SIGMA, rms

__all__ = ["EVERYWHERE", "ON_OBJECTS", "PROMISED", "Chart", "Errors", "Point", "Setting", "rows_of", "table"]

PROMISED = 0.5  # [σ] error bound of auto
EVERYWHERE, ON_OBJECTS = "over all receptors", "over receptors that see an object"
FLOOR = 0.03  # [σ], below which errors relative to the same light come from its reference


@dataclass(frozen=True)
class Setting:
    """A way to render.

    samples: rays or areas per receptor, or samples per cell of the reference renderer; None for the choice of auto.
    """

    back_end: str
    samples: float | None
    bands: int = 4
    light: str = "direct"
    layers: int = 1

    def __str__(self) -> str:
        return f"{self.back_end:<12}{self.samples or 0:>8g}{self.bands:>7}  {self.light:<8}{self.layers:>6}"


@dataclass(frozen=True)
class Errors:
    """Root mean square errors [σ] over all receptors and over receptors that see an object; None without objects."""

    everywhere: float
    on_objects: float | None = None

    @classmethod
    def between(cls, found: Sequence[np.ndarray], true: Sequence[np.ndarray], unit: float) -> Errors:
        """Return the errors of signals, given as one array for each population.

        unit: σ, in the unit of the signals.
        """
        return cls(*(rms(a - b) / unit for a, b in zip(found, true, strict=True)))

    @property
    def worst(self) -> float:
        """Larger of both errors, for which "auto" promises a bound."""
        return max(self.everywhere, self.on_objects or 0)

    def __str__(self) -> str:
        return f"{self.everywhere:.2f}" + ("" if self.on_objects is None else f" ({self.on_objects:.2f})")


@dataclass(frozen=True)
class Point:
    """A measured setting.

    error: error relative to path-traced light, in σ.
    sampling: error over all receptors relative to the same light with very many samples, in σ.
    speed: agent-steps per CPU second.
    fidelity: fidelity of the renderer, None for the reference renderer.
    warning: warning of auto's choice.
    """

    setting: Setting
    error: Errors
    sampling: float
    speed: float
    fidelity: sim.Fidelity | None = None
    warning: str = ""

    @property
    def light(self) -> str:
        return self.fidelity.light if self.fidelity else self.setting.light

    @property
    def kind(self) -> str:
        """Name of the method; for "auto", that of the chosen method."""
        f = self.fidelity
        return (
            self.setting.back_end
            if self.setting.samples or not f
            else {"rays": "closed_form"}.get(f.samples, f.samples)
        )

    def __str__(self) -> str:
        """Return the setting, with auto's choice filled in."""
        f = self.fidelity
        if f is None or self.setting.samples is not None:
            return str(self.setting)
        return f"{'auto ' + f.samples:<12}{f.rays_per_receptor:>8g}{f.bands:>7}  {f.light:<8}{f.depth.count:>6}"


@dataclass(frozen=True)
class Chart:
    """All points of a scene, with errors in σ.

    reference_error: standard error of the reference.
    left: remaining difference from the reference, by kind of light, with very many samples.
    """

    scene: str
    points: tuple[Point, ...]
    reference_error: Errors
    left: Mapping[str, Errors]

    @property
    def has_objects(self) -> bool:
        return self.auto.error.on_objects is not None

    def front_of(self, error: Callable[[Errors], float | None]) -> tuple[Point, ...]:
        """Return the Pareto front of speed and this error, fastest first."""
        ranked = sorted(self.points, key=lambda p: (-p.speed, error(p.error)))
        least, found = np.inf, []
        for point in ranked:
            mine = error(point.error)
            if mine is not None and mine < least:
                found.append(point)
                least = mine
        return tuple(found)

    @property
    def front(self) -> tuple[Point, ...]:
        """Pareto front for the larger of both populations' errors."""
        return self.front_of(lambda errors: errors.worst)

    @property
    def auto(self) -> Point:
        return next(p for p in self.points if p.setting.samples is None)

    @property
    def rival(self) -> Point:
        """Fastest point that is at least as accurate as "auto"."""
        return max((p for p in self.points if p.error.worst <= self.auto.error.worst), key=lambda p: p.speed)

    @property
    def missed(self) -> list[tuple[str, float]]:
        """Populations in which auto's error exceeds its bound plus the reference's noise, with the error."""
        found, own = self.auto.error, self.reference_error
        pairs = (EVERYWHERE, found.everywhere, own.everywhere), (ON_OBJECTS, found.on_objects or 0, own.on_objects or 0)
        return [(where, error) for where, error, noise in pairs if error > np.hypot(PROMISED, noise)]

    @property
    def not_falling(self) -> list[str]:
        """Samples and kinds of light whose errors do not decrease with the number of samples."""
        plain = [p for p in self.points if p.setting.samples and p.setting.back_end in ("closed_form", "areas")]
        plain = [p for p in plain if p.setting.bands == 4 and p.setting.layers == 1]
        series: dict[str, list[Point]] = {}
        for p in sorted(plain, key=lambda p: p.setting.samples or 0):
            series.setdefault(f"{p.setting.back_end} in {p.light}", []).append(p)
        return [
            name
            for name, points in series.items()
            if any(b.sampling > max(1.1 * a.sampling, FLOOR) for a, b in itertools.pairwise(points))
        ]


def table(charts: Sequence[Chart]) -> str:
    lines = ["in brackets: over receptors that see an object"]
    for chart in charts:
        front, auto, rival = chart.front, chart.auto, chart.rival
        ends = ", ".join(f"{light} light {error} σ" for light, error in chart.left.items())
        lines += ["", f"{chart.scene}; standard error of the reference {chart.reference_error} σ"]
        lines.append(f"converged light differs from the reference: {ends}")
        if auto.fidelity and auto.fidelity.predicted_error:
            predicted = auto.fidelity.predicted_error / SIGMA
            lines.append(f"auto predicts {predicted:.2f} σ; {auto.speed / rival.speed:.2f} of the front's speed")
        verdict = ", ".join(f"{error:.3f} σ {where}" for where, error in chart.missed)
        lines.append(f"auto: bound {PROMISED} σ {'exceeded: ' + verdict if verdict else 'satisfied'}")
        if auto.warning:
            lines.append(f"auto: warning: {auto.warning}")
        if not chart.has_objects:
            lines.append("no objects in this world")
        lines.append("how          samples  bands  light   layers   steps/s   error [σ]  on objects  vs same light")
        for p in sorted(chart.points, key=lambda p: -p.speed):
            speed = f"{p.speed:.3g}" if p.speed < 100 else f"{p.speed:.0f}"
            on_objects = "" if p.error.on_objects is None else f"{p.error.on_objects:.3f}"
            mark = "  front" if p in front else ""
            lines.append(f"{p}{speed:>12}{p.error.everywhere:>12.3f}{on_objects:>12}{p.sampling:>12.3f}{mark}")
    return "\n".join(lines)


def rows_of(charts: Sequence[Chart]) -> list[dict[str, Any]]:
    """Return one row per point, for the stored table."""
    rows = []
    for chart in charts:
        for p in chart.points:
            s, f, on_objects = p.setting, p.fidelity, p.error.on_objects
            row: dict[str, Any] = {"scene": chart.scene, "how": p.kind, "auto": s.samples is None}
            row |= {"samples": f.rays_per_receptor if f else s.samples, "bands": f.bands if f else s.bands}
            row |= {"light": p.light, "layers": f.depth.count if f else s.layers}
            row |= {"steps_per_cpu_second": f"{p.speed:.5g}", "error_sigma": f"{p.error.everywhere:.4g}"}
            row["error_on_objects_sigma"] = "" if on_objects is None else f"{on_objects:.4g}"
            rows.append(row | {"beside_its_light_sigma": f"{p.sampling:.4g}"})
    return rows
