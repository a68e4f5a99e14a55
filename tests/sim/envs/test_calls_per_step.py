"""Number of calls in a step of one world, most of whose time is spent in Python. Unlike times, such numbers repeat."""

from __future__ import annotations

import cProfile
import pstats
import warnings
from pathlib import Path

import mujoco
import numpy as np
import pytest

import optics
import sim

FOLDERS = tuple(str(Path(package.__file__).parent) for package in (sim, optics))
STEPS = 20
MODEL = """<mujoco><worldbody><light directional="true"/><geom type="plane" size="5 5 1"/>
  <body name="cart" pos="0 0 0.5"><joint name="x" type="slide"/><geom size="0.1"/></body></worldbody>
  <actuator><motor joint="x"/></actuator></mujoco>"""


class Cart(sim.Task):
    model = mujoco.MjModel.from_xml_string(MODEL)
    eye, fidelity = optics.Eye(resolution=(1, 1), fov_deg=20), sim.Fidelity(1, bands=1)
    mounts = (sim.Mount("cart", offset=(0, 0, 0.2)),)

    def rewards(self, data: mujoco.MjData) -> dict[str, float]:
        return {"none": 0.0}


def calls_per_step(task: str | sim.Task) -> float:
    """Return the mean number of calls of functions of `sim` and `optics` in a step of one world."""
    eyes, fidelity = None, None
    if isinstance(task, str):
        eyes, fidelity = sim.Eyes(n_eyes=1, resolution=(1, 1)), sim.Fidelity(1, bands=1)
    venv = sim.make_vec_env(task, eyes, 1, fidelity=fidelity)
    venv.reset()
    still = np.zeros((1, *venv.action_space.shape), np.float32)
    venv.step(still)
    with cProfile.Profile() as profile:
        for _ in range(STEPS):
            venv.step(still)
    venv.close()
    calls = pstats.Stats(profile).stats  # type: ignore[attr-defined]
    return sum(number for (file, *_), (_, number, *_) in calls.items() if file.startswith(FOLDERS)) / STEPS


@pytest.mark.parametrize(("task", "most"), [("detection", 205), ("navigation", 190), (Cart(), 300)])
def test_a_step_of_one_world_makes_few_calls(task: str | sim.Task, most: int):
    with warnings.catch_warnings(action="ignore"):  # the headlight's ambient part is not rendered
        assert calls_per_step(task) < most
