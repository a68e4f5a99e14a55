"""D1: speed against accuracy of what agents see

Every way to render a world for its agents' eyes, by its error and its speed. The error is the root mean square, over
receptors, channels, eyes and states that agents got into, of the difference to a reference: Mitsuba's path tracer in 8
bands, then the convolution `Eye.see`; it is in units of the photoreceptors' noise, σ = 0.01. Errors below σ/2 change
nothing that a brain can tell. Speed is agent-steps (all eyes of one agent, once) per second of one core's CPU time, the
best of several interleaved rounds, behind the pupil, without physics.

The eyes are those of the published experiments, behind lenses in focus. Levels: back end (closed form, Mitsuba's ray
tracing in the batched renderer, the reference renderer with few samples), rays per receptor, bands, light (direct,
path), depth layers. All of it is float32: the batched renderer has no other dtype. "auto" is what
`BatchedRenderer(...)` picks by itself; it is bound to be on the Pareto front, or within 20 % of the speed that the
front has at its error, and to keep what it promises, σ/2 beside direct light that is rendered to the end. What direct
light leaves out, light that was reflected more than once, is told apart in the table: no number of rays brings it back.

    python -m validation.D1_speed_accuracy [--out DIR] [--docs DIR]
"""

from __future__ import annotations

import itertools
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import optics
import sim
from sim.depth import DepthLayers
from sim.simulation import Simulation
from sim.state import WorldState
from validation.page import Page, parser

SIGMA = 0.01
BANDS = 8  # of the references
SPP = 64
FEW, MANY = 8, 64  # worlds rendered at once: few where rays are many
SLACK = 0.8  # of the front's speed
ROUND = 0.05  # [s] of CPU time


@dataclass(frozen=True)
class Scene:
    """A task's world, its eyes, and how wide their pupil is beside the retina."""

    task: str
    seed: int
    eyes: sim.Eyes
    aperture: float

    @property
    def name(self) -> str:
        height, width = self.eyes.resolution
        return f"{self.task}, {self.eyes.n_eyes} x ({height} x {width}), a = {self.aperture:g}"

    def behind_lens(self, bands: int) -> sim.Eyes:
        pupil = optics.Pupil(
            self.aperture * self.eyes.sensor_width / 2, thin_lens_focal_length=self.eyes.eye().sensor_distance
        )
        return replace(self.eyes, optics=pupil, bands=bands, noise_sigma=SIGMA)


TWO_EYES = sim.Eyes(n_eyes=2, resolution=(15, 15), fov_deg=45, placement_range_deg=60)
TEN_EYES = sim.Eyes(n_eyes=10, resolution=(1, 4), fov_deg=30, placement_range_deg=150)
SCENES = (
    Scene("detection", 0, TWO_EYES, 0.25),
    Scene("navigation", 7, TEN_EYES, 0.25),
    Scene("tracking", 0, TWO_EYES, 0.5),
)


@dataclass(frozen=True)
class Setting:
    """One way to render. rays: per receptor, or samples per cell of the reference renderer; None: auto."""

    back_end: str
    rays: float | None
    bands: int = 4
    light: str = "direct"
    layers: int = 1

    def __str__(self) -> str:
        rays = "auto" if self.rays is None else f"{self.rays:g}"
        return f"{self.back_end:<12}{rays:>6}{self.bands:>7}  {self.light:<8}{self.layers:>6}"


RAYS = tuple(Setting("closed_form", rays) for rays in (0.25, 1, 4, 16, 64, 256))
SETTINGS = (
    Setting("closed_form", None),
    *RAYS,
    *(Setting("closed_form", 4, bands) for bands in (1, 3, 8, 16)),
    *(Setting("mitsuba", rays, bands) for rays, bands in ((1, 4), (4, 4), (4, 16))),
    Setting("closed_form", 4, layers=3),
    *(Setting("reference", 4, light=light) for light in ("direct", "path")),
)


@dataclass(frozen=True)
class Point:
    """What a setting is worth. error: to the path-traced reference; sampling: to converged direct light, both in σ;
    rays: per receptor in the end. speed: agent-steps per CPU second."""

    setting: Setting
    error: float
    sampling: float
    rays: float
    speed: float


@dataclass(frozen=True)
class Chart:
    """All points of a scene; of the reference, its own standard error, and direct light's difference to it, in σ."""

    scene: str
    points: tuple[Point, ...]
    reference_error: float
    direct: float

    @property
    def front(self) -> tuple[Point, ...]:
        """Points that no other beats in both, fastest first."""
        ranked = sorted(self.points, key=lambda p: (-p.speed, p.error))
        least, found = np.inf, []
        for point in ranked:
            if point.error < least:
                found.append(point)
                least = point.error
        return tuple(found)

    @property
    def auto(self) -> Point:
        return next(p for p in self.points if p.setting.rays is None)

    @property
    def rival(self) -> Point:
        """The fastest point that is at least as exact as auto's."""
        return max((p for p in self.points if p.error <= self.auto.error), key=lambda p: p.speed)


