"""Whole steps of environments in this checkout and in another one, such as the commit before a change.

Each checkout steps the same tasks with the same actions in a separate process. The two take turns of a third of a
second, so variations of the machine's speed affect both. The ratio is this checkout's steps per second over the
other's: the median over the turns, with the quartiles in brackets. Both checkouts must have the task names and the
arguments of `sim.make_vec_env` that are used here.

    python -m validation.benchmarks.two_checkouts OTHER [--turns 21] [--only detection]
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from importlib.util import find_spec, module_from_spec, spec_from_file_location
from pathlib import Path
from statistics import median, quantiles
from time import perf_counter
from typing import Any

CHECKOUT = Path(__file__).resolve().parents[2]
LINE = "steps per second: "
SECONDS, WARM_UP = 0.33, 1.5  # seconds of each turn, and before the first one


def _example(name: str, task: str) -> Any:
    spec = spec_from_file_location(name, Path.cwd() / "examples" / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return getattr(module, task)()


def _humanoid() -> Any:
    """Return Gymnasium's humanoid (MIT) with two eyes; its reward is irrelevant here."""
    import optics
    import sim

    package = find_spec("gymnasium")
    assert package is not None
    assert package.origin is not None

    class Humanoid(sim.Task):
        model = Path(package.origin).parent / "envs/mujoco/assets/humanoid.xml"
        eye, fidelity = optics.Eye(resolution=(15, 15), fov_deg=60.0), sim.Fidelity(4, bands=4)
        mounts = tuple(sim.both_sides([sim.Mount("torso", azimuth_deg=20, offset=(0.1, 0.04, 0.2))]))
        episode_steps = 1000

        def rewards(self, data: object) -> dict[str, float]:
            return {"none": 0.0}

    return Humanoid()


def cases() -> dict[str, Callable[[], Any]]:
    """Return functions that make the environments to step, by name."""
    import optics
    import sim

    few = sim.Eyes(n_eyes=2, resolution=(15, 15))
    many = sim.Eyes(n_eyes=10, resolution=(1, 4), fov_deg=45, placement_range_deg=180)
    rays = sim.Fidelity(4, bands=4)

    def behind_a_hole(eyes: Any) -> Any:
        return replace(eyes, optics=optics.Pupil(0.3 * eyes.sensor_width))

    def built_in(task: str, eyes: Any, worlds: int) -> Callable[[], Any]:
        return lambda: sim.make_vec_env(task, eyes, worlds, fidelity=rays)

    def own(task: Callable[[], Any], worlds: int) -> Callable[[], Any]:
        return lambda: sim.make_vec_env(task(), n_envs=worlds)

    found = {f"detection, {n} world(s)": built_in("detection", few, n) for n in (1, 64, 256)}
    found |= {f"navigation, {n} world(s)": built_in("navigation", many, n) for n in (1, 64, 256)}
    found["detection behind a pinhole, 64 worlds"] = built_in("detection", behind_a_hole(few), 64)
    found["navigation behind a pinhole, 64 worlds"] = built_in("navigation", behind_a_hole(many), 64)
    found |= {f"find_ball, {n} world(s)": own(lambda: _example("find_ball", "FindBall"), n) for n in (1, 64)}
    found["ant, 64 worlds"] = own(lambda: _example("ant_seeks", "AntSeeks"), 64)
    found["humanoid, 64 worlds"] = own(_humanoid, 64)
    return found


def serve() -> None:
    """Measure on request of the parent process: a line with a case's name opens it, an empty line requests a turn."""
    import numpy as np

    import sim

    assert Path(sim.__file__).is_relative_to(Path.cwd()), sim.__file__
    venv: Any = None
    actions = np.empty(0)
    for line in map(str.strip, sys.stdin):
        if line:
            if venv is not None:
                venv.close()
            venv = cases()[line]()
            shape = 20, venv.num_envs, *venv.action_space.shape
            actions = np.random.default_rng(0).uniform(-1, 1, shape).astype(np.float32)
            venv.reset()
        print(f"{LINE}{rate(venv, actions, WARM_UP if line else SECONDS)}", flush=True)


def rate(venv: Any, actions: Any, seconds: float) -> float:
    """Return the steps of all worlds per second."""
    start, steps = perf_counter(), 0
    while perf_counter() - start < seconds:
        venv.step(actions[steps % len(actions)])
        steps += 1
    return float(steps * venv.num_envs / (perf_counter() - start))


class Checkout:
    """A process that imports a checkout's packages."""

    def __init__(self, folder: Path) -> None:
        command = [sys.executable, str(Path(__file__).resolve()), "--serve"]
        environment = os.environ | {"PYTHONPATH": str(folder)}
        pipes: Any = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
        self.folder, self._child = folder, subprocess.Popen(command, cwd=folder, env=environment, **pipes)

    def asked(self, line: str = "") -> float:
        """Let the process open the case `line` or, if it is empty, measure one turn; return the steps per second."""
        assert self._child.stdin
        assert self._child.stdout
        print(line, file=self._child.stdin, flush=True)
        for said in self._child.stdout:
            if said.startswith(LINE):
                return float(said.removeprefix(LINE))
        raise SystemExit(f"{self.folder}: the process ended, see above")

    def close(self) -> None:
        """End the process."""
        assert self._child.stdin
        self._child.stdin.close()
        self._child.wait()


def main() -> None:
    assert __doc__
    options = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    options.add_argument("other", type=Path, nargs="?", help="folder of the other checkout")
    options.add_argument("--turns", type=int, default=21)
    options.add_argument("--only", default="", help="cases whose names contain this")
    options.add_argument("--serve", action="store_true", help=argparse.SUPPRESS)
    asked = options.parse_args()
    if asked.serve:
        serve()
        return
    if asked.other is None or not (asked.other / "sim").is_dir():
        options.error(f"OTHER = {asked.other}: must be the folder of a checkout")
    places = [Checkout(folder.resolve()) for folder in (asked.other, CHECKOUT)]
    print("| case | other, steps/s | this, steps/s | ratio |\n|---|---|---|---|")
    for name in (name for name in cases() if asked.only in name):
        for place in places:
            place.asked(name)
        turns = [tuple(place.asked() for place in places) for _ in range(asked.turns)]
        low, middle, high = quantiles((this / other for other, this in turns), n=4)
        rates = " | ".join(f"{median(column):,.0f}" for column in zip(*turns, strict=True))
        print(f"| {name} | {rates} | {middle:.2f} [{low:.2f}, {high:.2f}] |", flush=True)
    for place in places:
        place.close()


if __name__ == "__main__":
    main()
