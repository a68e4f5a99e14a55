"""Actuators with several controls, one or none drive the entries of MuJoCo's control vector that belong to them."""

import mujoco
import numpy as np
import pytest

import sim
from optics import Eye
from sim.physics.controls import controls_of

MODEL = """
<mujoco><visual><headlight active="0"/></visual>
  <worldbody>
    <light type="directional" dir="0 0 -1"/>
    <body name="head"><joint name="neck" type="ball"/><geom size=".1" mass="1"/></body>
    <body pos="0 2 0"><joint name="left" axis="0 0 1"/><geom size=".1" pos=".2 0 0" mass="1"/></body>
    <body pos="0 -2 0"><joint name="right" axis="0 0 1"/><geom size=".1" pos=".2 0 0" mass="1"/></body>
  </worldbody>
  <actuator>
    <dcmotor name="brake" joint="right" motorconst="1" resistance="1" input="none"/>
    <orientation name="gaze" joint="neck" kp="1"/>
    <motor name="left" joint="left" ctrlrange="-2 4"/>
    <pid name="right" joint="right" kp="1" input="pos vel"/>
  </actuator>
</mujoco>"""
CONTROLS = {"brake": [], "gaze": [0, 1, 2], "left": [3], "right": [4, 5]}  # in the order of the model's text


class Driver(sim.Task):
    model = MODEL
    eye = Eye(resolution=(1, 2), bands=1)
    mounts = (sim.Mount("head", offset=(0.2, 0, 0)),)
    fidelity = sim.Fidelity(1, bands=1)

    def __init__(self, *actuators):
        self.actuators = actuators or None

    def rewards(self, data):
        return {}


@pytest.mark.parametrize("name", CONTROLS)
def test_controls_are_counted_in_the_actuators_order(name):
    model = mujoco.MjModel.from_xml_string(MODEL)
    assert controls_of(model, [name]).tolist() == CONTROLS[name]
    assert controls_of(model, ["right", name]).tolist() == [4, 5, *CONTROLS[name]]
    assert controls_of(model, None).tolist() == list(range(6))


def test_one_motor_turns_its_own_joint():
    """Only the joint `left` turns, driven by 4 N m, the upper end of its range."""
    env = sim.make_vec_env(Driver("left"), n_envs=1)
    assert env.action_space.shape == (1,)
    env.reset()
    env.step(np.ones((1, 1)))
    data = env.worlds.datas[0]
    np.testing.assert_array_equal(data.ctrl, [0, 0, 0, 4, 0, 0])
    assert data.joint("left").qvel > 0.1
    assert abs(data.joint("right").qvel) < 1e-12


def test_all_of_them_take_six_numbers():
    env = sim.make_vec_env(Driver(), n_envs=1)
    assert env.action_space.shape == (6,)
    env.reset()
    env.step(np.arange(-3, 3)[None] / 4)
    np.testing.assert_allclose(env.worlds.datas[0].ctrl, [-0.75, -0.5, -0.25, 1, 0.25, 0.5])


@pytest.mark.parametrize(
    ("named", "words"),
    [
        ("brake", "Driver: actuators: 'brake' takes no control: must be one that can be driven"),
        ("gase", "Driver: actuators: 'gase': must be in the model; did you mean 'gaze'"),
    ],
)
def test_what_cannot_be_driven_is_refused(named, words):
    with pytest.raises(ValueError, match=words):
        sim.make_vec_env(Driver(named), n_envs=1)


def test_animals_that_drive_the_same_one_are_refused():
    one, other = Driver("left", "gaze"), Driver("right", "gaze")
    one.name, other.name, other.model = "One", "Other", one.model
    with pytest.raises(ValueError, match="One and Other: actuators: both drive 'gaze': must name their own"):
        sim.make_parallel_env(sim.Encounter(one, other))
    other.actuators = ("right",)
    assert sim.make_parallel_env(sim.Encounter(one, other)).action_space("Other").shape == (2,)