def lived_through(world: sim.World, n: int, steps: int = 20) -> WorldState:
    """States that agents get into who act at random."""
    simulation = Simulation(world, n, 3, "training", 1)
    simulation.reset()
    rng = np.random.default_rng(5)
    for _ in range(steps):
        step = simulation.step(rng.uniform(-1, 1, (n, 2)))
        if step.done.any():
            simulation.restart(np.flatnonzero(step.done))
    simulation.close()
    return simulation.state


def converged(scene: Scene, world: sim.World, state: WorldState, light: str) -> tuple[np.ndarray, float]:
    """Signals by the reference renderer, and their standard error in σ, from two halves."""
    renderer = sim.ReferenceRenderer(world, scene.behind_lens(BANDS), light, SPP, sampler="multijitter")
    halves = []
    for renderer.seed in (1, 2):
        halves.append(renderer.signals(state).astype(float))
    return (halves[0] + halves[1]) / 2, rms(halves[0] - halves[1]) / 2 / SIGMA


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


@dataclass(frozen=True)
class Runner:
    """A setting at work on `count` worlds."""

    setting: Setting
    rays: float
    count: int
    signals: Callable[[WorldState], np.ndarray]


def runner(setting: Setting, scene: Scene, world: sim.World, count: int) -> Runner:
    eyes = scene.behind_lens(setting.bands)
    if setting.back_end == "reference":
        reference = sim.ReferenceRenderer(world, eyes, setting.light, int(setting.rays or 1), sampler="multijitter")
        return Runner(setting, setting.rays or 1, 1, reference.signals)
    asked: Any = "auto"
    if setting.rays is not None:
        depth = DepthLayers(np.inf, 0.2, setting.layers) if setting.layers > 1 else DepthLayers()
        asked = sim.Fidelity(setting.rays, setting.bands, depth)
    renderer = sim.BatchedRenderer(world, eyes, count, asked, setting.back_end)
    return Runner(setting, renderer.fidelity.rays_per_receptor, count, renderer.signals)


def measure(scene: Scene, settings: Sequence[Setting], states: int = 4, rounds: int = 5) -> Chart:
    world = sim.build_world(scene.task, seed=scene.seed)
    crowd = lived_through(world, MANY)
    seen = crowd.take(np.arange(states))
    path, reference_error = converged(scene, world, seen, "path")
    dense = sim.BatchedRenderer(world, scene.behind_lens(BANDS), states, 64).signals(seen).astype(float)
    runners = [runner(s, scene, world, FEW if (s.rays or 1) > 16 else MANY) for s in settings]
    errors = []
    for mine in runners:
        found = [mine.signals(part)[: states - at] for at, part in _parts(crowd, states, mine.count)]
        signals = np.concatenate(found)
        errors.append((rms(signals - path) / SIGMA, rms(signals - dense) / SIGMA))
    seconds = timed(runners, crowd, rounds)
    points = tuple(
        Point(r.setting, *error, r.rays, r.count / t) for r, error, t in zip(runners, errors, seconds, strict=True)
    )
    return Chart(scene.name, points, reference_error, rms(dense - path) / SIGMA)


def timed(runners: Sequence[Runner], crowd: WorldState, rounds: int) -> list[float]:
    """CPU seconds of each one's quickest call; calls that are over at once are repeated for ROUND in every round."""
    quickest = [np.inf] * len(runners)
    for _ in range(rounds):
        for i, mine in enumerate(runners):
            if mine.setting.back_end == "reference" and quickest[i] < np.inf:
                continue  # one of its steps takes seconds: more than enough to measure
            state, began = crowd.take(np.arange(mine.count)), time.process_time()
            while (start := time.process_time()) - began < ROUND:
                mine.signals(state)
                quickest[i] = min(quickest[i], time.process_time() - start)
    return quickest


def _parts(crowd: WorldState, states: int, count: int) -> list[tuple[int, WorldState]]:
    """The first states, `count` worlds at a time."""
    return [(at, crowd.take(np.arange(at, at + count))) for at in range(0, states, count)]


