"""Sources of settings: presets and their versions for short and long runs (scales), tasks, TOML files, `--set`."""

from __future__ import annotations

import re
import tomllib
from functools import reduce
from importlib import resources
from itertools import takewhile
from pathlib import Path
from typing import Any

from evolve.config.checks import ConfigError, quoted, suggestion
from evolve.config.provenance import Source
from evolve.config.run_config import TASKS

__all__ = [
    "LARGEST_TOML",
    "SCALES",
    "parsed_toml",
    "preset_about",
    "preset_names",
    "preset_sources",
    "read_assignment",
    "read_toml",
    "task_defaults",
]

Tree = dict[str, Any]
LARGEST_TOML = 2**18  # maximum size of a file [bytes]; a run's config.toml has 4,000
MOST_PARTS = 10  # maximum number of parts of a dotted key; tomllib takes a time quadratic in it
_KEY_PART = r"(?:[\w-]++|\"[^\"\n]*+\"|'[^'\n]*+')[ \t]*+"
_LONG_KEY = re.compile(rf"(?<![\w-]){_KEY_PART}(?:\.[ \t]*+{_KEY_PART}){{{MOST_PARTS}}}")
SCALES = ("laptop", "paper")  # names of the scales of presets that have several scales; the first is the default


def preset_names() -> list[str]:
    """Return the names of all presets."""
    folder = resources.files("evolve") / "presets"
    return sorted(entry.name.removesuffix(".toml") for entry in folder.iterdir() if entry.name.endswith(".toml"))


def preset_about(name: str) -> dict[str, Any]:
    """Return a preset's "name", "task", "scales" (names) and "about" (its purpose).

    The task is None if the preset can be used with any task. The purpose is the first sentence of the preset's file.
    """
    text = (resources.files("evolve") / "presets" / f"{name}.toml").read_text(encoding="utf-8")
    tree = tomllib.loads(text)
    remarks = " ".join(line.removeprefix("# ") for line in takewhile(lambda line: line[:1] == "#", text.split("\n")))
    about = re.match(r".*?[.?](?= |$)", remarks)
    scales = list(tree.get("scales", {}))
    return {"name": name, "task": tree.get("task"), "scales": scales, "about": about[0] if about else remarks}


def preset_sources(name: str | None, scale: str | None) -> list[Source]:
    """Return the sources of a preset: first its general settings, then those of a scale, which override them.

    Scales are alternative settings of a preset for shorter and longer runs. A preset without them has one source.

    name: name of the preset; None: no preset, and the result is []
    scale: name of the scale; None: "laptop" if the preset has several scales, and no scale otherwise

    Raises:
        ConfigError: the preset is unknown, or none of its scales has this name. It is also an error if `scale` is given
            without a preset, or for a preset without scales.
    """
    if name is None:
        if scale is not None:
            raise ConfigError(f"scale {quoted(scale)}: has no effect without a preset; name a preset that has scales")
        return []
    if not isinstance(name, str) or name not in preset_names():
        raise ConfigError(f"unknown preset {quoted(name)}; {suggestion(name, preset_names())}")
    text = (resources.files("evolve") / "presets" / f"{name}.toml").read_text(encoding="utf-8")
    tree = tomllib.loads(text)
    scales = tree.pop("scales", {})
    settings = Source(f"preset {name}", tree, text)
    if not scales:
        if scale is not None:
            raise ConfigError(f"scale {quoted(scale)}: preset {name} has only one scale")
        return [settings]
    chosen = scale or SCALES[0]
    if not isinstance(chosen, str) or chosen not in scales:
        raise ConfigError(f"unknown scale {quoted(chosen)} of preset {name}; {suggestion(chosen, scales)}")
    return [settings, Source(f"preset {name} on {chosen} scale", scales[chosen])]


def task_defaults(task: Any) -> Source:
    """Return the default settings of a task from evolve/config/tasks/TASK.toml.

    The result contains no settings if the task is not a built-in one or has no such file.
    """
    file = resources.files("evolve") / "config" / "tasks" / f"{task}.toml"
    known = isinstance(task, str) and task in TASKS
    return Source("", tomllib.loads(file.read_text(encoding="utf-8")) if known and file.is_file() else {})


def read_toml(path: Path) -> Source:
    """Return the settings in a TOML file. Keys and values are not checked.

    Raises:
        ConfigError: the file cannot be read or parsed, or is too large. The message is one line that names the file
            and, if known, the line in it.
    """
    try:
        with path.open("rb") as file:
            content = file.read(LARGEST_TOML + 1)  # the file may be a pipe, which has no size
        if len(content) > LARGEST_TOML:
            raise ConfigError(f"{path}: has more than {LARGEST_TOML:,} bytes: must be a TOML file of settings")
        return parsed_toml(content, str(path))
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read ({error.strerror})") from error


def parsed_toml(text: bytes | str, name: str) -> Source:
    """Return the settings in TOML text. Keys and values are not checked.

    name: name of the text in error messages

    Raises:
        ConfigError: the text is not valid TOML, or a key has too many parts; see `read_toml`.
    """
    try:
        text = text.decode("utf-8") if isinstance(text, bytes) else text
        if found := _LONG_KEY.search(text):
            line = text.count("\n", 0, found.start()) + 1
            raise ConfigError(f"{name}, line {line}: a key has more than {MOST_PARTS} parts: must be section.key")
        return Source(name, tomllib.loads(text), text)
    except UnicodeDecodeError as error:
        raise ConfigError(f"{name}: is not UTF-8 text") from error
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{name}: is not valid TOML: {error}") from error
    except (ValueError, RecursionError) as error:  # a number of 6,000 digits, or deeply nested brackets
        raise ConfigError(f"{name}: is not valid TOML: {_first_line(error)}") from error


def _first_line(error: Exception) -> str:
    return str(error).partition(";")[0].partition("\n")[0]


def read_assignment(text: str) -> Source:
    """Return the setting that a text assigns: "search.population=8" gives {"search": {"population": 8}}.

    The value is parsed as TOML. A value that is not valid TOML, such as a word without quotation marks, is text.

    Raises:
        ConfigError: the text has another form or contains several settings. It is also an error if the value has too
            many digits, or brackets that are nested too deeply.
    """
    key, equals, value = (part.strip() for part in text.partition("="))
    parts = key.split(".")
    if not equals or not all(parts) or not value or len(parts) > MOST_PARTS or _LONG_KEY.search(value):
        raise ConfigError(f"--set {quoted(text)}: must look like section.key=value")
    try:
        found: Tree = tomllib.loads(f"value = {value}")
    except tomllib.TOMLDecodeError:
        found = {"value": value}
    except (ValueError, RecursionError) as error:  # a number of 6,000 digits, or deeply nested brackets
        raise ConfigError(f"--set {key}: {_first_line(error)}") from error
    if found.keys() != {"value"}:
        raise ConfigError(f"--set {quoted(text)}: must be one setting")
    leaf: Any = found["value"]
    tree: Tree = reduce(lambda inner, part: {part: inner}, reversed(parts), leaf)
    return Source(f"--set {text.strip()}", tree)
