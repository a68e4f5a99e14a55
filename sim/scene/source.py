"""Loading of a model from an MjModel, an MjSpec, a file, or text."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import mujoco

from sim.scene.bombs import require_finite, require_modest, require_modest_file


def load(source: mujoco.MjModel | mujoco.MjSpec | str | Path) -> mujoco.MjModel:
    """Return the model of an MjModel, an MjSpec, a file (MJCF, URDF or MJB), or MJCF text (which starts with "<").

    Raises:
        ValueError: the source does not give a model; one line names it.
    """
    if isinstance(source, mujoco.MjModel):
        return source
    if isinstance(source, mujoco.MjSpec):
        return _compiled(source.compile, f"MjSpec {source.modelname!r}")
    if isinstance(source, str) and source.lstrip().startswith("<"):
        require_modest(source, "this MJCF text")
        return _compiled(lambda: mujoco.MjModel.from_xml_string(source), "this MJCF text")
    if not isinstance(source, str | Path):
        raise ValueError(
            f"mirror: model is a {type(source).__name__}: must be an MjModel, an MjSpec, a path or MJCF text"
        )
    if not Path(source).is_file():
        raise ValueError(f"mirror: no file {str(source)!r}; give the path of an MJCF, URDF or MJB file")
    if Path(source).suffix == ".mjb":
        return _compiled(lambda: mujoco.MjModel.from_binary_path(str(source)), repr(str(source)))
    require_modest_file(Path(source), repr(str(source)))
    return _compiled(lambda: mujoco.MjModel.from_xml_path(str(source)), repr(str(source)))


def _compiled(compile_it: Callable[[], mujoco.MjModel], name: str) -> mujoco.MjModel:
    try:
        model = compile_it()
    except (ValueError, mujoco.FatalError) as error:
        reason = " ".join(str(error).split()).removeprefix("Error: ").removeprefix("XML Error: ")
        missing = re.search(r"opening file '([^']*)'|resource not found|file not found", reason, re.IGNORECASE)
        fix = (
            "put the file there, or point <compiler meshdir texturedir> at it"
            if missing
            else "correct what MuJoCo names"
        )
        raise ValueError(f"mirror: {name} does not compile: {reason}; {fix}") from error
    require_finite(model, name)
    return model
