"""Textures whose values are proportional to light (linear light), unlike display colours.

MuJoCo displays the values of all textures in the same way. These values are therefore interpreted as display colours
(IEC 61966-2-1), as MuJoCo's other colours are. A texture contains linear light only if the model's MJCF or MjSpec
declares this by the texture's attribute `colorspace="linear"`. The compiler resolves "auto" to linear for image files
without a colour chunk, so a compiled model does not show whether linear light was declared. The function `compiled`
therefore adds to the model a custom tuple that lists the textures with this declaration. The name of the tuple ends
with "linear_textures". A user who compiles a model can add such a tuple to its MJCF:

    <custom><tuple name="linear_textures"><element objtype="texture" objname="NAME"/></tuple></custom>
"""

from __future__ import annotations

from collections.abc import Iterable

import mujoco
import numpy as np

MARK = "linear_textures"
_LINEAR = mujoco.mjtColorSpace.mjCOLORSPACE_LINEAR
_ROLES = (int(mujoco.mjtTextureRole.mjTEXROLE_RGB), int(mujoco.mjtTextureRole.mjTEXROLE_RGBA))


def compiled(spec: mujoco.MjSpec) -> mujoco.MjModel:
    """Compile a specification, and return a model that shows which textures declare `colorspace="linear"`.

    The model lists these textures in a custom tuple whose name ends with "linear_textures". Textures that `is_linear`
    recognises without the tuple are not listed.
    """
    model = spec.compile()
    requested = [k for k, texture in enumerate(spec.textures) if texture.colorspace == _LINEAR]
    unmarked = [k for k in requested if not is_linear(model, k)]
    if not unmarked:
        return model
    marked = spec.copy()
    for k, texture in enumerate(marked.textures):
        texture.name = texture.name or f"texture_{k}"
    marked.add_tuple(
        name=f"requested_{MARK}",
        objtype=[mujoco.mjtObj.mjOBJ_TEXTURE] * len(unmarked),
        objname=[marked.textures[k].name for k in unmarked],
        objprm=[0.0] * len(unmarked),
    )
    return marked.compile()


def is_linear(model: mujoco.MjModel, texture: int) -> bool:
    """Return whether a texture contains linear light.

    A mark is a custom tuple of the model whose name ends with "linear_textures". A texture contains linear light if a
    mark lists it. A 2-D texture that was not read from a file also contains linear light if the model declares it as
    linear. For files, this declaration proves nothing, because the compiler may have resolved "auto" to linear.

    Raises:
        ValueError: a mark lists an object that is not a texture.
    """
    if texture in _marked(model):
        return True
    is_flat = model.tex_type[texture] == mujoco.mjtTexture.mjTEXTURE_2D
    return bool(is_flat and model.tex_pathadr[texture] < 0 and model.tex_colorspace[texture] == _LINEAR)


def resolved(model: mujoco.MjModel) -> list[int]:
    """Return the indices of colour textures that are declared as linear, although they contain display colours."""
    sky = np.flatnonzero(model.tex_type == mujoco.mjtTexture.mjTEXTURE_SKYBOX)
    colors = {*sky.tolist(), *model.mat_texid[:, _ROLES].ravel().tolist()} - {-1}
    return [k for k in sorted(colors) if model.tex_colorspace[k] == _LINEAR and not is_linear(model, k)]


def request(spec: mujoco.MjSpec, textures: Iterable[int]) -> mujoco.MjSpec:
    """Return a copy of a specification in which the textures with these indices have `colorspace="linear"`."""
    found = spec.copy()
    for k in textures:
        found.textures[k].colorspace = _LINEAR
    return found


def _marked(model: mujoco.MjModel) -> set[int]:
    """Return the indices of the textures that are marked as linear.

    A mark is a custom tuple of the model that lists textures. The name of the tuple ends with "linear_textures".

    Raises:
        ValueError: a mark lists an object that is not a texture.
    """
    found = set[int]()
    for k in range(model.ntuple):
        if not (name := model.tuple(k).name).endswith(MARK):
            continue
        entries = slice(model.tuple_adr[k], model.tuple_adr[k] + model.tuple_size[k])
        if (model.tuple_objtype[entries] != mujoco.mjtObj.mjOBJ_TEXTURE).any():
            raise ValueError(f"tuple {name!r} lists an object that is not a texture: must list textures only")
        found |= set(model.tuple_objid[entries].tolist())
    return found
