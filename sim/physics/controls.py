"""Assignment of a model's controls to its actuators.

MuJoCo counts actuators and controls separately. For example, a servo of position and velocity has two controls, a motor
of a ball joint has three, and a passive motor has none.
"""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np


def actuator_names(model: mujoco.MjModel) -> list[str]:
    """Return the names of a model's actuators, in the model's order; "" for actuators without a name."""
    return [str(model.actuator(i).name) for i in range(model.nactuator)]


def controls_of(model: mujoco.MjModel, named: Sequence[str] | None) -> np.ndarray:
    """Return the indices in `data.ctrl` of these actuators' controls, (k,) int, in the order of the names.

    named: names of actuators; None: all controls of the model

    Raises:
        KeyError: the model has no such actuator.
    """
    if named is None:
        return np.arange(model.nu)
    actuators = [model.actuator(name).id for name in named]
    first, number = model.actuator_ctrladr, model.actuator_ctrlnum
    return np.array([first[i] + k for i in actuators for k in range(number[i])], int)
