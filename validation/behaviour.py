"""Behaviour: one hash of all outputs that a refactoring must not change

Two checkouts behave identically if their hashes are equal, on one machine with the same libraries. Hashes cover
episodes of the built-in tasks in training and evaluation (1, 24 and 64 worlds, 300 steps), episodes of the user tasks
in `examples/` (also as a PettingZoo environment), PSFs by every method, the records of seeded evolutions, the EXR files
of their best agents, and the numbers of a report.

    python -m validation.behaviour [--out FILE.json] [--against FILE.json]

With --against it lists the differences from the stored hashes and exits with 1 if there are any.
"""

from __future__ import annotations

import argparse
import hashlib
import importlib.util
import json
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

import optics
import sim
from evolve.store.chain import sealed_record, without_checksum

TASKS = ("navigation", "maze", "detection", "tracking", "foraging")
EXAMPLES = Path(__file__).parents[1] / "examples"
MODES = ("training", "evaluation")
WORLDS, STEPS = (1, 24, 64), 300
USER_TASKS = {"FindBall": "find_ball", "AntSeeks": "ant_seeks", "Prey": "front_or_side"}  # class: file in examples/
USER_WORLDS, USER_STEPS = (1, 12), 100
PSFS = 5  # number of PSFs of each method
METHODS = (
    "hankel",
    "low_rank",
    "far_field",
    "angular_spectrum",
    "split_angular_spectrum",
    "rayleigh_sommerfeld",
    "fraunhofer",
    "fresnel",
    "geometric",
    "pinhole",
    "auto",
)
SMALL = (  # evolution of a user task: one generation of two candidates, with one rollout each
    *("--preset", "quick", "--seed", "4", "--set", "workers=1", "--set", "learning.n_envs=32"),
    *("--set", "search.population=2", "--set", "search.generations=2", "--set", "evaluation.episodes=8"),
    *("--set", "learning.total_steps=2048", "--set", "learning.eval_interval=2048"),
)
EVOLUTION = (
    *("run", "detection", "--preset", "quick", "--seed", "3"),
    *("--set", "learning.total_steps=16384", "--set", "learning.eval_interval=8192", "--set", "workers=1"),
    *("--set", "search.generations=2"),
)


def episodes(task: str, mode: str, worlds: int) -> str:
    """Return the hash of the outputs of 300 random actions, through a perfect lens.

    Outputs are observations, rewards, their terms, and whether each episode ended.
    """
    venv = sim.make_vec_env(task, sim.Eyes(n_eyes=2, resolution=(3, 5)), worlds, seed=5, mode=mode, memory=2)
    return _played(venv, STEPS)


def user_episodes(task: str, worlds: int) -> str:
    """Return the hash of the same outputs as in `episodes`, for a user task from `examples/`."""
    return _played(sim.make_vec_env(_example(task)(), n_envs=worlds, seed=5, memory=2), USER_STEPS)


def _played(venv: Any, steps: int) -> str:
    rng, found = np.random.default_rng(1), hashlib.sha256()
    observation, shape = venv.reset(), (venv.num_envs, *venv.action_space.shape)
    for _ in range(steps):
        for name in sorted(observation):
            found.update(observation[name].tobytes())
        observation, reward, done, infos = venv.step(rng.uniform(-1, 1, shape).astype(np.float32))
        terms = [sorted(info["reward_terms"].items()) for info in infos]
        found.update(reward.tobytes() + done.tobytes() + repr(terms).encode())
    venv.close()
    return found.hexdigest()


def encounter() -> str:
    """Return the hash of episodes of prey and predator as a PettingZoo environment, both with random actions."""
    prey, predator = (_example(name, "front_or_side") for name in ("Prey", "Predator"))
    hunter = type("Hunter", (predator,), {"rewards": lambda self, data: {"near": -abs(data.qpos[2] - data.qpos[0])}})
    solitary = type("Prey", (prey,), {"others": ()})
    env = sim.make_parallel_env(sim.Encounter(solitary(), hunter()), seed=2)
    rng, found = np.random.default_rng(1), hashlib.sha256()
    for _ in range(3):
        observations, _ = env.reset()
        while env.agents:
            for name in sorted(observations):
                found.update(b"".join(observations[name][key].tobytes() for key in sorted(observations[name])))
            actions = {name: rng.uniform(-1, 1, env.action_space(name).shape) for name in env.agents}
            observations, rewards, *_ = env.step(actions)
            found.update(repr(sorted(rewards.items())).encode())
    env.close()
    return found.hexdigest()


def _example(name: str, file: str | None = None) -> Any:
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{file or USER_TASKS[name]}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return getattr(module, name)


def blurred_view() -> str:
    """Return the hash of the agents' signals behind a pupil with a relief, in dim light."""
    relief = optics.BSplineRelief(np.linspace(0, 4e-6, 16).reshape(4, 4))
    pupil = optics.Pupil(40e-6, height=relief, n=1.6)
    budget = optics.PhotonBudget(illuminance=200.0, integration_time=0.02)
    eyes = sim.Eyes(n_eyes=3, resolution=(4, 4), optics=pupil, receptors="honeybee", photon_budget=budget)
    venv = sim.make_vec_env("detection", eyes, 8, seed=2)
    found = hashlib.sha256(venv.reset()["eyes"].tobytes())
    for _ in range(20):
        found.update(venv.step(np.full((8, 2), 0.3, np.float32))[0]["eyes"].tobytes())
    venv.close()
    return found.hexdigest()


