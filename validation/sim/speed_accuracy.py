"""Speed against accuracy of what agents see (D1)

Every way to render a world for its agents' eyes is shown by its error and its speed. The error is the root mean
square difference from a reference, over channels, eyes, states and two populations of receptors: all of them, in 4
states that agents got into; and those that see an object, in 24 views (8 through perfect lenses, where references are
dear) with one .8 to 4 m ahead. Mazes have no objects, so there the second population is empty. The reference is
Mitsuba's path tracer in 8 bands, followed, behind a lens, by the convolution `Eye.see`. Errors are in units of the
photoreceptors' noise, σ = 0.01. Errors below σ/2 are small compared with the noise of one receptor (but an agent could
still learn one that many receptors share). Speed is agent-steps (all eyes of one agent, once) per second of one core's
CPU time, the best of several interleaved rounds, without physics.

The eyes are those of the published experiments, with a perfect lens, and behind a lens in focus with a pupil of radius
a times half the retina's width. Levels: samples (rays, by closed forms or by Mitsuba's ray tracing; areas; the
reference renderer with few samples), their number per receptor, bands, light (direct; with one bounce, light that is
reflected twice; all light, which areas have from tables; paths of any length), depth layers.
Everything is float32, the only arithmetic that Mitsuba's spectral variants are built with, so precision is no level.

"auto" is what `choose_fidelity` picks by itself, bands included. Compared with path-traced light, its error must not
exceed the promised σ/2 (plus the noise of the reference) in either population, unless a `FidelityWarning` said so; the
table tells by how much it does. It must also be on the Pareto front of the greater of the two errors, or within 20 % of
the speed that this front has at its error. It was tuned on none of these views. The last column is the error over all
receptors against the same light rendered to the end, where only samples and bands are missing.

    python -m validation.sim.speed_accuracy [--out DIR] [--docs DIR] [--scenes N]
"""

from __future__ import annotations

import sys
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import drjit as dr
import numpy as np

import sim
from sim.eyes.depth_layers import DepthLayers
from sim.worlds.state import WorldState
from validation.pages.page import Page, parser
from validation.pages.tables import write_table
from validation.sim.scenes import SCENES, SIGMA, Scene, facing_objects, lived_through, sees_object
from validation.sim.speed_accuracy_figure import draw
from validation.sim.speed_accuracy_points import Chart, Errors, Point, Setting, rows_of, table

BANDS = 8  # of the references: good to 0.7 % of a signal, since their weights are exact
SPP = {"perfect lens": 96**2, "lens": 64}  # of each half of a reference: per receptor, and per cell of its picture
TO_THE_END = {"perfect lens": 4096, "lens": 64}  # rays per receptor
FEW, MANY = 8, 64  # worlds rendered at once: few where rays are many
# That agents got into, and with an object ahead: in the error over 8 of these chance is a standard deviation of .06 σ
# behind a lens of a = .25, where "auto" comes nearer to its promise than elsewhere.
STATES = {"perfect lens": (4, 8), "lens": (4, 24)}
SLACK = 0.8  # of the front's speed
REFERENCE_ERROR = 0.15  # [σ] at most
ROUND = 0.05  # [s] of CPU time
LIGHTS = ("direct", "bounce")
PERFECT_RAYS, RAYS = (1, 4, 16, 64, 256), (0.25, 1, 4, 16, 64)
AREAS = (1, 2, 4, 9)

