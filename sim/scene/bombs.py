"""Checks of a model: its text must not request too many elements, and its poses, sizes and colours must be finite.

A few lines of MJCF can request a million copies. The elements of the text, including those of included files, are
counted before MuJoCo compiles it. The values of the compiled model are checked before Mitsuba receives them.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import mujoco
import numpy as np

__all__ = ["require_finite", "require_modest", "require_modest_file"]

MOST_COPIES = 20_000  # limit for the number of bodies, geoms and sites; typical models have at most a few hundred
MOST_CELLS = 4096**2  # limit for the cells of a height field
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
FOLDERS = ("assetdir", "meshdir", "texturedir")  # attributes of a compiler element
OWNERS = {"geom": "geom", "body": "body", "mat": "material", "light": "light"}


def require_modest(text: str, name: str) -> None:
    """Refuse MJCF with more than 20,000 elements, or with a height field of more than 4096² cells.

    Text that is not XML is ignored; MuJoCo refuses it.

    Raises:
        ValueError: there are too many elements, or too many cells in a height field. The message states their number.
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
    """Check a file, and all files that it includes, as `require_modest` does.

    Every existing file that is named in these files must be a regular file, since MuJoCo would wait for a pipe forever.

    Raises:
        ValueError: there are too many elements or cells, or a file is not regular. The message names the cause.
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
    """Refuse a model in which a pose, size or colour contains an infinite or undefined number.

    Poses of geoms, bodies and lights, sizes of geoms, and colours of geoms and materials are checked.

    Raises:
        ValueError: a value is not finite; the message names the element that has this value.
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
    """Return the number of elements after all `replicate` elements are expanded."""
    inside = sum(_copies(child) for child in element)
    return (_count(element.get("count")) * inside if element.tag == "replicate" else inside) + 1


def _count(text: str | None) -> float:
    """Return the number in an attribute; 0 if the attribute is missing (None) or is not a number.

    MuJoCo itself refuses text that is not a number.
    """
    try:
        number = float(text or 0)
    except ValueError:
        return 0.0
    return 0.0 if math.isnan(number) else number
