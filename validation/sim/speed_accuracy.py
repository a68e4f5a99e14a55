"""Speed against accuracy of rendering for agents' eyes

How much accuracy does each rendering speed allow? The automatic choice of settings promises an error below σ/2, where σ
is the receptor noise. Does it keep this promise? It does in all six scenes: its largest error is 0.399 σ. The speed of
the automatic choice is 0.95 to 1.00 times the speed of the fastest setting that is at least as accurate.

**Errors.** The error of a setting is the root mean square difference from a reference, over channels, eyes, states and
receptors. Errors are in units of the receptor noise, σ = 0.01. Errors below σ/2 are small compared with the noise of
one receptor. (If many receptors have the same error, an agent could still learn to use it.) Errors are computed over
two populations of receptors:

- all receptors, in 4 states that agents reached;
- the receptors that see an object, in 24 views with an object 0.8 to 4 m ahead (8 views with a perfect lens, because
  the path-traced renderings take long). Mazes have no objects, so this population is empty there.

The reference is Mitsuba's path tracer in 8 bands. Behind a lens, its image is convolved with the kernel of the eye
(`Eye.see`).

**Speed.** The speed is the number of agent-steps per second of one core's CPU time, without physics. In an agent-step,
all eyes of one agent are rendered once. All settings are measured in turn, in several rounds, and the speed of a
setting is that of its fastest round.

**Settings.** The eyes are those of the published experiments. Each is rendered with a perfect lens, and behind a lens
in focus with a stated relative aperture a (pupil diameter / retina width). The following settings vary:

- samples: rays traced in closed form, rays traced by Mitsuba, areas, or the reference renderer with few samples;
- the number of samples per receptor;
- the number of bands;
- light: "direct"; "bounce", which adds light that is reflected twice; "all" light, which areas take from tables; or
  "path", which is paths of any length;
- the number of depth layers.

All settings use float32, because Mitsuba's spectral variants are built for float32 only.

**Table.** "auto" is the choice of `choose_fidelity`, bands included. "front" marks settings on the Pareto front of
speed against error: no other setting is both faster and more accurate. For this comparison, the error of a setting is
the greater of the two populations' errors. "on objects" is the error over the receptors that see an object. "vs same
light" is the error over all receptors relative to a rendering with very many rays in the same light, so it contains
only the effects of samples and bands. The lines above each table state how much direct light and "bounce" light differ
from path-traced light, even with very many samples ("converged").

**Bounds.** Compared with path-traced light, the error of "auto" must not exceed the promised σ/2 (plus the noise of the
reference) in either population, unless a `FidelityWarning` was raised. If the promise is broken, the table states by
how much. "auto" must also be on the Pareto front, or at most 20 % slower than settings of the front with the same
error. None of these views was used to tune "auto".

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

BANDS = 8  # of the references: error 0.7 % of a signal, since their weights are exact
SPP = {"perfect lens": 96**2, "lens": 64}  # of each half of a reference: per receptor, and per cell of its image
TO_THE_END = {"perfect lens": 4096, "lens": 64}  # rays per receptor of converged renderings
FEW, MANY = 8, 64  # worlds rendered at once: few for many rays
# States that agents reached, and states with an object ahead. Over 8 of the latter, the standard deviation of the error
# from chance is 0.06 σ behind a lens with a = 0.25, where the error of "auto" is closest to its bound.
STATES = {"perfect lens": (4, 8), "lens": (4, 24)}
SLACK = 0.8  # smallest speed relative to the front's
REFERENCE_ERROR = 0.15  # [σ] largest standard error of the reference
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
    """Receptors over which errors are computed.

    crowd: states of all worlds.
    counted: mask (env, eye, height, width) of the receptors over which errors are computed, in the first worlds.
    """

    crowd: WorldState
    counted: np.ndarray

    @property
    def states(self) -> int:
        return len(self.counted)

    @property
    def seen(self) -> WorldState:
        return self.crowd.take(np.arange(self.states))

    def signals(self, see: Callable[[WorldState], np.ndarray], at_once: int) -> np.ndarray:
        """Return the signals of the counted receptors, (receptor, channel), computed for `at_once` worlds at a time."""
        parts = range(0, self.states, at_once)
        found = [see(self.crowd.take(np.arange(at, at + at_once))) for at in parts]
        return np.moveaxis(np.concatenate(found)[: self.states], 2, -1)[self.counted].astype(float)


def populations(scene: Scene, world: sim.World, states: Sequence[int]) -> list[Population]:
    """Return two populations: all receptors of agents after random actions, and receptors that see an object ahead."""
    crowd = lived_through(world, MANY)
    found = [Population(crowd, np.ones((states[0], scene.eyes.n_eyes, *scene.eyes.resolution), bool))]
    if world.objects:
        facing = facing_objects(world, crowd)
        found.append(Population(facing, sees_object(world, scene.eyes, facing.take(np.arange(states[1])))))
    return found


def converged(
    scene: Scene, world: sim.World, judged: Sequence[Population], spp: int
) -> tuple[list[np.ndarray], Errors]:
    """Return the path-traced signals, means of two renderings by the reference renderer, and their standard errors."""
    renderer = sim.ReferenceRenderer(world, scene.eyes_with(BANDS), "path", spp, sampler="multijitter")
    halves = []
    for renderer.seed in (1, 2):
        halves.append([population.signals(renderer.signals, 1) for population in judged])
    first, second = halves
    return [(a + b) / 2 for a, b in zip(first, second, strict=True)], Errors.between(first, second, 2 * SIGMA)


@dataclass(frozen=True)
class Runner:
    """A setting, and how to render with it.

    fidelity: fidelity of the renderer; None for the reference.
    count: number of worlds that are rendered at once.
    signals: function that renders them.
    warning: warning of the automatic choice.
    """

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
    """Return the automatic choice, and its warning, if any."""
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
        errors.append(
            (Errors.between(found, path, SIGMA), Errors.between(found, ends.get(light, path), SIGMA).everywhere)
        )
    seconds = timed(runners, judged[0].crowd, rounds)
    points = tuple(
        Point(r.setting, *error, r.count / t, r.fidelity, r.warning)
        for r, error, t in zip(runners, errors, seconds, strict=True)
    )
    left = {light: Errors.between(signals, path, SIGMA) for light, signals in ends.items()}
    return Chart(scene.name, points, reference_error, left)


def to_the_end(scene: Scene, world: sim.World, judged: Sequence[Population], light: str) -> list[np.ndarray]:
    """Return signals by the batched renderer with many rays, a few worlds at a time."""
    fidelity, at_once = sim.Fidelity(TO_THE_END[scene.lens], BANDS, light=light), 4
    renderer = sim.BatchedRenderer(world, scene.eyes_with(BANDS), at_once, fidelity)
    return [population.signals(renderer.signals, at_once) for population in judged]


def timed(runners: Sequence[Runner], crowd: WorldState, rounds: int) -> list[float]:
    """Return the CPU seconds of each runner's fastest call.

    In each round, short calls are repeated for ROUND seconds.
    """
    quickest = [np.inf] * len(runners)
    for _ in range(rounds):
        for i, mine in enumerate(runners):
            if mine.setting.back_end == "reference" and quickest[i] < np.inf:
                continue  # one of its steps takes seconds: enough to measure
            state, began = crowd.take(np.arange(mine.count)), time.process_time()
            while (start := time.process_time()) - began < ROUND:
                mine.signals(state)
                quickest[i] = min(quickest[i], time.process_time() - start)
    return quickest


def broken_bounds(charts: Sequence[Chart]) -> list[str]:
    """Return the descriptions of the bounds that do not hold."""
    broken = []
    for chart in charts:
        auto, rival = chart.auto, chart.rival
        if auto.speed < SLACK * rival.speed:
            broken.append(f"{chart.scene}: auto makes {auto.speed:.0f} steps/s, {rival.setting} {rival.speed:.0f}")
        if not auto.warning:
            broken += [f"{chart.scene}: auto has an error of {error:.3f} σ {where}" for where, error in chart.missed]
        if chart.reference_error.worst > REFERENCE_ERROR:
            broken.append(f"{chart.scene}: the standard error of the reference is {chart.reference_error} σ")
        broken += [f"{chart.scene}: errors of {name} light do not fall" for name in chart.not_falling]
    return broken


def main(arguments: list[str] | None = None) -> int:
    asked = parser(__doc__ or "")
    asked.add_argument("--scenes", type=int, default=len(SCENES), help="number of scenes to measure")
    options = asked.parse_args(arguments)
    dr.set_thread_count(1)  # idle threads would count as CPU time
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
