"""Behaviour: one hash for everything that a change of structure must leave alone

Two checkouts behave alike where their hashes are the same, on one machine with the same libraries: episodes of every
task in training and evaluation (24 worlds, 300 steps), PSFs by every method, the record of a seeded evolution, what
its best agent saw as EXR files, and the numbers of its report.

    python -m validation.behaviour [--out FILE.json] [--against FILE.json]

With --against it names what differs from the stored hashes and exits with 1.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import optics
import sim

TASKS = ("navigation", "maze", "detection", "tracking", "foraging")
MODES = ("training", "evaluation")
WORLDS, STEPS = 24, 300
PSFS = 5  # of each method
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
EVOLUTION = (
    *("run", "detection", "--preset", "quick", "--seed", "3"),
    *("--set", "learning.total_steps=16384", "--set", "learning.eval_interval=8192", "--set", "workers=1"),
    *("--set", "search.generations=2"),
)


def episodes(task: str, mode: str) -> str:
    """Everything that 24 agents see, feel and earn in 300 random actions, through a perfect lens."""
    eyes = sim.Eyes(n_eyes=2, resolution=(3, 5))
    venv = sim.make_vec_env(task, eyes, WORLDS, seed=5, mode=mode, memory=2)
    rng, found = np.random.default_rng(1), hashlib.sha256()
    observation = venv.reset()
    for _ in range(STEPS):
        for name in sorted(observation):
            found.update(observation[name].tobytes())
        observation, reward, done, infos = venv.step(rng.uniform(-1, 1, (WORLDS, 2)).astype(np.float32))
        terms = [sorted(info["reward_terms"].items()) for info in infos]
        found.update(reward.tobytes() + done.tobytes() + repr(terms).encode())
    venv.close()
    return found.hexdigest()


def blurred_view() -> str:
    """What agents see through a pupil with a relief, in dim light."""
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
    """PSFs of random pupils, or that the method refuses them."""
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


def evolution(folder: Path) -> Iterator[tuple[str, str]]:
    """Record, EXR files and report of a small seeded evolution."""
    run = folder / "run"
    _evolve(*EVOLUTION, "--out", str(run))
    lines = [json.loads(line) for line in (run / "candidates.jsonl").read_text().splitlines()]
    told = [{key: value for key, value in line.items() if key != "seconds"} for line in lines]
    yield "record", _hash(json.dumps(told, sort_keys=True))
    for file in sorted((run / "exr").glob("*.exr"))[:4]:
        views = sim.read_exr(file)
        pixels = b"".join(np.ascontiguousarray(view.radiance).tobytes() for view in views)
        yield f"exr {file.name}", hashlib.sha256(pixels).hexdigest()
    for line in lines:
        line["seconds"] = 60.0  # what a clock says differs from run to run
    (run / "candidates.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
    _evolve("report", str(run))
    yield "numbers of the report", _hash(" ".join(_numbers((run / "report.html").read_text())))


def _numbers(page: str) -> list[str]:
    """Numbers that stand by themselves in what a reader sees: no part of a word, a path or a date."""
    visible = re.sub(r"<[^>]+>", " ", re.sub(r"<(script|style)\b.*?</\1>", "", page, flags=re.DOTALL))
    return [word for word in visible.split() if re.fullmatch(r"[-−]?\d[\d.,]*%?", word)]


def _evolve(*arguments: str) -> None:
    subprocess.run([sys.executable, "-m", "evolve", *arguments], check=True, capture_output=True)


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def behaviour() -> dict[str, str]:
    """Name of an output -> its hash."""
    found = {f"episodes {task} {mode}": episodes(task, mode) for task in TASKS for mode in MODES}
    found["view through a pupil"] = blurred_view()
    for method in METHODS:
        found |= psfs(method)
    with tempfile.TemporaryDirectory() as folder:
        found |= evolution(Path(folder))
    return found


def main() -> int:
    assert __doc__
    options = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    options.add_argument("--out", type=Path, help="file to write the hashes into")
    options.add_argument("--against", type=Path, help="file of hashes to compare with")
    asked = options.parse_args()
    found = behaviour()
    text = json.dumps(found, indent=1) + "\n"
    if asked.out:
        asked.out.write_text(text)
    if not asked.against:
        print(f"{len(found)} outputs, all together {_hash(text)[:16]}")
        return 0
    stored = json.loads(asked.against.read_text())
    differing = sorted(name for name in found.keys() | stored.keys() if found.get(name) != stored.get(name))
    print("\n".join([f"differs: {name}" for name in differing]) or f"all {len(found)} outputs are the same")
    return 1 if differing else 0


if __name__ == "__main__":
    raise SystemExit(main())
