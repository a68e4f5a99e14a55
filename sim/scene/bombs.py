"""Models that would fill the memory, or stand nowhere: found before they are built, and named.

A few lines of MJCF can ask for a million copies. What the text asks for is counted before MuJoCo compiles it, what a
compiled model holds before Mitsuba gets it. Files that a file includes are counted, too.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import mujoco
import numpy as np

__all__ = ["require_finite", "require_modest", "require_modest_file"]

MOST_COPIES = 20_000  # bodies, geoms and sites; the largest model that was mirrored has some hundred
MOST_CELLS = 4096**2  # of a height field
PLACES = (
    "geom_pos",
    "geom_quat",
    "geom_size",
    "body_pos",
    "body_quat",
    "mat_rgba",
    "geom_rgba",
    "light_pos",
    "light_dir",
)
FOLDERS = ("assetdir", "meshdir", "texturedir")  # of a compiler element
OWNERS = {"geom": "geom", "body": "body", "mat": "material", "light": "light"}


def require_modest(text: str, name: str) -> None:
    """Refuse MJCF that asks for more than a machine holds; text that is no XML is MuJoCo's to refuse.

    Raises:
        ValueError: one line that names what there is too much of.
    """
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError:
        return
    copies = _copies(root)
    if copies > MOST_COPIES:
        raise ValueError(f"mirror: {name} replicates to {copies:,} elements: must be at most {MOST_COPIES:,}")
    for field in root.iter("hfield"):
        cells = _count(field.get("nrow")) * _count(field.get("ncol"))
        if cells > MOST_CELLS:
            label = field.get("name", "")
            raise ValueError(f"mirror: {name}: hfield {label!r} has {cells:,} cells: must be at most {MOST_CELLS:,}")


def require_modest_file(path: Path, name: str, seen: frozenset[Path] = frozenset()) -> None:
    """The same of a file and of all that it includes; every file that it names has to be one, where it is there at
    all: MuJoCo would wait for a pipe for ever.

    Raises:
        ValueError: one line that names what there is too much of, or what is no file.
    """
    text = path.read_text(encoding="utf-8", errors="replace")
    require_modest(text, name)
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError:
        return
    folders = {path.parent / compiler.get(key, "") for compiler in root.iter("compiler") for key in FOLDERS}
    for element in root.iter():
        for file in sorted(
            folder / element.get("file", "") for folder in {path.parent, *folders} if element.get("file")
        ):
            if file.exists() and not file.is_file():
                raise ValueError(f"mirror: {name}: {element.tag} {str(file)!r}: must be a regular file")
            if element.tag == "include" and file.is_file() and file not in seen:
                require_modest_file(file, repr(str(file)), seen | {path, file})


def require_finite(model: mujoco.MjModel, name: str) -> None:
    """Refuse a model with a place, size or colour that is no number.

    Raises:
        ValueError: one line that names the thing.
    """
    for key in PLACES:
        wrong = ~np.isfinite(getattr(model, key)).all(axis=1)
        if wrong.any():
            owner, _, what = key.partition("_")
            index = int(np.argmax(wrong))
            label = getattr(model, OWNERS[owner])(index).name or str(index)
            raise ValueError(
                f"mirror: {name}: {OWNERS[owner]} {label!r}: {what} = {getattr(model, key)[index]}: must be finite"
            )


def _copies(element: ElementTree.Element) -> float:
    """Elements that there are once everything in `replicate` is copied."""
    inside = sum(_copies(child) for child in element)
    return (_count(element.get("count")) * inside if element.tag == "replicate" else inside) + 1


def _count(text: str | None) -> float:
    """A number from an attribute; what is none is MuJoCo's to refuse."""
    try:
        number = float(text or 0)
    except ValueError:
        return 0.0
    return 0.0 if math.isnan(number) else number
