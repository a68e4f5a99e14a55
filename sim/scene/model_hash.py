"""Hash of a MuJoCo model. It is the key under which values that were computed from the model are stored.

The animals of a search are evaluated in identical worlds. Values that depend only on the world are computed for the
first animal and kept for all others.
"""

from __future__ import annotations

import hashlib

import mujoco
import numpy as np

__all__ = ["MOST_MODELS", "model_hash"]

MOST_MODELS = 16  # number of models whose values are kept; an animal has at most three sets of layouts


def model_hash(model: mujoco.MjModel) -> bytes:
    """Return a hash of the whole content of a model."""
    saved = np.empty(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, saved)
    return hashlib.blake2b(saved.data).digest()
