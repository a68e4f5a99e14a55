"""CPU time of whole steps of environments in this checkout and in another one, such as the commit before a change.

Each checkout steps the same worlds with the same actions in a separate process with one Dr.Jit thread. The two take
turns of about a third of a second of CPU time, so variations of the machine's speed affect both. In each turn, both
take the same steps. Agents at walls take longer, so other steps could not be compared. The ratio is the other
checkout's CPU time over that of this one, so more than 1 means that this one is faster: the median over the turns, with
the quartiles in brackets. Both checkouts must have the task names and the arguments of `sim.make_vec_env` that are used
here.

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
from time import process_time
from typing import Any

CHECKOUT = Path(__file__).resolve().parents[2]
LINE = "steps per CPU second: "
SECONDS = 0.33  # CPU time of a turn
WARM_UP = 60  # steps before the first turn, taken twice


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
    for n in (1, 64, 256):
        found[f"detection behind a pinhole, {n} world(s)"] = built_in("detection", behind_a_hole(few), n)
        found[f"navigation behind a pinhole, {n} world(s)"] = built_in("navigation", behind_a_hole(many), n)
    found |= {f"find_ball, {n} world(s)": own(lambda: _example("find_ball", "FindBall"), n) for n in (1, 64)}
    found |= {f"ant, {n} world(s)": own(lambda: _example("ant_seeks", "AntSeeks"), n) for n in (1, 64, 256)}
    found |= {f"humanoid, {n} world(s)": own(_humanoid, n) for n in (1, 64, 256)}
    return found


def serve() -> None:
    """Measure on request of the parent process, which names a case to open, if any, and a number of steps."""
    import drjit
    import numpy as np

    import sim

    drjit.set_thread_count(1)
    assert Path(sim.__file__).is_relative_to(Path.cwd()), sim.__file__
    venv: Any = None
    actions = np.empty(0)
    for line in map(str.strip, sys.stdin):
        name, _, count = line.rpartition("|")
        steps = int(count)
        if name:
            if venv is not None:
                venv.close()
            venv = cases()[name]()
            shape = 20, venv.num_envs, *venv.action_space.shape
            actions = np.random.default_rng(0).uniform(-1, 1, shape).astype(np.float32)
            venv.reset()
        print(f"{LINE}{rate(venv, actions, steps)}", flush=True)


def rate(venv: Any, actions: Any, steps: int) -> float:
    """Take this number of steps; return the steps of all worlds per second of CPU time."""
    start = process_time()
    for step in range(steps):
        venv.step(actions[step % len(actions)])
    return float(steps * venv.num_envs / (process_time() - start))


class Checkout:
    """A process that imports a checkout's packages."""

    def __init__(self, folder: Path) -> None:
        command = [sys.executable, str(Path(__file__).resolve()), "--serve"]
        environment = os.environ | {"PYTHONPATH": str(folder)}
        pipes: Any = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
        self.folder, self._child = folder, subprocess.Popen(command, cwd=folder, env=environment, **pipes)

    def asked(self, steps: int, opened: str = "") -> float:
        """Let the process open a case, if one is named, and take steps; return steps of all worlds per CPU second."""
        assert self._child.stdin
        assert self._child.stdout
        print(f"{opened}|{steps}", file=self._child.stdin, flush=True)
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
    print("| case | other, steps per CPU s | this, steps per CPU s | ratio |\n|---|---|---|---|")
    for name in (name for name in cases() if asked.only in name):
        worlds = int(name.split()[-2])
        for place in places:
            place.asked(WARM_UP, name)
        steps = max(1, round(SECONDS * places[0].asked(WARM_UP) / worlds))
        places[1].asked(WARM_UP)
        turns = [tuple(place.asked(steps) for place in places) for _ in range(asked.turns)]
        low, middle, high = quantiles((this / other for other, this in turns), n=4)
        rates = " | ".join(f"{median(column):,.0f}" for column in zip(*turns, strict=True))
        print(f"| {name} | {rates} | {middle:.2f} [{low:.2f}, {high:.2f}] |", flush=True)
    for place in places:
        place.close()


if __name__ == "__main__":
    main()
