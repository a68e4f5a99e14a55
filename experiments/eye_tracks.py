"""Tracks of two animals in unseen mazes and in detection, seen from above

python -m experiments.eye_tracks [--compute] [--docs DIR]
"""

from __future__ import annotations

import sys
import tempfile
import time
from argparse import Namespace
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from evolve.episodes.tracks import Track, tracks
from evolve.learning.animal_task import animal_task
from evolve.learning.policy import load_policy
from evolve.search.worker import evaluate_candidate, prepare_device
from experiments.designed import Design
from experiments.eye_factors_design import CAMERA, COMPOUND, LEARNER, TASKS, in_task
from experiments.page import Figure, Page, exit_code, markdown_table, new_figure, parser, save
from experiments.store import Origin, read_answer, read_rows, write_answer, write_rows
from sim.tasks.batch_task import BatchTask
from sim.worlds.ground_plan import GroundPlan

__all__ = ["Place", "Played", "main", "page"]

NAME = "eye_tracks"
ANIMALS = {"coarse": COMPOUND, "fine": CAMERA}
NAMES = {"coarse": "ten eyes of 4 x 4 over 135°", "fine": "two eyes of 15 x 15 over 45°"}
SEED = 0  # of the training runs, the first ones of the experiment on factors of eyes
EPISODES = 32
EVERY = 4  # actions between stored positions
MAZES, DETECTIONS = 3, 2  # test mazes and episodes of detection that are drawn
GREEN, VERMILLION, BLUE, GREY = "#009E73", "#D55E00", "#0072B2", "#8a8a8a"


@dataclass(frozen=True)
class Played:
    """An episode that an animal has played.

    task, animal: task, and name of the animal in ANIMALS
    episode: number of the episode
    total, solved: return of the episode; 1 if it counts as solved
    length: length of the track [m]
    objects: positions of the goal and the adversaries at the start [m], "x y" separated by commas; "" in mazes
    """

    task: str
    animal: str
    episode: int
    total: float
    solved: int
    length: float
    objects: str


@dataclass(frozen=True)
class Place:
    """Position of an animal before an action.

    task, animal, episode: see `Played`
    step: number of the action
    x, y: position [m]
    """

    task: str
    animal: str
    episode: int
    step: int
    x: float
    y: float


def page(played: Sequence[Played], places: Sequence[Place], origin: Origin, answer: str) -> Page:
    """Return the page of results, made from stored episodes and tracks."""
    return Page(
        name=NAME,
        command=f"python -m experiments.{NAME} --compute",
        values={"answer": answer, "table": _table(played), "episodes": str(EPISODES)},
        figures=[Figure(NAME, lambda path: _draw(played, places, path))],
        origin=origin,
    )


def _table(played: Sequence[Played]) -> str:
    lines = []
    for task in TASKS:
        for animal in ANIMALS:
            episodes = [one for one in played if (one.task, one.animal) == (task, animal)]
            means = (np.mean([getattr(one, name) for one in episodes]) for name in ("total", "solved", "length"))
            lines.append([f"{task}, {NAMES[animal]}", *(f"{mean:.3g}" for mean in means)])
    return markdown_table(["", "return", "solved", "length of a track [m]"], lines)


def _draw(played: Sequence[Played], places: Sequence[Place], path: Path) -> None:
    """Draw the tracks, with a row for each animal. Columns are test mazes, and single episodes of detection."""
    widths = [2.6] * MAZES + [1] * DETECTIONS
    figure, axes = new_figure(13, 3.4, columns=len(widths), rows=len(ANIMALS), width_ratios=widths)
    for row, animal in zip(axes, ANIMALS, strict=True):
        row[0].set_ylabel(NAMES[animal].replace(" over", "\nover"), fontsize=8)
        mazes = _by_maze([one for one in played if (one.task, one.animal) == ("maze", animal)], places)
        for axis, (plan, episodes) in zip(row[:MAZES], mazes, strict=True):
            _draw_world(axis, plan)
            for one in episodes:
                _draw_track(axis, one, places)
        for axis, one in zip(row[MAZES:], _detections(played, animal), strict=True):
            _draw_world(axis, _plan("detection", np.zeros(2)))
            for number, (x, y) in enumerate(_points(one.objects)):
                axis.plot(x, y, "s", color=VERMILLION if number else GREEN, ms=4)
            _draw_track(axis, one, places)
    for number, axis in enumerate(axes[0]):
        axis.set_title(f"unseen maze {number + 1}" if number < MAZES else "detection", fontsize=9)
    for axis in axes.flat:
        axis.set(xticks=[], yticks=[], aspect="equal")
        axis.spines[:].set_visible(False)
    save(figure, path)


def _detections(played: Sequence[Played], animal: str) -> list[Played]:
    return [one for one in played if (one.task, one.animal) == ("detection", animal)][:DETECTIONS]


def _by_maze(played: Sequence[Played], places: Sequence[Place]) -> list[tuple[GroundPlan, list[Played]]]:
    """Return the southernmost mazes with stored tracks, and the episodes that take place in each."""
    found: dict[float, tuple[GroundPlan, list[Played]]] = {}
    for one in played:
        track = _track(one, places)
        if len(track):
            plan = _plan("maze", track[0])
            found.setdefault(plan.bounds[1], (plan, []))[1].append(one)
    return [found[south] for south in sorted(found)][:MAZES]


