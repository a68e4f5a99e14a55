"""How fast agents see: the batched renderer and environment beside MuJoCo's own renderer, in one process.

    python -m validation.sim_throughput --json

Medians over repeated calls after warm-up, in agent-steps per second (one step of one agent: all its eyes once):
    render         every eye of every world, perfect lens
    render_mitsuba the same where Mitsuba traces the rays, and not the closed form that a world of walls has
    render_optics  the same behind a pupil: receptive fields, weights, bands
    step           the whole VecEnv step behind that pupil: physics, rewards, rendering, optics, noise, infos
    mujoco         mujoco.Renderer drawing the same eyes of one world, one after the other (RGB, no optics, no shadows)
    mujoco_shadows the same with shadows, which the batched renderer has; in software they are what it mostly does
Ratios are to `mujoco`, the faster one. Absolute numbers say as much about the machine as about the code.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

os.environ.setdefault("MUJOCO_GL", "egl")  # MuJoCo reads it when first imported

import drjit as dr
import mujoco
import numpy as np

import optics
import sim
from sim.picture import pose
from sim.simulation import Simulation


@dataclass(frozen=True)
class Case:
    """A task with the eyes of the published experiments."""

    task: str
    eyes: sim.Eyes


CASES = (
    Case("detection", sim.Eyes(n_eyes=2, resolution=(15, 15), fov_deg=45, placement_range_deg=60)),
    Case("tracking", sim.Eyes(n_eyes=2, resolution=(15, 15), fov_deg=45, placement_range_deg=60)),
    Case("navigation", sim.Eyes(n_eyes=10, resolution=(1, 4), fov_deg=30, placement_range_deg=150)),
)
RAYS_PER_RECEPTOR = 4


def with_pupil(eyes: sim.Eyes) -> sim.Eyes:
    """The same eyes behind an open pupil a quarter as wide as the retina, with a lens in focus."""
    focal_length = eyes.eye().sensor_distance
    pupil = optics.Pupil(aperture_radius=eyes.sensor_width / 8, thin_lens_focal_length=focal_length)
    return replace(eyes, optics=pupil)


def seconds(call: Callable[[], Any], budget: float) -> float:
    """Median duration of a call: three to warm up, then for `budget` seconds, five at least."""
    for _ in range(3):
        call()
    times: list[float] = []
    while len(times) < 5 or sum(times) < budget:
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return statistics.median(times)


def measure(case: Case, n_envs: int, budget: float) -> dict[str, Any]:
    """Agent-steps per second of one case, and ratios to MuJoCo's renderer."""
    world = sim.build_world(case.task, eyes=case.eyes)
    rng = np.random.default_rng(0)
    state = Simulation(world, n_envs, 0, "training", 1).reset()

    def moved() -> Any:
        return replace(state, heading=rng.uniform(-np.pi, np.pi, n_envs))

    rates: dict[str, float | None] = {}
    tracers = {}
    for name, eyes, tracer in (
        ("render", case.eyes, "auto"),
        ("render_mitsuba", case.eyes, "mitsuba"),
        ("render_optics", with_pupil(case.eyes), "auto"),
    ):
        renderer = sim.BatchedRenderer(world, eyes, n_envs, RAYS_PER_RECEPTOR, tracer)
        tracers[name] = renderer.tracer.name
        rates[name] = n_envs / seconds(lambda renderer=renderer: renderer.signals(moved()), budget)  # type: ignore[misc]
    rates["step"] = n_envs / _step_seconds(case, n_envs, budget)
    for name, shadows in (("mujoco", False), ("mujoco_shadows", True)):
        rates[name] = _mujoco_rate(world, case.eyes, state, budget, shadows)
    base = rates["mujoco"]
    ratios = (
        {name: rates[name] / base for name in ("render", "render_mitsuba", "render_optics", "step")} if base else None
    )
    return {
        "task": case.task,
        "n_envs": n_envs,
        "tracers": tracers,
        "agent_steps_per_second": rates,
        "ratio_to_mujoco": ratios,
    }


def _step_seconds(case: Case, n_envs: int, budget: float) -> float:
    venv = sim.make_vec_env(case.task, with_pupil(case.eyes), n_envs, rays_per_receptor=RAYS_PER_RECEPTOR)
    venv.reset()
    rng = np.random.default_rng(0)
    duration = seconds(lambda: venv.step(rng.uniform(-1, 1, (n_envs, 2))), budget)
    venv.close()
    return duration


def _mujoco_rate(world: sim.World, eyes: sim.Eyes, state: Any, budget: float, shadows: bool) -> float | None:
    """Agent-steps/s of mujoco.Renderer with the eyes' resolution; None where there is no OpenGL."""
    height, width = eyes.resolution
    try:
        renderer = mujoco.Renderer(world.model, height, width)
    except Exception as error:  # whatever the OpenGL platform throws
        print(f"no mujoco.Renderer here: {error}")
        return None
    data = mujoco.MjData(world.model)
    worlds = iter(range(10**9))

    def draw() -> None:
        pose(data, world, state, next(worlds) % state.n)
        for i in range(eyes.n_eyes):
            renderer.update_scene(data, camera=f"eye_{i}")
            renderer.scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = shadows
            renderer.render()

    try:
        return 1 / seconds(draw, budget)
    finally:
        renderer.close()


def main() -> None:
    """Measure all cases and print a table, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument("--n-envs", type=int, nargs="+", default=[64], help="numbers of worlds (default 64)")
    parser.add_argument("--task", choices=[case.task for case in CASES], nargs="+", help="default: all")
    parser.add_argument("--seconds", type=float, default=2.0, help="spent on each number (default 2)")
    options = parser.parse_args()
    cases = [case for case in CASES if options.task is None or case.task in options.task]
    results = [measure(case, n, options.seconds) for case in cases for n in options.n_envs]
    machine = {"threads": dr.thread_count(), "processor": platform.machine(), "mujoco_gl": os.environ["MUJOCO_GL"]}
    if options.json:
        print(json.dumps({"machine": machine, "results": results}, indent=2))
        return
    for result in results:
        rates, ratios = result["agent_steps_per_second"], result["ratio_to_mujoco"] or {}
        print(f"{result['task']}, {result['n_envs']} worlds, agent-steps/s (ratio to mujoco.Renderer):")
        for name, rate in rates.items():
            ratio = f"  {ratios[name]:.1f}x" if name in ratios else ""
            print(f"  {name:14} {'-' if rate is None else f'{rate:.0f}':>8}{ratio}")


if __name__ == "__main__":
    main()
