"""Storage of episodes in npz archives. Files in the format of earlier versions can be read, too.

Nothing in a file is executed when it is loaded.
"""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Mapping
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from evolve.config.checks import check_values
from evolve.config.formats import task_then
from evolve.config.run_config import EyeConfig, WorldConfig
from evolve.episodes.episode import Episode, Pictures
from evolve.episodes.episode_scene import EpisodeScene
from evolve.genome.phenotype import Phenotype
from evolve.genome.plain_values import parsed
from evolve.store import regular_files
from evolve.store.atomic_files import write_whole
from sim.scene.solids import Solid, solids_of
from sim.scene.tessellation import Triangles
from sim.tasks.built_in import mounts_of_agent
from sim.tasks.command import Command
from sim.tasks.registry import task_of
from sim.worlds.ground_plan import GroundPlan
from sim.worlds.world import build_world

__all__ = ["load_episode", "save_episode"]

FORM = 2  # number of the current format
# Maximum size of an unpacked episode [bytes]. An episode of 256 steps takes some megabytes, and about 100 with images.
MOST_BYTES = 2**31
PARTS = {"scene": EpisodeScene, "plan": GroundPlan, "pictures": Pictures}
BY_NAME = {"term": "reward_terms", "beside": "beside"}  # prefix of arrays -> attribute of Episode


def save_episode(episode: Episode, path: Path | str) -> None:
    """Write an episode as npz, completely or not at all: its arrays as arrays, and all other values as JSON.

    Raises:
        OSError: the file cannot be written.
    """
    arrays: dict[str, Any] = {name: value for name, value in vars(episode).items() if isinstance(value, np.ndarray)}
    for prefix, name in BY_NAME.items():
        arrays |= {f"{prefix}_{key}": array for key, array in getattr(episode, name).items()}
    rest = {name: value for name, value in vars(episode).items() if name not in (*arrays, *PARTS, *BY_NAME.values())}
    rest |= {
        "form": FORM,
        "phenotype": episode.phenotype.to_json(),
        "eye": asdict(episode.eye),
        "world": asdict(episode.world),
        "commands": [asdict(command) for command in episode.commands],
        "counted": dict(episode.counted),
        "terms": list(episode.reward_terms),
        "parts": {},
    }
    for name in PARTS:
        if (part := getattr(episode, name)) is not None:
            values = {key: value for key, value in vars(part).items() if key != "solids"}
            arrays |= {f"{name}.{key}": value for key, value in values.items() if isinstance(value, np.ndarray)}
            rest["parts"][name] = {key: value for key, value in values.items() if not isinstance(value, np.ndarray)}
    rest["solids"] = [_described(solid, number, arrays) for number, solid in enumerate(episode.scene.solids)]
    content = io.BytesIO()
    # The argument `allow_pickle` is not given, because NumPy 2.0 would store it as an array of that name.
    np.savez_compressed(content, **arrays, rest=np.array(json.dumps(rest)))
    write_whole(Path(path), content.getvalue())


def load_episode(path: Path | str) -> Episode:
    """Load an episode that `save_episode` wrote, in the current or the older format.

    Raises:
        ValueError: the file cannot be read, is too large, or contains no episode; the message is one line that names
            the file.
    """
    try:
        arrays = _arrays(path)
        rest = parsed(str(arrays.pop("rest")))
        eye = EyeConfig(**{"pupil_turned": True, **rest["eye"]})  # this setting is newer than files without it
        rest |= {"phenotype": Phenotype.from_json(rest["phenotype"]), "eye": eye}
        if (form := rest.pop("form", 1)) not in (1, FORM):
            raise ValueError(f"its form is {form!r}: must be at most {FORM}")
        terms = rest.pop("terms")
        rest["reward_terms"] = {name: arrays.pop(f"term_{name}") for name in terms}
        return _of_first_form(rest, arrays) if form == 1 else _of_second_form(rest, arrays)
    except (OSError, EOFError, LookupError, TypeError, ValueError, AttributeError, zipfile.BadZipFile) as error:
        raise ValueError(f"{path} contains no episode: {error}") from error


def _of_second_form(rest: dict[str, Any], arrays: dict[str, Any]) -> Episode:
    rest["world"] = _checked_world(rest["world"])
    rest["commands"] = tuple(Command(**command) for command in rest["commands"])
    rest["beside"] = _taken(arrays, "beside_")
    solids = tuple(_solid(solid, number, arrays) for number, solid in enumerate(rest.pop("solids")))
    parts = rest.pop("parts")
    for name, kind in PARTS.items():
        if name in parts:
            held = {**_taken(arrays, f"{name}."), **{key: _tuples(value) for key, value in parts[name].items()}}
            rest[name] = kind(**held, **({"solids": solids} if kind is EpisodeScene else {}))
    return Episode(**rest, **arrays)