def _track(one: Played, places: Sequence[Place]) -> np.ndarray:
    """Return the stored positions of an episode [m], (n, 2)."""
    own = [(p.x, p.y) for p in places if (p.task, p.animal, p.episode) == (one.task, one.animal, one.episode)]
    return np.array(own).reshape(-1, 2)


def _plan(task: str, place: np.ndarray) -> GroundPlan:
    """Return the plan of the layout around a place (2,) [m]."""
    plan = _world(task).ground_plan(place)
    assert plan is not None
    return plan


@cache
def _world(task: str) -> BatchTask:
    design = in_task(COMPOUND, task, SEED)
    return animal_task(design.animal, design.config(LEARNER), "test")


def _draw_world(axis: Any, plan: GroundPlan) -> None:
    from matplotlib.patches import Rectangle

    for x, y, half_x, half_y in plan.walls:
        axis.add_patch(Rectangle((x - half_x, y - half_y), 2 * half_x, 2 * half_y, color=GREY, lw=0))
    if plan.goal_region is not None:
        x0, y0, x1, y1 = plan.goal_region
        axis.add_patch(Rectangle((x0, y0), x1 - x0, y1 - y0, color=GREEN, alpha=0.25, lw=0))
    axis.set(xlim=plan.bounds[::2], ylim=plan.bounds[1::2])


def _draw_track(axis: Any, one: Played, places: Sequence[Place]) -> None:
    color, track = BLUE if one.solved else VERMILLION, _track(one, places)
    axis.plot(*track.T, color=color, lw=0.9, alpha=0.8)
    axis.plot(*track[0], "o", color=color, ms=2.5)


def _points(text: str) -> np.ndarray:
    """Return positions from their text, (n, 2)."""
    return np.array([[float(number) for number in pair.split()] for pair in text.split(",") if pair]).reshape(-1, 2)


def _tracks(design: Design) -> list[Track]:
    """Train an animal, and return its tracks in the test set of layouts."""
    config = design.config(LEARNER)
    with tempfile.TemporaryDirectory() as folder:
        policy = Path(folder) / "policy.safetensors"
        outcome = evaluate_candidate(design.animal, config, design.seed, policy, progress=lambda *_: None)
        if outcome.failure is not None:
            raise ValueError(f"{design}: failed: {outcome.failure}")
        return tracks(design.animal, config, load_policy(policy), SEED, EPISODES, "test")


def _played(task: str, animal: str, number: int, track: Track) -> Played:
    objects = ",".join(f"{x:.3f} {y:.3f}" for x, y in track.objects[0])
    return Played(task, animal, number, track.total, int(track.solved), track.length, objects)


def _places(task: str, animal: str, number: int, track: Track) -> list[Place]:
    kept = sorted({*range(0, len(track.position), EVERY), len(track.position) - 1})
    return [Place(task, animal, number, step, *(round(float(c), 3) for c in track.position[step])) for step in kept]


def main(arguments: Sequence[str] | None = None) -> int:
    """Train the animals if requested; make the page from the stored tracks."""
    options = parser(__doc__ or "")
    options.add_argument("--compute", action="store_true", help="train the animals and store their tracks")
    options.add_argument("--answer", help="answer on the page; stored for later calls")
    chosen = options.parse_args(arguments)
    return exit_code(NAME, lambda: _made(chosen))


def _made(chosen: Namespace) -> None:
    data = chosen.docs / "data" / f"{NAME}.csv"
    if chosen.compute:
        _compute(data)
    if chosen.answer:
        write_answer(data, chosen.answer)
    played, places = read_rows(Played, data), read_rows(Place, _of_places(data))
    if not played:
        raise ValueError(f"{data} contains no episodes; compute them with --compute")
    page(played, places, Origin.read(data.with_suffix(".json")), read_answer(data)).publish(chosen.docs)


def _compute(data: Path) -> None:
    began, played, places = time.process_time(), list[Played](), list[Place]()
    prepare_device()
    for task in TASKS:
        for animal, design in ANIMALS.items():
            found = _tracks(in_task(design, task, SEED))
            own = [_played(task, animal, number, track) for number, track in enumerate(found)]
            drawn = _drawn(task, found)
            places += [place for number in drawn for place in _places(task, animal, number, found[number])]
            played += own
            print(f"{task}, {NAMES[animal]}: return {np.mean([one.total for one in own]):.1f}", flush=True)
    write_rows(played, data)
    write_rows(places, _of_places(data))
    Origin.here((time.process_time() - began) / 3600).write(data.with_suffix(".json"))


def _drawn(task: str, found: Sequence[Track]) -> list[int]:
    """Return the numbers of the episodes that are drawn."""
    if task == "detection":
        return list(range(DETECTIONS))
    south = [one.plan.bounds[1] for one in found if one.plan is not None]
    return [number for number, edge in enumerate(south) if edge in sorted(set(south))[:MAZES]]


def _of_places(data: Path) -> Path:
    return data.with_stem(f"{NAME}_places")


if __name__ == "__main__":
    sys.exit(main())