def broken_bounds(charts: Sequence[Chart]) -> list[str]:
    """Every bound that does not hold, in words."""
    broken = []
    for chart in charts:
        auto, rival = chart.auto, chart.rival
        if auto.speed < SLACK * rival.speed:
            broken.append(f"{chart.scene}: auto makes {auto.speed:.0f} steps/s, {rival.setting} {rival.speed:.0f}")
        if auto.sampling > 0.5:
            broken.append(f"{chart.scene}: auto errs by {auto.sampling:.2f} σ beside converged direct light")
        if chart.reference_error > 0.15:
            broken.append(f"{chart.scene}: the reference is good to {chart.reference_error:.2f} σ only")
        # More rays come nearer to converged direct light.
        series = sorted((p for p in chart.points if p.setting in RAYS), key=lambda p: p.rays)
        if any(b.sampling > 1.1 * a.sampling for a, b in itertools.pairwise(series) if a.sampling > 0.02):
            broken.append(f"{chart.scene}: errors do not fall with rays")
    return broken


def table(charts: Sequence[Chart]) -> str:
    lines = []
    for chart in charts:
        front = chart.front
        lines.append(
            f"{chart.scene}; reference good to {chart.reference_error:.2f} σ, direct light {chart.direct:.2f} σ from it"
        )
        lines.append("back end      rays  bands  light   layers   steps/s   error [σ]  beside direct [σ]")
        for p in sorted(chart.points, key=lambda p: -p.speed):
            marks = ("  front" if p in front else "") + (f"  {p.rays:g} rays" if p.setting.rays is None else "")
            speed = f"{p.speed:.3g}" if p.speed < 100 else f"{p.speed:.0f}"
            lines.append(f"{p.setting}{speed:>10}{p.error:>12.3f}{p.sampling:>12.3f}{marks}")
        lines.append("")
    return "\n".join(lines).rstrip()


COLORS = {"closed_form": "#0072B2", "mitsuba": "#E69F00", "reference": "#999999"}
MARKS = {1: "v", 3: "^", 4: "o", 8: "s", 16: "D"}


def draw(charts: Sequence[Chart], path: Path) -> None:
    """One panel per scene: error over speed, the front as a line, auto as a star."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5.2 * len(charts), 5.6), layout="constrained")
    panels = figure.subplots(1, len(charts), squeeze=False, sharey=True)
    for axes, chart in zip(panels.ravel(), charts, strict=False):
        _panel(axes, chart)
    _legend(figure)
    figure.savefig(path, dpi=110)


def _panel(axes: Any, chart: Chart) -> None:
    for p in chart.points:
        s = p.setting
        fill = COLORS[s.back_end] if s.light == "direct" else "white"
        axes.plot(p.speed, p.error, MARKS[s.bands], color=COLORS[s.back_end], mfc=fill, ms=4 + 2 * (s.layers > 1))
    front = chart.front
    axes.step([p.speed for p in front], [p.error for p in front], where="pre", color="black", lw=0.8, zorder=0)
    axes.plot(chart.auto.speed, chart.auto.error, "*", color="#D55E00", ms=17, mfc="none", mew=1.6)
    axes.axhline(0.5, color="#009E73", ls="--", lw=1)
    axes.axhline(chart.direct, color="#0072B2", ls=":", lw=1)
    for p in chart.points:
        if p.setting in RAYS or p.setting.back_end == "reference":
            axes.annotate(f"{p.rays:g}", (p.speed, p.error), xytext=(4, 4), textcoords="offset points", fontsize=7)
    axes.set(xscale="log", yscale="log", title=chart.scene)
    axes.set(xlabel="agent-steps per CPU second", ylabel="error [σ of the receptors' noise]")


def _legend(figure: Any) -> None:
    from matplotlib.lines import Line2D

    def mark(label: str, marker: str, **style: Any) -> Any:
        return Line2D([], [], ls="", marker=marker, label=label, **style)

    entries = [mark(name.replace("_", " "), "o", color=color) for name, color in COLORS.items()]
    entries += [mark(f"{bands} bands", shape, color="black", mfc="none") for bands, shape in MARKS.items()]
    entries += [
        mark("path-traced light", "o", color="#999999", mfc="white"),
        mark("auto", "*", color="#D55E00", mfc="none", ms=13),
        Line2D([], [], color="black", lw=0.8, label="Pareto front"),
        Line2D([], [], color="#009E73", ls="--", lw=1, label="half of the noise"),
        Line2D([], [], color="#0072B2", ls=":", lw=1, label="direct light to the end"),
    ]
    figure.legend(handles=entries, loc="outside lower center", ncols=5, frameon=False, fontsize=9)


def main(arguments: list[str] | None = None) -> int:
    options = parser(__doc__ or "").parse_args(arguments)
    charts = [measure(scene, SETTINGS) for scene in SCENES]
    page = Page("D1_speed_accuracy", __doc__ or "", table(charts), broken_bounds(charts))
    return page.publish(options, lambda path: draw(charts, path))


if __name__ == "__main__":
    sys.exit(main())
