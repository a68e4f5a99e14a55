"""Loading of a model from an MjModel, an MjSpec, a file, or text."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import TypeAlias, TypeVar

import mujoco

from sim.scene import linear_textures
from sim.scene.bombs import require_finite, require_modest, require_modest_file

Source: TypeAlias = mujoco.MjModel | mujoco.MjSpec | str | Path
Made = TypeVar("Made")


def load(source: Source) -> mujoco.MjModel:
    """Return the model of an MjModel, an MjSpec, a file (MJCF, URDF or MJB), or MJCF text (which starts with "<").

    Raises:
        ValueError: the source does not give a model; the message is one line that names the source and the reason.
    """
    if isinstance(source, mujoco.MjModel):
        return source
    if is_compiled(source) and Path(source).is_file():
        return _checked(lambda: mujoco.MjModel.from_binary_path(str(source)), repr(str(source)))
    read, name = _specification(source)
    return _checked(lambda: linear_textures.compiled(read()), name)


def specification(source: mujoco.MjSpec | str | Path) -> mujoco.MjSpec:
    """Return a specification that can be compiled again.

    It is a copy of an MjSpec, or is read from a file (MJCF or URDF) or from MJCF text.

    Raises:
        ValueError: the source does not give a specification; the message is one line that names the source.
    """
    read, name = _specification(source)
    return _reported(read, name).copy()


def is_compiled(source: Source) -> bool:
    """Return whether a source is an MjModel or the path of an MJB file, both of which cannot be compiled again."""
    return isinstance(source, mujoco.MjModel) or (isinstance(source, str | Path) and Path(source).suffix == ".mjb")


def with_compiled_color_spaces(source: Source) -> Source:
    """Return a source of the same model whose textures request linear light explicitly, by `colorspace="linear"`.

    The request is added to colour textures whose automatic colour space the compiler resolves to linear. A source
    without such textures is returned unchanged.

    Raises:
        ValueError: the source is a compiled model with such textures, or no model can be made from the source.
    """
    model = load(source)
    if not (resolved := linear_textures.resolved(model)):
        return source
    if is_compiled(source):
        names = ", ".join(repr(model.tex(k).name) for k in resolved)
        raise ValueError(f"textures {names} of a compiled model cannot request linear light: must be MJCF or an MjSpec")
    return linear_textures.request(specification(source), resolved)


def _specification(source: mujoco.MjSpec | str | Path) -> tuple[Callable[[], mujoco.MjSpec], str]:
    """Return a function that reads a model's specification (MjSpec), and the text that names `source` in errors.

    source: an MjSpec, MJCF text, or the path of a file

    Raises:
        ValueError: the source has another type, or the file does not exist, or the text or file is too large.
    """
    if isinstance(source, mujoco.MjSpec):
        return lambda: source, f"MjSpec {source.modelname!r}"
    if isinstance(source, str) and source.lstrip().startswith("<"):
        require_modest(source, "this MJCF text")
        return lambda: mujoco.MjSpec.from_string(source), "this MJCF text"
    if not isinstance(source, str | Path):
        raise ValueError(
            f"mirror: model is a {type(source).__name__}: must be an MjModel, an MjSpec, a path or MJCF text"
        )
    if not Path(source).is_file():
        raise ValueError(f"mirror: no file {str(source)!r}; give the path of an MJCF, URDF or MJB file")
    require_modest_file(Path(source), repr(str(source)))
    return lambda: mujoco.MjSpec.from_file(str(source)), repr(str(source))


def _checked(compile_it: Callable[[], mujoco.MjModel], name: str) -> mujoco.MjModel:
    model = _reported(compile_it, name)
    require_finite(model, name)
    return model


def _reported(make: Callable[[], Made], name: str) -> Made:
    """Call `make` and return its result; raise an error of MuJoCo as a ValueError with a message of one line.

    name: text that names the source of the model in the message
    """
    try:
        return make()
    except (ValueError, mujoco.FatalError) as error:
        reason = " ".join(str(error).split()).removeprefix("Error: ").removeprefix("XML Error: ")
        missing = re.search(r"opening file '([^']*)'|resource not found|file not found", reason, re.IGNORECASE)
        fix = (
            "put the file there, or point <compiler meshdir texturedir> at it"
            if missing
            else "correct what MuJoCo names"
        )
        raise ValueError(f"mirror: {name} does not compile: {reason}; {fix}") from error