def _of_first_form(rest: dict[str, Any], arrays: dict[str, Any]) -> Episode:
    """Return an episode that was stored in the format of earlier versions.

    Only episodes of built-in tasks were stored in this format. Their files do not contain the scene, so the world is
    built again to obtain it.
    """
    if "course" not in rest.setdefault("world", {}):
        rest["task"] = task_then(rest["task"])
    rest["world"] = _checked_world(rest["world"])
    where, eyes = rest["world"].evaluation, rest["phenotype"].eyes(rest["eye"])
    world = build_world(rest["task"], **where)
    task, position, heading = task_of(world, "evaluation", eyes=eyes), arrays["position"], arrays["heading"]
    objects, everyone = arrays.pop("objects"), np.arange(len(position))
    physics = task.physics(len(position), 1, None)
    try:
        physics.place(everyone, position, heading, objects[..., :2], np.zeros(objects.shape[:2]))
        poses, seconds = physics.poses(), float(physics.seconds)
    finally:
        physics.close()
    terms, adversary_first = rest["reward_terms"], arrays.pop("adversary_first", None)
    contact = arrays.pop("contact").astype(np.float32)[:, None]
    return Episode(
        **rest,
        **arrays,
        beside={"contact": contact},
        commands=task.commands(),
        counted=dict(task.counted),
        seconds=seconds,
        solved=_solved(terms["goal"] != 0, terms["adversary"] != 0, adversary_first),
        azimuths=task.azimuths(),
        elevations_deg=np.zeros(eyes.n_eyes),
        scene=EpisodeScene.from_poses(world.model, solids_of(world.model), poses, mounts_of_agent(eyes)),
        plan=task.ground_plan(position[0]),
    )


def _checked_world(stored: Mapping[str, Any]) -> WorldConfig:
    """Return the settings of a world, after a check that prevents extreme values such as a billion mazes.

    Raises:
        ConfigError: a value has the wrong type or is out of range.
    """
    world = WorldConfig(**stored)
    check_values(world, prefix="world.")
    return world


def _solved(goal: np.ndarray, adversary: np.ndarray, adversary_first: np.ndarray | None) -> bool:
    """Return whether the first object that the animal reached was a goal; False if it reached none.

    goal, adversary: True for actions that reached a goal or an adversary, (t,)
    adversary_first: True for actions that reached an adversary before a goal, (t,); None if unknown
    """
    first = goal if adversary_first is None else goal & ~adversary_first
    return bool(first[goal | adversary][:1].any())


def _arrays(path: Path | str) -> dict[str, Any]:
    """Return the arrays of an archive by name.

    Raises:
        OSError: the file cannot be read, or is not a regular file.
        ValueError: the archive would unpack to more than 2 GiB.
    """
    with regular_files.opened(Path(path)) as content:
        with zipfile.ZipFile(content) as archive:
            size = sum(member.file_size for member in archive.infolist())
        if size > MOST_BYTES:
            raise ValueError(f"it would unpack to {size:,} bytes: must be at most {MOST_BYTES:,}")
        content.seek(0)
        with np.load(content, allow_pickle=False) as file:
            return dict(file)


def _taken(arrays: dict[str, Any], prefix: str) -> dict[str, Any]:
    """Remove the arrays whose names start with `prefix`, and return them by their names without the prefix."""
    return {name.removeprefix(prefix): arrays.pop(name) for name in list(arrays) if name.startswith(prefix)}


def _tuples(value: Any) -> Any:
    """Return a list as a tuple, and any other value unchanged."""
    return tuple(value) if isinstance(value, list) else value


def _described(solid: Solid, number: int, arrays: dict[str, Any]) -> dict[str, Any]:
    """Return a solid as JSON values, and add the arrays of its mesh to `arrays`.

    number: index of the solid, which is part of the names of its arrays
    """
    if solid.triangles is not None:
        mesh = {name: array for name, array in vars(solid.triangles).items() if array is not None}
        arrays |= {f"solid{number}.{name}": array for name, array in mesh.items()}
    return asdict(replace(solid, triangles=None))


def _solid(described: Mapping[str, Any], number: int, arrays: dict[str, Any]) -> Solid:
    mesh = _taken(arrays, f"solid{number}.")
    values = {field.name: _tuples(described[field.name]) for field in fields(Solid)}
    return Solid(**{**values, "triangles": Triangles(**mesh) if mesh else None})
