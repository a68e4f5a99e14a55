"""D1: speed against accuracy of what agents see

Every way to render a world for its agents' eyes is shown by its error and its speed. The error is the root mean
square difference from a reference, over receptors, channels, eyes and states that agents got into. The reference is
Mitsuba's path tracer in 8 bands, followed by the convolution `Eye.see`. Errors are in units of the photoreceptors'
noise, σ = 0.01. Errors below σ/2 are small compared with the noise of one receptor (but an agent could still learn
one that many receptors share). Speed is agent-steps (all eyes of one agent, once) per second of one core's CPU time,
the best of several interleaved rounds, behind the pupil, without physics.

The eyes are those of the published experiments, behind lenses in focus. Levels: back end (closed form, Mitsuba's ray
tracing in the batched renderer, the reference renderer with few samples), rays per receptor, bands, light (direct;
with one bounce, light that is reflected twice; paths of any length), depth layers. Everything is float32, the only
arithmetic that Mitsuba's spectral variants are built with, so precision is not a level.

"auto" is what `choose_fidelity` picks by itself, bands included. Compared with path-traced light, its error must not
exceed the promised σ/2 (plus the noise of the reference). It must also be on the Pareto front, or within 20 % of the
speed that the front has at its error. It was tuned on none of these worlds. The last column is the error against the
same light rendered to the end, where only rays and bands are missing.

    python -m validation.D1_speed_accuracy [--out DIR] [--docs DIR] [--scenes N]
"""

from __future__ import annotations

import itertools
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

import sim
from sim.eyes.depth_layers import DepthLayers
from sim.worlds.state import WorldState
from validation.page import Page, parser
from validation.scenes import SCENES, SIGMA, Scene, lived_through, rms
from validation.speed_accuracy import Chart, Point, Setting, draw, rows_of, table
from validation.stored import write_table

BANDS = 8  # of the references: good to 0.7 % of a signal, since their weights are exact
SPP = 64
FEW, MANY = 8, 64  # worlds rendered at once: few where rays are many
SLACK = 0.8  # of the front's speed
ROUND = 0.05  # [s] of CPU time
LIGHTS = ("direct", "bounce")
RAYS = (0.25, 1, 4, 16, 64, 256)

SETTINGS = (
    Setting("closed_form", None),
    *(Setting("closed_form", rays, light=light) for light in LIGHTS for rays in RAYS),
    *(Setting("closed_form", rays, bands) for rays in (1, 16) for bands in (1, 3, 8, 16)),
    *(Setting("closed_form", 16, bands, "bounce") for bands in (8, 16)),
    *(Setting("mitsuba", rays, light=light) for light in LIGHTS for rays in (1, 16)),
    *(Setting("closed_form", 16, light="bounce", layers=n) for n in (3, 5)),
    *(Setting("reference", 4, light=light) for light in ("direct", "path")),
)


def converged(scene: Scene, world: sim.World, state: WorldState, spp: int) -> tuple[np.ndarray, float]:
    """Path-traced signals by the reference renderer, and their standard error in σ, from two halves."""
    renderer = sim.ReferenceRenderer(world, scene.behind_lens(BANDS), "path", spp, sampler="multijitter")
    halves = []
    for renderer.seed in (1, 2):
        halves.append(renderer.signals(state).astype(float))
    return (halves[0] + halves[1]) / 2, rms(halves[0] - halves[1]) / 2 / SIGMA


@dataclass(frozen=True)
class Runner:
    """A setting at work on `count` worlds; fidelity: None for the reference."""

    setting: Setting
    fidelity: sim.Fidelity | None
    count: int
    signals: Callable[[WorldState], np.ndarray]


def runner(setting: Setting, scene: Scene, world: sim.World, count: int) -> Runner:
    eyes = scene.behind_lens(setting.bands)
    if setting.back_end == "reference":
        reference = sim.ReferenceRenderer(world, eyes, setting.light, int(setting.rays or 1), sampler="multijitter")
        return Runner(setting, None, 1, reference.signals)
    if setting.rays is None:
        asked = sim.choose_fidelity(world, eyes)
    else:
        depth = DepthLayers(np.inf, 0.2, setting.layers) if setting.layers > 1 else DepthLayers()
        asked = sim.Fidelity(setting.rays, setting.bands, depth, light=setting.light)
    renderer = sim.BatchedRenderer(world, eyes, count, asked, setting.back_end)
    return Runner(setting, asked, count, renderer.signals)


def measure(scene: Scene, settings: Sequence[Setting], states: int = 4, rounds: int = 5, spp: int = SPP) -> Chart:
    world = sim.build_world(scene.task, seed=scene.seed)
    crowd = lived_through(world, MANY)
    seen = crowd.take(np.arange(states))
    path, reference_error = converged(scene, world, seen, spp)
    ends = {light: to_the_end(scene, world, seen, light) for light in LIGHTS}
    runners = [runner(s, scene, world, FEW if (s.rays or 1) > 16 else MANY) for s in settings]
    errors = []
    for mine in runners:
        found = [mine.signals(part)[: states - at] for at, part in _parts(crowd, states, mine.count)]
        signals = np.concatenate(found)
        light = mine.fidelity.light if mine.fidelity else mine.setting.light
        errors.append((rms(signals - path) / SIGMA, rms(signals - ends.get(light, path)) / SIGMA))
    seconds = timed(runners, crowd, rounds)
    points = tuple(
        Point(r.setting, *error, r.count / t, r.fidelity) for r, error, t in zip(runners, errors, seconds, strict=True)
    )
    left = {light: rms(signals - path) / SIGMA for light, signals in ends.items()}
    return Chart(scene.name, points, reference_error, left)


def to_the_end(scene: Scene, world: sim.World, state: WorldState, light: str) -> np.ndarray:
    """Signals by the batched renderer with many rays."""
    fidelity = sim.Fidelity(64, BANDS, light=light)
    return sim.BatchedRenderer(world, scene.behind_lens(BANDS), state.n, fidelity).signals(state).astype(float)


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
        if auto.error > np.hypot(0.5, chart.reference_error):
            broken.append(f"{chart.scene}: auto errs by {auto.error:.2f} σ")
        if chart.reference_error > 0.15:
            broken.append(f"{chart.scene}: the reference is good to {chart.reference_error:.2f} σ only")
        # More rays come nearer to the same light rendered to the end.
        for light in LIGHTS:
            asked = {Setting("closed_form", rays, light=light): rays for rays in RAYS}
            series = sorted((p for p in chart.points if p.setting in asked), key=lambda p: asked[p.setting])
            if any(b.sampling > 1.1 * a.sampling for a, b in itertools.pairwise(series) if a.sampling > 0.03):
                broken.append(f"{chart.scene}: errors of {light} light do not fall with rays")
    return broken


def main(arguments: list[str] | None = None) -> int:
    asked = parser(__doc__ or "")
    asked.add_argument("--scenes", type=int, default=len(SCENES), help="measure the first so many only")
    options = asked.parse_args(arguments)
    charts = [measure(scene, SETTINGS) for scene in SCENES[: options.scenes]]
    page = Page("D1_speed_accuracy", __doc__ or "", table(charts), broken_bounds(charts))
    if options.docs:
        write_table(options.docs / "data" / "D1.csv", rows_of(charts))
        (options.docs.parent / "images").mkdir(parents=True, exist_ok=True)
        draw(charts, options.docs.parent / "images" / f"{page.name}.png")
    return page.publish(options, lambda path: draw(charts, path))


if __name__ == "__main__":
    sys.exit(main())