AUTO = Setting("auto", None)
PERFECT_LENS = (
    AUTO,
    *(Setting("closed_form", rays, light=light) for light in LIGHTS for rays in PERFECT_RAYS),
    *(Setting("areas", areas, light=light) for light in ("bounce", "all") for areas in AREAS),
    *(Setting("areas", 4, bands, "all") for bands in (1, 8, 16)),
    *(Setting("mitsuba", 16, light=light) for light in LIGHTS),
    *(Setting("reference", 16, light=light) for light in ("direct", "path")),
)
BEHIND_LENS = (
    AUTO,
    *(Setting("closed_form", rays, light=light) for light in LIGHTS for rays in RAYS),
    *(Setting("areas", areas, light=light) for light in ("direct", "all") for areas in (1, 4)),
    *(Setting("areas", 1, bands, light) for bands in (8, 16) for light in ("direct", "all")),
    *(Setting("closed_form", 1, bands) for bands in (1, 8, 16)),
    *(Setting("closed_form", 16, bands, "bounce") for bands in (8, 16)),
    Setting("closed_form", 16, light="bounce", layers=3),
    *(Setting("mitsuba", 16, light=light) for light in LIGHTS),
    *(Setting("reference", 4, light=light) for light in ("direct", "path")),
)


@dataclass(frozen=True)
class Population:
    """Receptors that errors are judged over: those counted, (env, eye, height, width), of the crowd's first states."""

    crowd: WorldState
    counted: np.ndarray

    @property
    def states(self) -> int:
        return len(self.counted)

    @property
    def seen(self) -> WorldState:
        return self.crowd.take(np.arange(self.states))

    def signals(self, see: Callable[[WorldState], np.ndarray], at_once: int) -> np.ndarray:
        """Of the counted receptors, (receptor, channel), so many worlds at once."""
        parts = range(0, self.states, at_once)
        found = [see(self.crowd.take(np.arange(at, at + at_once))) for at in parts]
        return np.moveaxis(np.concatenate(found)[: self.states], 2, -1)[self.counted].astype(float)


def populations(scene: Scene, world: sim.World, states: Sequence[int]) -> list[Population]:
    """All receptors, in states that agents got into, and those that see an object, with one ahead."""
    crowd = lived_through(world, MANY)
    found = [Population(crowd, np.ones((states[0], scene.eyes.n_eyes, *scene.eyes.resolution), bool))]
    if world.objects:
        facing = facing_objects(world, crowd)
        found.append(Population(facing, sees_object(world, scene.eyes, facing.take(np.arange(states[1])))))
    return found


def converged(
    scene: Scene, world: sim.World, judged: Sequence[Population], spp: int
) -> tuple[list[np.ndarray], Errors]:
    """Path-traced signals by the reference renderer, and their standard errors, from two halves."""
    renderer = sim.ReferenceRenderer(world, scene.eyes_with(BANDS), "path", spp, sampler="multijitter")
    halves = []
    for renderer.seed in (1, 2):
        halves.append([population.signals(renderer.signals, 1) for population in judged])
    first, second = halves
    return [(a + b) / 2 for a, b in zip(first, second, strict=True)], Errors.of(first, second, 2 * SIGMA)


@dataclass(frozen=True)
class Runner:
    """A setting at work on `count` worlds. fidelity: None for the reference; warning: of the choice."""

    setting: Setting
    fidelity: sim.Fidelity | None
    count: int
    signals: Callable[[WorldState], np.ndarray]
    warning: str = ""


def runner(setting: Setting, scene: Scene, world: sim.World) -> Runner:
    eyes, warning = scene.eyes_with(setting.bands), ""
    if setting.back_end == "reference":
        spp = int(setting.samples or 1)
        reference = sim.ReferenceRenderer(world, eyes, setting.light, spp, sampler="multijitter")
        return Runner(setting, None, 1, reference.signals)
    if setting.samples is None:
        asked, warning = chosen(world, eyes)
    else:
        depth = DepthLayers(np.inf, 0.2, setting.layers) if setting.layers > 1 else DepthLayers()
        kind = "areas" if setting.back_end == "areas" else "rays"
        asked = sim.Fidelity(setting.samples, setting.bands, depth, light=setting.light, samples=kind)
    count = FEW if asked.rays_per_receptor > 16 and asked.samples == "rays" else MANY
    tracer = setting.back_end if setting.back_end in ("closed_form", "mitsuba") else "auto"
    renderer = sim.BatchedRenderer(world, eyes, count, asked, tracer)
    return Runner(setting, asked, count, renderer.signals, warning)


