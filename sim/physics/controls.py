"""Which controls of a model belong to which actuators: an actuator may take several, or none.

MuJoCo counts actuators and controls apart: a servo of position and velocity takes two controls, a motor of a ball joint
three, and a passive motor none.
"""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np


def actuator_names(model: mujoco.MjModel) -> list[str]:
    """Of all of a model's actuators, in its order; "" of those without one."""
    return [str(model.actuator(i).name) for i in range(model.nactuator)]


def controls_of(model: mujoco.MjModel, named: Sequence[str] | None) -> np.ndarray:
    """Places in `data.ctrl` of what these actuators take, (k,) int: one actuator's after the other's; None: of all.

    Raises:
        KeyError: the model has no such actuator.
    """
    if named is None:
        return np.arange(model.nu)
    actuators = [model.actuator(name).id for name in named]
    first, number = model.actuator_ctrladr, model.actuator_ctrlnum
    return np.array([first[i] + k for i in actuators for k in range(number[i])], int)