def psfs(method: str) -> Iterator[tuple[str, str]]:
    """Yield names and hashes of PSFs of random pupils; if the method refuses a pupil, hash the error type instead."""
    rng = np.random.default_rng(7)
    for case in range(PSFS):
        radius = rng.uniform(10e-6, 60e-6)
        lens = rng.uniform(150e-6, 300e-6) if case % 2 else None
        relief = None if case < 2 else optics.BSplineRelief(rng.uniform(0, 3e-6, (4, 4)))
        pupil = optics.Pupil(radius, height=relief, n=1.5, thin_lens_focal_length=lens)
        try:
            result = optics.psf(pupil, [450e-9, 600e-9], 240e-6, dx=1e-6, shape=(31, 33), method=method)
            said = result.psf.tobytes() + f"{result.plan.method} {result.plan.samples}".encode()
        except ValueError as error:
            said = type(error).__name__.encode()
        yield f"psf {method} {case}", hashlib.sha256(said).hexdigest()


def user_evolution(task: str, folder: Path) -> Iterator[tuple[str, str]]:
    """Yield names and hashes of the record and the EXR files of a small seeded evolution of a user task."""
    run = folder / task
    _evolve("run", f"{EXAMPLES / USER_TASKS[task]}.py:{task}", *SMALL, "--out", str(run))
    yield f"record {task}", _record(run)
    yield from _frames(run, task)


def evolution(folder: Path) -> Iterator[tuple[str, str]]:
    """Yield names and hashes of the record, the EXR files and the report of a small seeded evolution."""
    run = folder / "run"
    _evolve(*EVOLUTION, "--out", str(run))
    yield "record", _record(run)
    yield from _frames(run)
    lines = _lines(run)
    for line in lines:
        line["seconds"] = 60.0  # measured times differ from run to run
    (run / "candidates.jsonl").write_bytes(sealed_record(json.dumps(line) + "\n" for line in lines))
    _evolve("report", str(run))
    yield "numbers of the report", _hash(" ".join(_numbers((run / "report.html").read_text())))


def _lines(run: Path) -> list[dict[str, Any]]:
    return [json.loads(without_checksum(line)) for line in (run / "candidates.jsonl").read_bytes().splitlines()]


def _record(run: Path) -> str:
    lines = [{k: v for k, v in line.items() if k != "seconds"} for line in _lines(run)]
    return _hash(json.dumps(lines, sort_keys=True))


def _frames(run: Path, task: str = "") -> Iterator[tuple[str, str]]:
    for file in sorted((run / "exr").glob("*.exr"))[:4]:
        views = sim.read_exr(file)
        pixels = b"".join(np.ascontiguousarray(view.radiance).tobytes() for view in views)
        yield f"exr {task} {file.name}".replace("  ", " "), hashlib.sha256(pixels).hexdigest()


def _numbers(page: str) -> list[str]:
    """Return the standalone numbers in the visible text of a page, without those in words, paths or dates."""
    visible = re.sub(r"<[^>]+>", " ", re.sub(r"<(script|style)\b.*?</\1>", "", page, flags=re.DOTALL))
    return [word for word in visible.split() if re.fullmatch(r"[-−]?\d[\d.,]*%?", word)]


def _evolve(*arguments: str) -> None:
    subprocess.run([sys.executable, "-m", "evolve", *arguments], check=True, capture_output=True)


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def behaviour() -> dict[str, str]:
    """Return the hash of each output by name."""
    found = {f"episodes {t} {mode}, {n} worlds": episodes(t, mode, n) for t in TASKS for mode in MODES for n in WORLDS}
    found |= {f"episodes {task}, {n} worlds": user_episodes(task, n) for task in USER_TASKS for n in USER_WORLDS}
    found["episodes of an encounter"] = encounter()
    found["view through a pupil"] = blurred_view()
    for method in METHODS:
        found |= psfs(method)
    with tempfile.TemporaryDirectory() as folder:
        found |= evolution(Path(folder))
        for task in USER_TASKS:
            found |= user_evolution(task, Path(folder))
    return found


def main() -> int:
    assert __doc__
    options = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    options.add_argument("--out", type=Path, help="file to which the hashes are written")
    options.add_argument("--against", type=Path, help="file of hashes to compare with")
    asked = options.parse_args()
    found = behaviour()
    text = json.dumps(found, indent=1) + "\n"
    if asked.out:
        asked.out.write_text(text)
    if not asked.against:
        print(f"{len(found)} outputs; hash of all: {_hash(text)[:16]}")
        return 0
    stored = json.loads(asked.against.read_text())
    differing = sorted(name for name in found.keys() | stored.keys() if found.get(name) != stored.get(name))
    print("\n".join([f"differs: {name}" for name in differing]) or f"all {len(found)} outputs are the same")
    return 1 if differing else 0


if __name__ == "__main__":
    raise SystemExit(main())