def chosen(world: sim.World, eyes: sim.Eyes) -> tuple[sim.Fidelity, str]:
    """What is picked, and the warning that came with it, if one did."""
    with warnings.catch_warnings(record=True) as given:
        warnings.simplefilter("always", sim.FidelityWarning)
        fidelity = sim.choose_fidelity(world, eyes)
    return fidelity, "; ".join(str(w.message) for w in given if issubclass(w.category, sim.FidelityWarning))


def measure(
    scene: Scene,
    settings: Sequence[Setting],
    states: Sequence[int] | None = None,
    rounds: int = 5,
    spp: int | None = None,
) -> Chart:
    world = sim.build_world(scene.task, seed=scene.seed)
    judged = populations(scene, world, states or STATES[scene.lens])
    path, reference_error = converged(scene, world, judged, spp or SPP[scene.lens])
    ends = {light: to_the_end(scene, world, judged, light) for light in LIGHTS}
    runners = [runner(setting, scene, world) for setting in settings]
    errors = []
    for mine in runners:
        found = [population.signals(mine.signals, mine.count) for population in judged]
        light = mine.fidelity.light if mine.fidelity else mine.setting.light
        errors.append((Errors.of(found, path, SIGMA), Errors.of(found, ends.get(light, path), SIGMA).everywhere))
    seconds = timed(runners, judged[0].crowd, rounds)
    points = tuple(
        Point(r.setting, *error, r.count / t, r.fidelity, r.warning)
        for r, error, t in zip(runners, errors, seconds, strict=True)
    )
    left = {light: Errors.of(signals, path, SIGMA) for light, signals in ends.items()}
    return Chart(scene.name, points, reference_error, left)


def to_the_end(scene: Scene, world: sim.World, judged: Sequence[Population], light: str) -> list[np.ndarray]:
    """Signals by the batched renderer with many rays, a few worlds at a time."""
    fidelity, at_once = sim.Fidelity(TO_THE_END[scene.lens], BANDS, light=light), 4
    renderer = sim.BatchedRenderer(world, scene.eyes_with(BANDS), at_once, fidelity)
    return [population.signals(renderer.signals, at_once) for population in judged]


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


def broken_bounds(charts: Sequence[Chart]) -> list[str]:
    """Every bound that does not hold, in words."""
    broken = []
    for chart in charts:
        auto, rival = chart.auto, chart.rival
        if auto.speed < SLACK * rival.speed:
            broken.append(f"{chart.scene}: auto makes {auto.speed:.0f} steps/s, {rival.setting} {rival.speed:.0f}")
        if not auto.warning:
            broken += [f"{chart.scene}: auto errs by {error:.3f} σ {where}" for where, error in chart.missed]
        if chart.reference_error.worst > REFERENCE_ERROR:
            broken.append(f"{chart.scene}: the reference is good to {chart.reference_error} σ only")
        broken += [f"{chart.scene}: errors of {name} light do not fall" for name in chart.not_falling]
    return broken


def main(arguments: list[str] | None = None) -> int:
    asked = parser(__doc__ or "")
    asked.add_argument("--scenes", type=int, default=len(SCENES), help="measure the first so many only")
    options = asked.parse_args(arguments)
    dr.set_thread_count(1)  # so that no thread that waits for work counts as CPU time
    charts = []
    for scene in SCENES[: options.scenes]:
        charts.append(measure(scene, PERFECT_LENS if scene.aperture is None else BEHIND_LENS))
        print(table(charts[-1:]), flush=True)
    page = Page("speed_accuracy", __doc__ or "", table(charts), broken_bounds(charts))
    if options.docs:
        write_table(options.docs / "data" / "speed_accuracy.csv", rows_of(charts))
        (options.docs.parent / "images").mkdir(parents=True, exist_ok=True)
        draw(charts, options.docs.parent / "images" / f"{page.name}.png")
    return page.publish(options, lambda path: draw(charts, path))


if __name__ == "__main__":
    sys.exit(main())
